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

import math
from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from flexcam.integrate.compiled.machine import keeping
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import pointwise

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Return a function in machine code; sums may be taken in any order, what is not a number stays so.

    Parameters
    ----------
    function
        Of numbers and arrays.

    Returns
    -------
    Callable
        Compiled at its first call, or fetched if it is kept.
    """
    fast = {"reassoc", "contract", "nsz"}
    with keeping() as kept:
        return cast("F", njit(cache=kept, nogil=True, error_model="numpy", fastmath=fast)(function))


stop, hunt_crossley, oil = compiled(pointwise.stop), compiled(pointwise.hunt_crossley), compiled(pointwise.oil)
line_load, dissipating = compiled(pointwise.line_load), compiled(pointwise.dissipating)

DONE, SWITCHED, UNSETTLED = 0, 1, 2
"""How a march ends."""

_TOLERANCE = 1e-12
_ROUNDING = 16.0 * 2.220446049250313e-16
_MOST_ITERATIONS = 60
_WHOLE_STEPS = 20
_WEAK = 0.02
"""Change of a force by its own effect within a step, as a part of it, below which it is weak."""

_GONE = 1e-150
"""Motion that is none any more: what dies out further would end in numbers that processors handle very slowly."""

_PATIENT = 12
"""Iterations after which no force is taken for weak any more."""


@compiled
def lever(constants: FloatArray, b: int, i: int, local: FloatArray, tangent: FloatArray) -> None:
    """Put the answer of a lever's end: the true depth's force less that of its linear spring."""
    k, c, arm, driven, start = constants[b], constants[b + 1], constants[b + 2], constants[b + 3], constants[b + 4]
    path, there = local[1, i], start + local[1, i] / driven
    share = arm / driven
    y = arm * (math.sin(there) - math.sin(start))
    slope, bend, rest = share * math.cos(there), -share / driven * math.sin(there), share * math.cos(start)
    moved, path_rate, moved_rate = local[1, i + 1], local[2, i], local[2, i + 1]
    N = k * (y - moved) + c * (slope * path_rate - moved_rate)
    linear = k * (rest * path - moved) + c * (rest * path_rate - moved_rate)
    local[3, i], local[3, i + 1] = N * slope - linear * rest, -N + linear
    along = k * slope + c * bend * path_rate
    tangent[0, i, 0], tangent[0, i, 1] = slope * along - k * rest * rest + N * bend, k * (rest - slope)
    tangent[0, i + 1, 0], tangent[0, i + 1, 1] = -along + k * rest, 0.0
    tangent[1, i, 0], tangent[1, i, 1] = c * (slope * slope - rest * rest), c * (rest - slope)
    tangent[1, i + 1, 0], tangent[1, i + 1, 1] = c * (rest - slope), 0.0


@compiled
def arch(constants: FloatArray, b: int, i: int, local: FloatArray, tangent: FloatArray) -> None:
    """Put the answer of a shallow arch, as `flexcam.fem.elements.shallow.Arch` has it."""
    axial, shortened = constants[b], 0.0
    for r in range(6):
        pull = 0.0
        for s in range(6):
            pull += constants[b + 1 + 6 * r + s] * (local[1, i + 1 + s] + constants[b + 37 + s])
        local[3, i + 1 + r] = pull
        shortened += local[1, i + 1 + r] * (pull + constants[b + 43 + r])
    beyond = 0.5 * axial * shortened
    N = axial * local[1, i] + beyond
    local[3, i] = beyond
    for r in range(6):
        across = axial * local[3, i + 1 + r]
        tangent[0, i, 1 + r], tangent[0, i + 1 + r, 0] = across, across
        for s in range(6):
            tangent[0, i + 1 + r, 1 + s] = N * constants[b + 1 + 6 * r + s] + across * local[3, i + 1 + s]
    for r in range(6):
        local[3, i + 1 + r] *= N


@compiled
def respond(
    laws: IntArray, constants: FloatArray, cam: FloatArray, k: int, column: int, half: float,
    local: FloatArray, tangent: FloatArray, inner: FloatArray,
) -> None:  # fmt: skip
    """Put the answers of all laws (row 3 of the local scalars) to depths and rates (rows 1 and 2)."""
    for law in range(len(laws)):
        kind, i, b = laws[law, 0], laws[law, 1], laws[law, 3]
        gap, rate = local[1, i], local[2, i]
        given = column + laws[law, 4]
        N, by_depth, by_speed = 0.0, 0.0, 0.0
        if kind == 7:
            arch(constants, b, i, local, tangent)
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
            pressed, leaked, share = oil(gap, inner[2, z], half, constants[b], constants[b + 1], constants[b + 2])
            N = constants[b + 3]
            inner[3, z], inner[4, z] = leaked, constants[b] / constants[b + 2] * pressed
            if pressed > 0.0:
                N += constants[b] * pressed
                by_depth = constants[b] * share
                inner[4, z] = constants[b] / constants[b + 1] * pressed
        else:
            by_depth = constants[b] * cam[k, given]
            N = by_depth * gap
        local[3, i], tangent[0, i, 0], tangent[1, i, 0] = N, by_depth, by_speed
        if laws[law, 2] == 2:  # Coulomb's friction on the scalar behind
            b = laws[law, 6]
            turned = math.tanh(local[2, i + 1] / constants[b + 1])
            share = constants[b] * turned
            local[3, i + 1] = share * N
            tangent[0, i + 1, 0], tangent[1, i + 1, 0] = share * by_depth, share * by_speed
            tangent[1, i + 1, 1] = constants[b] * N * (1.0 - turned * turned) / constants[b + 1]


@compiled
def eliminated(matrix: FloatArray, n: int) -> bool:
    """Solve a small system whose right side is column n, by Gauss with the largest pivot; tell whether it could be."""
    for i in range(n):
        p = i
        for r in range(i + 1, n):
            if abs(matrix[r, i]) > abs(matrix[p, i]):
                p = r
        if matrix[p, i] == 0.0:
            return False
        for j in range(i, n + 1):
            kept = matrix[i, j]
            matrix[i, j] = matrix[p, j]
            matrix[p, j] = kept
        for r in range(i + 1, n):
            part = matrix[r, i] / matrix[i, i]
            for j in range(i, n + 1):
                matrix[r, j] -= part * matrix[i, j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            matrix[i, n] -= matrix[i, j] * matrix[j, n]
        matrix[i, n] /= matrix[i, i]
    return True


@compiled
def moved_by(
    i: int, j: int, places: IntArray, give: FloatArray, cam: FloatArray, k: int, sense: int, act: int
) -> float:
    """Return what a unit of force j does to scalar i, per unit of what acceleration adds."""
    found = 0.0
    for b in range(places[1, j], places[1, j + 1]):
        for s in range(places[0, i], places[0, i + 1]):
            found += cam[k, sense + s] * give[b, s] * cam[k, act + b]
    return found


@compiled
def corrected(
    laws: IntArray, places: IntArray, give: FloatArray, cam: FloatArray, k: int, to_d: float, to_v: float,
    iteration: int, local: FloatArray, tangent: FloatArray, stiff: IntArray, matrix: FloatArray,
) -> bool:  # fmt: skip
    """Correct the forces (row 0): by Newton's step where they react to themselves, by the laws' answer elsewhere."""
    turn, act = give.shape[1], 2 * give.shape[1]
    sense = act - 2 * turn  # zero, as a number: a literal one would be compiled apart
    n = sense
    part, weak = 1.0, _WEAK
    if iteration > _WHOLE_STEPS:
        part = 0.5
    if iteration > _PATIENT:
        weak = -1.0  # also those that react through others alone
    for law in range(len(laws)):
        first, size = laws[law, 1], laws[law, 2]
        strong = False
        for i in range(first, first + size):
            reaction = 0.0
            for r in range(size):
                reaction += (to_d * abs(tangent[0, i, r]) + to_v * abs(tangent[1, i, r])) * local[6, first + r]
            if reaction * local[6, i] > weak:
                strong = True
        for i in range(first, first + size):
            if strong:
                stiff[0, n], stiff[1, n] = i, law
                n += 1
            else:
                local[0, i] = local[3, i]
    for row in range(n):
        for column in range(n):
            moved = moved_by(stiff[0, row], stiff[0, column], places, give, cam, k, sense, act)
            turned = moved_by(stiff[0, row], stiff[0, column], places, give, cam, k, turn, act)
            matrix[1, row, column], matrix[2, row, column] = to_d * moved, to_v * moved + to_d * turned
    for row in range(n):
        i = stiff[0, row]
        first, size = laws[stiff[1, row], 1], laws[stiff[1, row], 2]
        begin = row - (i - first)  # scalars of one law stand together
        for column in range(n):
            matrix[0, row, column] = 0.0
        for r in range(size):
            by_gap, by_rate = tangent[0, i, r], tangent[1, i, r]
            if by_gap != 0.0 or by_rate != 0.0:
                for column in range(n):
                    moved, turned = matrix[1, begin + r, column], matrix[2, begin + r, column]
                    matrix[0, row, column] -= by_gap * moved + by_rate * turned
        matrix[0, row, row] += 1.0
        matrix[0, row, n] = local[0, i] - local[3, i]
    if not eliminated(matrix[0], n):
        return False
    for row in range(n):
        local[0, stiff[0, row]] -= part * matrix[0, row, n]
    return True


@compiled
def settled(
    laws: IntArray, constants: FloatArray, places: IntArray, give: FloatArray, cam: FloatArray, k: int,
    half: float, to_d: float, to_v: float, local: FloatArray, tangent: FloatArray, inner: FloatArray,
    moved: FloatArray, stiff: IntArray, matrix: FloatArray,
) -> int:  # fmt: skip
    """Find the local forces that agree with the motion they cause; return the iterations, 0 if there are none."""
    c, senses = local.shape[1], give.shape[1]
    act = 2 * senses
    functions = act + give.shape[0] + 2 * c
    for iteration in range(1, _MOST_ITERATIONS + 1):
        for s in range(senses):
            moved[s] = 0.0
        for j in range(c):
            if local[0, j] != 0.0:
                for b in range(places[1, j], places[1, j + 1]):
                    weight = local[0, j] * cam[k, act + b]
                    for s in range(senses):
                        moved[s] += give[b, s] * weight
        for i in range(c):
            by_d, by_v = 0.0, 0.0
            for s in range(places[0, i], places[0, i + 1]):
                by_d += to_d * cam[k, s] * moved[s]
                by_v += (to_v * cam[k, s] + to_d * cam[k, senses + s]) * moved[s]
            local[1, i], local[2, i] = local[4, i] + by_d, local[5, i] + by_v
        respond(laws, constants, cam, k, functions, half, local, tangent, inner)
        worst, size, rounding, total = 0.0, 0.0, 0.0, 0.0
        for law in range(len(laws)):
            first = laws[law, 1]
            for i in range(first, first + laws[law, 2]):
                by_gap, by_rate = abs(tangent[0, i, i - first]), abs(tangent[1, i, i - first])
                own = by_gap * (abs(local[4, i]) + abs(local[1, i] - local[4, i]))
                own += by_rate * (abs(local[5, i]) + abs(local[2, i] - local[5, i]))
                off, force = abs(local[0, i] - local[3, i]), abs(local[3, i])
                total += force + off
                if off > worst:
                    worst = off
                if force > size:
                    size = force
                if own > rounding:
                    rounding = own
        if worst <= _TOLERANCE * size + _ROUNDING * rounding or not math.isfinite(total):
            for i in range(c):
                local[0, i] = local[3, i]
            return iteration
        if not corrected(laws, places, give, cam, k, to_d, to_v, iteration, local, tangent, stiff, matrix):
            return 0
    return 0


@compiled
def march(
    begin: int, end: int, scheme: FloatArray, motions: FloatArray, coupled: FloatArray, inverse: FloatArray,
    loads: FloatArray, state: FloatArray, laws: IntArray, constants: FloatArray, places: IntArray, switching: IntArray,
    sensing: FloatArray, acting: FloatArray, give: FloatArray, answering: FloatArray, watched: FloatArray,
    cam: FloatArray, forces: FloatArray, local: FloatArray, tangent: FloatArray, inner: FloatArray,
    moved: FloatArray, stiff: IntArray, matrix: FloatArray, found: FloatArray, count: IntArray,
) -> int:  # fmt: skip
    """Advance from row `begin` of what is prescribed up to `end`, and tell how it ended.

    The state (q, v, a and the forces on the motions; the local forces; the internal states) moves along. `count` takes
    the row reached and the iterations. No switching scalar is looked at where none is named. Where
    rows are watched, and no local forces act, only what they make of the motions is found.
    """
    h, beta, gamma, alpha_m, alpha_f = scheme[0], scheme[1], scheme[2], scheme[3], scheme[4]
    new, to_d, to_v, half = 1.0 - alpha_f, beta * h * h, gamma * h, 0.5 * h
    n, c, s, senses = state.shape[1], local.shape[1], inner.shape[1], give.shape[1]
    act, offset, rows = 2 * senses, 2 * senses + give.shape[0], len(watched)
    sense = act - 2 * senses
    for k in range(begin, end):
        count[0] = k
        for i in range(n):
            there = state[0, i] + h * state[1, i] + (0.5 - beta) * h * h * state[2, i]
            moving = state[1, i] + (1.0 - gamma) * h * state[2, i]
            right = new * (loads[k, i] - motions[2, i] * there - motions[1, i] * moving)
            if alpha_f != 0.0 or alpha_m != 0.0:
                old = state[3, i] - motions[2, i] * state[0, i] - motions[1, i] * state[1, i]
                right += alpha_f * old - alpha_m * motions[0, i] * state[2, i]
            state[4, i], state[5, i], state[6, i], state[7, i] = there, moving, right, motions[3, i] * right
        if len(coupled) > 0:
            for i in range(n):
                slowed = 0.0
                for j in range(n):
                    slowed += coupled[i, j] * (new * state[5, j] + alpha_f * state[1, j])
                state[6, i] -= slowed
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += inverse[i, j] * state[6, j]
                state[7, i] = total
        if c > 0:
            for i in range(n):
                state[8, i] = state[4, i] + to_d * state[7, i]
                state[9, i] = state[5, i] + to_v * state[7, i]
            for i in range(c):
                gap, rate = cam[k, offset + i], cam[k, offset + c + i]
                for b in range(places[0, i], places[0, i + 1]):
                    on_d, on_v = 0.0, 0.0
                    for m in range(n):
                        on_d += sensing[b, m] * state[8, m]
                        on_v += sensing[b, m] * state[9, m]
                    gap += cam[k, b] * on_d
                    rate += cam[k, b] * on_v + cam[k, senses + b] * on_d
                local[4, i], local[5, i], local[0, i] = gap, rate, forces[0, i] + forces[3, i]
                local[6, i] = math.sqrt(abs(moved_by(i, i, places, give, cam, k, sense, act)))
            for z in range(s):
                inner[2, z] = inner[0, z] + half * inner[1, z]
            iterations = settled(
                laws, constants, places, give, cam, k, half, to_d, to_v, local, tangent, inner, moved, stiff, matrix
            )
            if iterations == 0:
                return UNSETTLED
            for one in range(switching.shape[1]):
                if (local[1, switching[0, one]] > 0.0) != (switching[1, one] == 1):
                    return SWITCHED
            count[1] += iterations
            for j in range(c):
                forces[3, j] = local[0, j] - forces[0, j]  # and as much again is the next guess
                forces[0, j], forces[1, j], forces[2, j] = local[0, j], local[1, j], local[2, j]
                found[k, 3 * n + j] = local[0, j]
                if local[0, j] != 0.0:
                    for b in range(places[1, j], places[1, j + 1]):
                        weight = local[0, j] * cam[k, act + b]
                        for i in range(n):
                            state[7, i] += weight * answering[b, i]
            for z in range(s):
                inner[0, z], inner[1, z] = inner[3, z], inner[4, z]
                found[k, 3 * n + c + z] = inner[0, z]
        for i in range(n):
            a = state[7, i]
            q, v = state[4, i] + to_d * a, state[5, i] + to_v * a
            still = abs(q) < _GONE and abs(v) < _GONE and abs(a) < _GONE
            state[0, i], state[1, i], state[2, i] = (0.0, 0.0, 0.0) if still else (q, v, a)
            state[3, i] = loads[k, i]
        if rows > 0:  # nothing else of this step is asked for
            for r in range(rows):
                on_d, on_v, on_a = 0.0, 0.0, 0.0
                for i in range(n):
                    on_d += watched[r, i] * state[0, i]
                    on_v += watched[r, i] * state[1, i]
                    on_a += watched[r, i] * state[2, i]
                found[k, r], found[k, rows + r], found[k, 2 * rows + r] = on_d, on_v, on_a
        else:
            for i in range(n):
                found[k, i], found[k, n + i], found[k, 2 * n + i] = state[0, i], state[1, i], state[2, i]
        for j in range(c):
            if local[0, j] != 0.0:
                for b in range(places[1, j], places[1, j + 1]):
                    weight = local[0, j] * cam[k, act + b]
                    for i in range(n):
                        state[3, i] += weight * acting[b, i]
    count[0] = end
    return DONE
