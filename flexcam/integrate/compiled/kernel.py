"""The compiled step: many steps of an uncoupled system with local forces in one call.

What `flexcam.integrate.stage` and `settle` do with arrays is done here number by number. Forces that hardly react to
their own effect within a step (weak ones) are taken as they come; Newton's matrix holds the others. A march ends before
a step in which a switching scalar changes sides, or whose forces do not settle: such steps are for the `Walker`.

Few arrays with many rows, indices instead of slices, no array operations: what the compiler takes decides how long its
first use lasts. The rows are named in `packed`.
"""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit as _njit  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from flexcam.integrate.compiled.machine import keeping
from flexcam.integrate.compiled.once import Inner
from flexcam.integrate.compiled.sealed import sealed
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import pointwise

F = TypeVar("F", bound=Callable[..., object])

njit: Any = _njit

_FAST = {"reassoc", "contract", "nsz"}
"""Sums may be taken in any order; what is not a number stays so."""

_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": _FAST, "_nrt": False}
"""No array is made in machine code, so none needs to know how many hold it: to count took a sixth of a step."""


def compiled(function: F) -> F:
    """Return a function in machine code; sums may be taken in any order, what is not a number stays so."""
    with keeping() as kept:
        made = njit(cache=kept, **_OPTIONS)(function)
        return cast("F", sealed(made) if kept else made)


def inner(function: F) -> F:
    """Return the same for machine code alone to call: it is neither kept by itself nor made for calls from Python.

    Such calls would end the process.
    """
    made = njit(pipeline_class=Inner, no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS)
    return cast("F", made(function))


stop, hunt_crossley, oil = inner(pointwise.stop), inner(pointwise.hunt_crossley), inner(pointwise.oil)
line_load, dissipating, sliding = inner(pointwise.line_load), inner(pointwise.dissipating), inner(pointwise.sliding)
turning = inner(pointwise.turning)


@inner
def lever(constants: FloatArray, b: int, i: int, local: FloatArray, tangent: FloatArray) -> None:
    """Put the answer of a lever's end: the true depth's force less that of its linear spring."""
    k, c, path, path_rate = constants[b], constants[b + 1], local[1, i], local[2, i]
    beyond, more, slope, bend = turning(path, constants[b + 2], constants[b + 3], constants[b + 4])
    rest = slope - more
    linear = k * (rest * path - local[1, i + 1]) + c * (rest * path_rate - local[2, i + 1])
    N = k * beyond + c * more * path_rate
    local[3, i], local[3, i + 1] = N * slope + linear * more, -N
    along = k * slope + c * bend * path_rate
    tangent[0, i, 0], tangent[0, i, 1] = slope * along - k * rest * rest + (linear + N) * bend, -k * more
    tangent[0, i + 1, 0], tangent[0, i + 1, 1] = -along + k * rest, 0.0
    tangent[1, i, 0], tangent[1, i, 1] = c * (slope * slope - rest * rest), c * (rest - slope)
    tangent[1, i + 1, 0], tangent[1, i + 1, 1] = c * (rest - slope), 0.0


@inner
def arch(constants: FloatArray, b: int, i: int, bent: int, local: FloatArray, tangent: FloatArray) -> None:
    """Put the answer of a shallow arch, as `flexcam.fem.elements.shallow.Arch` has it, in one plane or in both."""
    axial, shortened = constants[b], 0.0
    for r in range(bent):
        pull = 0.0
        for s in range(bent):
            pull += constants[b + 1 + 6 * r + s] * (local[1, i + 1 + s] + constants[b + 37 + s])
        local[3, i + 1 + r] = pull
        shortened += local[1, i + 1 + r] * (pull + constants[b + 43 + r])
    beyond = 0.5 * axial * shortened
    N = axial * local[1, i] + beyond
    local[3, i] = beyond
    for r in range(bent):
        across = axial * local[3, i + 1 + r]
        tangent[0, i, 1 + r], tangent[0, i + 1 + r, 0] = across, across
        for s in range(bent):
            tangent[0, i + 1 + r, 1 + s] = N * constants[b + 1 + 6 * r + s] + across * local[3, i + 1 + s]
    for r in range(bent):
        local[3, i + 1 + r] *= N


@compiled
def respond(
    laws: IntArray, constants: FloatArray, cam: FloatArray, k: int, column: int, half: float,
    local: FloatArray, tangent: FloatArray, states: FloatArray,
) -> None:  # fmt: skip
    """Put the answers of all laws (row 3 of the local scalars) to depths and rates (rows 1 and 2)."""
    for law in range(len(laws)):
        kind, i, b = laws[law, 0], laws[law, 1], laws[law, 3]
        gap, rate = local[1, i], local[2, i]
        given = column + laws[law, 4]
        N, by_depth, by_speed = 0.0, 0.0, 0.0
        if kind == 7:
            arch(constants, b, i, laws[law, 2] - 1, local, tangent)
            continue
        if kind == 6:
            lever(constants, b, i, local, tangent)
            continue
        if kind == 0:
            by_depth, by_speed = constants[b], constants[b + 1]
            N = by_depth * gap + by_speed * rate
        elif kind == 1:
            if gap > 0.0:
                N, by_depth, by_speed = stop(gap, rate, constants[b], constants[b + 1], constants[b + 2])
        elif kind == 2:
            N, by_depth, by_speed = hunt_crossley(gap, rate, constants[b], constants[b + 1])
        elif kind == 3:
            if gap > 0.0:
                cosine, most = cam[k, given + 1], constants[b + 5] * cam[k, given]
                load, slope = line_load(gap * cosine, most, constants[b + 1], constants[b + 2], constants[b + 3])
                width = constants[b]
                N, by_depth, by_speed = dissipating(width * load, width * slope, rate, cosine, constants[b + 4])
        elif kind == 4:
            z = laws[law, 5]
            pressed, leaked, share = oil(gap, states[2, z], half, constants[b], constants[b + 1], constants[b + 2])
            N = constants[b + 3]
            states[3, z], states[4, z] = leaked, constants[b] / constants[b + 2] * pressed
            if pressed > 0.0:
                N += constants[b] * pressed
                by_depth = constants[b] * share
                states[4, z] = constants[b] / constants[b + 1] * pressed
        else:
            by_depth = constants[b] * cam[k, given]
            N = by_depth * gap
        local[3, i], tangent[0, i, 0], tangent[1, i, 0] = N, by_depth, by_speed
        if laws[law, 2] == 2:  # Coulomb's friction on the scalar behind
            b = laws[law, 6]
            turned, turning = sliding(local[2, i + 1], constants[b + 1])
            share = constants[b] * turned
            local[3, i + 1] = share * N
            tangent[0, i + 1, 0], tangent[1, i + 1, 0] = share * by_depth, share * by_speed
            tangent[1, i + 1, 1] = constants[b] * N * turning
