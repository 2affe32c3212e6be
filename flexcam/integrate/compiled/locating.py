"""Where within a step contacts switch, in machine code.

As `flexcam.integrate.events` has it with arrays, by the same corrections of the same cubic. `search` holds how much
of the step is behind (s), where to look next, the bracket (times, the scalar at both, whether the later end was found
last), when the first scalar switches by the cubic, which scalar it is, its side, and how often was looked.
"""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

import math

from flexcam.integrate import crossing as plain
from flexcam.integrate.compiled.kernel import inner
from flexcam.integrate.compiled.newton import eliminated
from flexcam.integrate.crossing import CLOSE, CORRECTIONS, ROUNDING, SHARP, TOGETHER
from flexcam.linalg import FloatArray, IntArray

crossing, narrowed = inner(plain.crossing), inner(plain.narrowed)

WHOLE, REST, LOOK, LAST = 0, 1, 2, 3
"""What is tried: a whole step, the rest of one behind an event, a part of it, or its rest with an event at its end."""


@inner
def blended(x: float, points: FloatArray, table: FloatArray, given: FloatArray) -> None:
    """Put into the last row what is prescribed at a part x of a step, by the barycentric formula."""
    nodes, total, last = points.shape[1], 0.0, len(given) - 1
    for p in range(nodes):
        apart = x - points[0, p]
        points[2, p] = points[1, p] / (apart if apart != 0.0 else 1e-300)
        total += points[2, p]
    for i in range(table.shape[1]):
        value = 0.0
        for p in range(nodes):
            value += points[2, p] * table[p, i]
        given[last, i] = value / total


@inner
def operated(
    scheme: FloatArray, operator: FloatArray, give: FloatArray, coupled: FloatArray, vectors: FloatArray,
    state: FloatArray, whole: FloatArray,
) -> None:  # fmt: skip
    """Put what a step of a length does, as `packed.Operator` has it, and its acceleration without forces (row 7)."""
    new, to_d, to_v = 1.0 - scheme[4], scheme[1] * scheme[0] * scheme[0], scheme[2] * scheme[0]
    n, acts, senses = state.shape[1], give.shape[0], give.shape[1]
    for i in range(n):
        own = (1.0 - scheme[3]) * operator[0, i] + new * (to_v * operator[1, i] + to_d * operator[2, i])
        state[7, i] = state[6, i] / own
        for b in range(acts):
            operator[4 + b, i] = new * vectors[senses + b, i] / own
        if len(coupled) > 0:
            for j in range(n):
                whole[i, j] = new * to_v * coupled[i, j]
            whole[i, i] += own
            whole[i, n] = state[6, i]
            for b in range(acts):
                whole[i, n + 1 + b] = new * vectors[senses + b, i]
    if len(coupled) > 0:
        eliminated(whole, n, n + 1 + acts)
        for i in range(n):
            state[7, i] = whole[i, n]
            for b in range(acts):
                operator[4 + b, i] = whole[i, n + 1 + b]
    for b in range(acts):
        for s in range(senses):
            total = 0.0
            for i in range(n):
                total += operator[4 + b, i] * vectors[s, i]
            give[b, s] = total


@inner
def switches(h: float, forces: FloatArray, local: FloatArray, switching: IntArray, search: FloatArray) -> bool:
    """Tell whether scalars change sides in the rest of a step (row 7: when), and begin to search for the first."""
    length, first, side = h - search[0], -1, False
    search[7] = math.inf
    for one in range(switching.shape[1]):
        i, pressed = switching[0, one], switching[1, one] == 1
        local[7, i] = math.inf
        if (local[1, i] > 0.0) != pressed:
            local[7, i] = crossing(pressed, forces[1, i], local[1, i], forces[2, i], local[2, i], length)
            if local[7, i] < search[7]:
                first, side, search[7] = i, pressed, local[7, i]
    if first < 0:
        return False
    search[1], search[2], search[3], search[4], search[5] = search[7], 0.0, length, forces[1, first], local[1, first]
    search[6], search[8], search[9], search[10] = 0.0, first, 1.0 if side else 0.0, 0.0
    return True


@inner
def turned(h: float, scalars: FloatArray, local: FloatArray, switching: IntArray, search: FloatArray) -> None:
    """Put the sides on which the switching scalars (row 1) are counted behind an event."""
    for one in range(switching.shape[1]):
        i = switching[0, one]
        if abs(local[7, i] - search[7]) <= TOGETHER * (h - search[0]):
            switching[1, one] = 1 - switching[1, one]
        else:
            switching[1, one] = 1 if scalars[1, i] > 0.0 else 0


@inner
def aimed(h: float, forces: FloatArray, local: FloatArray, switching: IntArray, search: FloatArray) -> int:
    """Tell what is to be tried next: where the search points to, or more where that is an end."""
    length = h - search[0]
    if search[1] <= CLOSE * length:
        turned(h, forces, local, switching, search)
        return REST
    if search[1] >= (1.0 - CLOSE) * length:
        return LAST
    return LOOK


@inner
def met(time: float, h: float, local: FloatArray, search: FloatArray) -> bool:
    """Tell whether the scalar is zero where it was looked at; else put where to look next."""
    i, low, high = int(search[8]), search[2], search[3]
    gap, rate, sharp = local[1, i], local[2, i], max(SHARP * (h - search[0]), ROUNDING * abs(time))
    search[10] += 1.0
    if abs(gap) <= sharp * abs(rate) or high - low <= sharp or search[10] == CORRECTIONS:
        return True
    bracket = (low, high, search[4], search[5], search[6] > 0.0)
    search[1], search[2], search[3], search[4], search[5], again = narrowed(
        search[9] > 0.0, search[1], gap, rate, bracket
    )
    search[6] = 1.0 if again else 0.0
    return False
