"""The compiled march where no local forces act: little to compile, and little to do."""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false

from __future__ import annotations

from flexcam.integrate.compiled.kernel import compiled, inner
from flexcam.integrate.compiled.stepping import advanced, freed, multiplied, shown
from flexcam.linalg import FloatArray


@inner
def watching(watched: FloatArray, state: FloatArray, row: FloatArray) -> None:
    """Put what rows make of displacement, velocity and acceleration."""
    rows = len(watched)
    for r in range(rows):
        on_d, on_v, on_a = 0.0, 0.0, 0.0
        for i in range(state.shape[1]):
            on_d += watched[r, i] * state[0, i]
            on_v += watched[r, i] * state[1, i]
            on_a += watched[r, i] * state[2, i]
        row[r], row[rows + r], row[2 * rows + r] = on_d, on_v, on_a


@compiled
def glide(
    begin: int, end: int, scheme: FloatArray, operator: FloatArray, inverse: FloatArray, coupled: FloatArray,
    histories: FloatArray, vectors: FloatArray, loads: FloatArray, state: FloatArray, watched: FloatArray,
    found: FloatArray,
) -> None:  # fmt: skip
    """Advance from row `begin` of the loads' histories up to `end`; the state moves along.

    Where rows are watched, only what they make of the motions is found.
    """
    for k in range(begin, end):
        for i in range(state.shape[1]):
            load = 0.0
            for one in range(len(vectors)):
                load += histories[k, one] * vectors[one, i]
            loads[i] = load
        freed(scheme, operator, coupled, loads, state)
        if len(inverse) > 0:
            multiplied(inverse, state[6], state[7])
        advanced(scheme, loads, state)
        if len(watched) > 0:
            watching(watched, state, found[k])
        else:
            shown(state, found[k])
