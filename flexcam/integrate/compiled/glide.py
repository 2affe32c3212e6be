"""The compiled march where no local forces act: little to compile, and little to do."""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false

from __future__ import annotations

from flexcam.integrate.compiled.kernel import compiled
from flexcam.integrate.compiled.stepping import advanced, freed, multiplied, shown
from flexcam.linalg import FloatArray


@compiled
def glide(
    begin: int, end: int, scheme: FloatArray, operator: FloatArray, inverse: FloatArray, coupled: FloatArray,
    histories: FloatArray, vectors: FloatArray, loads: FloatArray, state: FloatArray, found: FloatArray,
) -> None:  # fmt: skip
    """Advance from row `begin` of the loads' histories up to `end`; the state moves along."""
    for k in range(begin, end):
        for i in range(state.shape[1]):
            load = 0.0
            for one in range(len(vectors)):
                load += histories[k, one] * vectors[one, i]
            loads[i] = load
        freed(scheme, operator, coupled, loads, state)
        if len(inverse) > 0:
            multiplied(inverse, state[6], state[7])
        advanced(scheme, operator, loads, state)
        shown(state, found[k])
