"""The compiled march: many steps of an uncoupled system with local forces in one call.

What `flexcam.integrate.stage` and `settle` do with arrays is done here number by number. A step in which a switching
scalar changes sides is walked from event to event where its `Windows` are given; a march ends before a step for which
they are not, or whose forces do not settle: that is for the `Walker`.

Few arrays with many rows, indices instead of slices, no array operations, no tuples of arrays: what the compiler takes
decides how long its first use lasts. The rows are named in `packed` and `calling`.
"""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false

from __future__ import annotations

from flexcam.integrate.compiled.kernel import compiled, inner
from flexcam.integrate.compiled.locating import (
    LAST,
    LOOK,
    REST,
    WHOLE,
    aimed,
    blended,
    met,
    operated,
    switches,
    turned,
)
from flexcam.integrate.compiled.stepping import answered, freed, multiplied, taken
from flexcam.integrate.crossing import MOST_EVENTS
from flexcam.linalg import FloatArray, IntArray

DONE, SWITCHED, UNSETTLED = 0, 1, 2
"""How a march ends."""


@compiled
def put(source: FloatArray, target: FloatArray) -> None:
    """Copy the rows that both arrays have."""
    for r in range(min(len(source), len(target))):
        for i in range(source.shape[1]):
            target[r, i] = source[r, i]


@inner
def held(
    motion: FloatArray, forces: FloatArray, states: FloatArray, motion_kept: FloatArray, forces_kept: FloatArray,
    states_kept: FloatArray, switching: IntArray, sides: int, sides_kept: int,
) -> None:  # fmt: skip
    """Copy an instant, with the sides of its switching scalars."""
    put(motion, motion_kept)
    put(forces, forces_kept)
    put(states, states_kept)
    for one in range(switching.shape[1]):
        switching[sides_kept, one] = switching[sides, one]


@compiled
def march(
    begin: int, end: int, scheme: FloatArray, operator: FloatArray, give: FloatArray, inverse: FloatArray,
    coupled: FloatArray, vectors: FloatArray, given: FloatArray, laws: IntArray, constants: FloatArray,
    places: IntArray, state: FloatArray, forces: FloatArray, states: FloatArray, local: FloatArray, tangent: FloatArray,
    moved: FloatArray, stiff: IntArray, matrix: FloatArray, switching: IntArray,
    found: FloatArray, count: IntArray, whole: FloatArray, points: FloatArray, search: FloatArray, tables: FloatArray,
    windows: IntArray, events: FloatArray, kept: FloatArray, forces_kept: FloatArray, states_kept: FloatArray,
) -> int:  # fmt: skip
    """Advance from row `begin` of what is prescribed up to `end`, and tell how it ended.

    The state (q, v, a and the forces on the motions; the local forces; the internal states) moves along. `count` takes
    the row reached, the iterations, the events and the rows of them. No switching scalar is looked at where none is
    named.
    """
    h, last, columns, c = scheme[0, 0], len(given) - 1, found.shape[1], local.shape[1]
    k, mode, counted, before, window = begin, WHOLE, count[2], count[3], -1
    search[0] = 0.0
    while k < end:
        count[0] = k
        time, row, slot = given[k, given.shape[1] - 1], k, min(mode, 1)
        if mode == LOOK:
            row = last
            blended((search[0] + search[1]) / h, points, tables[window], given)
        if mode != WHOLE:
            scheme[1, 0] = search[1] if mode == LOOK else h - search[0]
        freed(scheme[slot], operator[slot], coupled, given[row], state)
        if mode != WHOLE:
            operated(scheme[slot], operator[slot], give[slot], coupled, vectors, state, whole)
        elif len(inverse) > 0:
            multiplied(inverse, state[6], state[7])
        iterations = answered(
            row, scheme[slot], give[slot], vectors, given, laws, constants, places, state, forces, states, local,
            tangent, moved, stiff, matrix,
        )  # fmt: skip
        if iterations == 0:
            if mode == WHOLE:
                return UNSETTLED
            break
        count[1] += iterations
        if mode == LOOK:
            if not met(time, h, local, search):
                mode = aimed(h, forces, local, switching, search)
                continue
            turned(h, local, local, switching, search)
            taken(
                row, 0.0, scheme[slot], operator[slot], vectors, given, places, state, forces, states, local,
                events[count[3]],
            )  # fmt: skip
            search[0] += search[1]
            events[count[3], columns], events[count[3], columns + 1] = time - h + search[0], k
            count[3] += 1
            mode = REST
            continue
        if mode == LAST:
            turned(h, local, local, switching, search)
        elif switches(h, forces, local, switching, search):
            if mode == WHOLE:
                counted, before, window = count[2], count[3], k - windows[0]
                if window < 0 or window >= len(tables) or before + MOST_EVENTS > len(events):
                    return SWITCHED
                if windows[1 + window] == 0:
                    return SWITCHED
                held(state, forces, states, kept, forces_kept, states_kept, switching, 1, 2)
                for j in range(c):
                    forces[3, j], forces[4, j] = 0.0, 0.0
            count[2] += 1
            if count[2] - counted > MOST_EVENTS:
                break
            mode = aimed(h, forces, local, switching, search)
            continue
        taken(
            k, 1.0 if mode == WHOLE else 0.0, scheme[slot], operator[slot], vectors, given, places, state, forces,
            states, local, found[k],
        )  # fmt: skip
        k, mode, search[0] = k + 1, WHOLE, 0.0
    if k == end:
        count[0] = end
        return DONE
    held(kept, forces_kept, states_kept, state, forces, states, switching, 2, 1)
    count[2], count[3] = counted, before
    return SWITCHED
