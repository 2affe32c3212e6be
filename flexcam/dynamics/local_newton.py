"""The local forces of a time step: a semismooth Newton iteration on the few sensed scalars.

With the constant operator of a step, the sensed scalars are affine in the local forces: ``x = x_free + W f``. The
unknowns are the forces; `solve_local` finds those that agree with the force laws. Forces that hardly depend on their
own effect within a step are iterated by substitution; Newton's matrix contains the others. Laws that move each other
little, such as those of different valves, belong to different blocks with a matrix each: block after block takes its
Newton step under the latest forces of the others (nonlinear Gauss-Seidel iteration: J. M. Ortega and W. C. Rheinboldt,
Iterative Solution of Nonlinear Equations in Several Variables (1970), sec. 7.4). The compliance W is filled on demand,
and stays valid for scalars whose weights do not change with the cam angle.

The functions use only numbers and array elements; the direct engine runs them as Python with the two linear-algebra
functions `eliminate` and `sense` replaced by numpy (`NUMPY`), the kernel engine compiles them.
"""
# Elements of arrays are numbers to the compiler and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

import math

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.force_laws import (
    ANSWER,
    BASE,
    CHANGE,
    FIRST,
    FREE_PENETRATION,
    FREE_RATE,
    MOVED,
    MOVING,
    OWN,
    PENETRATION,
    RATE,
    SCALARS,
    SENSED,
    STALE,
    TRIAL,
    evaluate_laws,
)

TOLERANCE = 1e-12
"""Relative residual of the forces: three digits above rounding, so that the last quadratic step reaches it."""
ROUNDING = 16.0 * 2.220446049250313e-16
"""Relative rounding of the terms that a stiff law multiplies."""
MAX_ITERATIONS = 60
FULL_STEPS = 8
"""Iterations after which a Newton step must reduce the residual or is halved: contacts may open and close in turn."""
SMALLEST_PART = 1.0 / 64.0
"""Smallest fraction of a Newton step in the line search."""
WEAK = 5e-3
"""Relative change of a force by its own effect within a step below which it is weak."""
EXTRAPOLATED = 12
"""Iterations from extrapolated forces, block by block, with weak forces by substitution.

Then the iteration restarts from the forces of the last instant with one matrix for all laws, and no force is weak.
"""

SENSES, ACTS, COLUMN, SCALAR = range(4)
"""Rows of the places of scalars: where their sensing and acting vectors begin; their columns in the compliance, in
which scalars that the same forces move are neighbours; and the scalars of the columns."""


def eliminate(matrix: FloatArray, n: int, end: int) -> bool:
    """Solve a linear system whose right sides are columns n to `end`, in place; return whether it is regular.

    Gauss elimination with column pivots. Inner loops count from zero, so that the compiler vectorizes them.
    """
    for i in range(n):
        p = i
        for r in range(i + 1, n):
            if abs(matrix[r, i]) > abs(matrix[p, i]):
                p = r
        if matrix[p, i] == 0.0:
            return False
        if p != i:
            for j in range(end - i):
                value = matrix[i, i + j]
                matrix[i, i + j] = matrix[p, i + j]
                matrix[p, i + j] = value
        for r in range(i + 1, n):
            factor = matrix[r, i] / matrix[i, i]
            if factor != 0.0:
                for j in range(end - i):
                    matrix[r, i + j] -= factor * matrix[i, i + j]
    for back in range(n):
        i = n - 1 - back
        for j in range(end - n):
            matrix[i, n + j] /= matrix[i, i]
        for r in range(i):
            factor = matrix[r, i]
            for j in range(end - n):
                matrix[r, n + j] -= factor * matrix[i, n + j]
    return True


def fill_compliance(
    i: int, j: int, places: IntArray, give: FloatArray, inputs: FloatArray, k: int, sense_at: int, W: FloatArray,
) -> None:  # fmt: skip
    """Write the effect of a unit of force j on scalar i (0) and on its rate (1)."""
    rate_at, act_at = sense_at + give.shape[2], sense_at + 2 * give.shape[2]
    by_d, by_v = 0.0, 0.0
    for b in range(places[ACTS, j], places[ACTS, j + 1]):
        for s in range(places[SENSES, i], places[SENSES, i + 1]):
            d, v = give[0, b, s] * inputs[k, act_at + b], give[1, b, s] * inputs[k, act_at + b]
            by_d += inputs[k, sense_at + s] * d
            by_v += inputs[k, sense_at + s] * v + inputs[k, rate_at + s] * d
    W[0, j, places[COLUMN, i]], W[1, j, places[COLUMN, i]] = by_d, by_v


def fill_row(
    j: int, places: IntArray, reach: IntArray, give: FloatArray, inputs: FloatArray, k: int, sense_at: int,
    W: FloatArray,
) -> None:  # fmt: skip
    """Write the effect of a unit of force j on all scalars that it can move.

    Callers compare the first entry of the row, NaN until then, with itself: the call would take longer.
    """
    W[0, j, 0], W[1, j, 0] = 0.0, 0.0
    for at in range(reach[j], reach[j + 1], 2):
        for column in range(reach[at], reach[at + 1]):
            fill_compliance(places[SCALAR, column], j, places, give, inputs, k, sense_at, W)


def release(local: FloatArray) -> None:
    """Make the sensed scalars those without forces."""
    for i in range(local.shape[1]):
        local[PENETRATION, i], local[RATE, i] = local[FREE_PENETRATION, i], local[FREE_RATE, i]
        local[SENSED, i], local[STALE, i] = 0.0, 1.0


def sense(
    laws: IntArray, places: IntArray, reach: IntArray, give: FloatArray, inputs: FloatArray, k: int, sense_at: int,
    local: FloatArray, W: FloatArray,
) -> None:  # fmt: skip
    """Add what trial forces of some laws changed since they were last sensed to the scalars that they move.

    The changes are summed column by column, which the compiler vectorizes.
    """
    for law in range(len(laws)):
        first = laws[law, FIRST]
        for j in range(first, first + laws[law, SCALARS]):
            change = local[TRIAL, j] - local[SENSED, j]
            if change != 0.0:
                local[SENSED, j] = local[TRIAL, j]
                if W[0, j, 0] != W[0, j, 0]:
                    fill_row(j, places, reach, give, inputs, k, sense_at, W)
                for at in range(reach[j], reach[j + 1], 2):
                    begin = reach[at]
                    for m in range(reach[at + 1] - begin):
                        local[MOVED, begin + m] += W[0, j, begin + m] * change
                        local[MOVING, begin + m] += W[1, j, begin + m] * change
    for column in range(local.shape[1]):
        if local[MOVED, column] != 0.0 or local[MOVING, column] != 0.0:
            i = places[SCALAR, column]
            local[PENETRATION, i] += local[MOVED, column]
            local[RATE, i] += local[MOVING, column]
            local[STALE, i], local[MOVED, column], local[MOVING, column] = 1.0, 0.0, 0.0


def residual(laws: IntArray, local: FloatArray, tangent: FloatArray, usual: float) -> float:
    """Return the largest difference of trial forces and some force laws; zero if it is rounding, or NaN.

    `usual` is the size of forces among which a difference is rounding.
    """
    largest, size, rounding, total = 0.0, usual, 0.0, 0.0
    for law in range(len(laws)):
        first = laws[law, FIRST]
        for i in range(first, first + laws[law, SCALARS]):
            by_penetration, by_rate = abs(tangent[0, i, i - first]), abs(tangent[1, i, i - first])
            penetration, rate = local[FREE_PENETRATION, i], local[FREE_RATE, i]
            terms = by_penetration * (abs(penetration) + abs(local[PENETRATION, i] - penetration))
            terms += by_rate * (abs(rate) + abs(local[RATE, i] - rate))
            error, force = abs(local[TRIAL, i] - local[ANSWER, i]), abs(local[ANSWER, i])
            total += force + error
            largest, size, rounding = max(largest, error), max(size, force), max(rounding, terms)
    if largest <= TOLERANCE * size + ROUNDING * rounding or not math.isfinite(total):
        return 0.0
    return largest


def is_rounding(
    laws: IntArray, places: IntArray, reach: IntArray, give: FloatArray, inputs: FloatArray, k: int, sense_at: int,
    local: FloatArray, tangent: FloatArray, W: FloatArray, largest: float,
) -> bool:  # fmt: skip
    """Return whether the residual changes the scalars by rounding only, or is the rounding of their sums."""
    unchanged, rounding = True, 0.0
    for law in range(len(laws)):
        first = laws[law, FIRST]
        for i in range(first, first + laws[law, SCALARS]):
            penetration, rate = abs(local[FREE_PENETRATION, i]), abs(local[FREE_RATE, i])
            by_penetration, by_rate = 0.0, 0.0
            for j in range(local.shape[1]):
                if W[0, j, 0] != W[0, j, 0]:
                    fill_row(j, places, reach, give, inputs, k, sense_at, W)
                on_penetration, on_rate = abs(W[0, j, places[COLUMN, i]]), abs(W[1, j, places[COLUMN, i]])
                error = abs(local[TRIAL, j] - local[ANSWER, j])
                penetration += on_penetration * abs(local[TRIAL, j])
                rate += on_rate * abs(local[TRIAL, j])
                by_penetration += on_penetration * error
                by_rate += on_rate * error
            if by_penetration > ROUNDING * penetration or by_rate > ROUNDING * rate:
                unchanged = False
            rounding = max(rounding, abs(tangent[0, i, i - first]) * penetration + abs(tangent[1, i, i - first]) * rate)
    return unchanged or largest <= ROUNDING * rounding


def own_compliance(
    i: int, places: IntArray, reach: IntArray, give: FloatArray, inputs: FloatArray, k: int, stages: int, sense_at: int,
    W: FloatArray,
) -> float:  # fmt: skip
    """Return the largest effect of a unit of a force on its scalar, at any stage of the step.

    In the collocation a force at the end of a step does not move the end itself.
    """
    count = len(W[0]) // stages
    largest = 0.0
    for stage in range(stages):
        j = stage * count + i % count
        if W[0, j, 0] != W[0, j, 0]:
            fill_row(j, places, reach, give, inputs, k, sense_at, W)
        largest = max(largest, abs(W[0, j, places[COLUMN, i]]))
    return largest


def find_active(
    laws: IntArray, places: IntArray, reach: IntArray, give: FloatArray, inputs: FloatArray, k: int, stages: int,
    sense_at: int, slope: float, weak: float, local: FloatArray, tangent: FloatArray, active: IntArray, W: FloatArray,
) -> int:  # fmt: skip
    """Write the scalars of laws that react to their own effect (row 0, their law in row 1) and return their number.

    Trial forces of all others become the answers of their laws.
    """
    n = sense_at - sense_at  # zero as a variable: a literal would be compiled separately
    for law in range(len(laws)):
        first, size, strong = laws[law, FIRST], laws[law, SCALARS], weak < 0.0
        for i in range(first, first + size):
            reaction = 0.0
            for r in range(size):
                stiffness = abs(tangent[0, i, r]) + slope * abs(tangent[1, i, r])
                if stiffness != 0.0:
                    for j in (i, first + r):
                        if local[OWN, j] < 0.0:
                            response = own_compliance(j, places, reach, give, inputs, k, stages, sense_at, W)
                            local[OWN, j] = math.sqrt(response)
                    reaction += stiffness * local[OWN, first + r]
            strong = strong or reaction * local[OWN, i] > weak
        for i in range(first, first + size):
            if strong:
                active[0, n], active[1, n] = i, law
                n += 1
            else:
                local[TRIAL, i] = local[ANSWER, i]
    return n


def correct(
    laws: IntArray, places: IntArray, reach: IntArray, give: FloatArray, inputs: FloatArray, k: int, stages: int,
    sense_at: int, slope: float, weak: float, local: FloatArray, tangent: FloatArray, active: IntArray, W: FloatArray,
    matrix: FloatArray,
) -> bool:  # fmt: skip
    """Correct the trial forces by a Newton step on the active scalars; return whether its matrix is regular."""
    n = find_active(laws, places, reach, give, inputs, k, stages, sense_at, slope, weak, local, tangent, active, W)
    for row in range(n):
        i = active[0, row]
        first, size = laws[active[1, row], FIRST], laws[active[1, row], SCALARS]
        begin = row - (i - first)  # scalars of one law stand together
        for column in range(n):
            matrix[row, column] = 0.0
        for r in range(size):
            by_penetration, by_rate = tangent[0, i, r], tangent[1, i, r]
            if by_penetration != 0.0 or by_rate != 0.0:
                sensed = places[COLUMN, active[0, begin + r]]
                for column in range(n):
                    j = active[0, column]
                    if W[0, j, 0] != W[0, j, 0]:
                        fill_row(j, places, reach, give, inputs, k, sense_at, W)
                    matrix[row, column] -= by_penetration * W[0, j, sensed] + by_rate * W[1, j, sensed]
        matrix[row, row] += 1.0
        matrix[row, n] = local[TRIAL, i] - local[ANSWER, i]
    if not eliminate(matrix, n, n + 1):
        return False
    for row in range(n):
        local[TRIAL, active[0, row]] -= matrix[row, n]
    return True


def solve_local(
    laws: IntArray, blocks: IntArray, constants: FloatArray, places: IntArray, reach: IntArray, give: FloatArray,
    inputs: FloatArray, k: int, stages: int, sense_at: int, slope: float, local: FloatArray, tangent: FloatArray,
    states: FloatArray, active: IntArray, W: FloatArray, matrix: FloatArray,
) -> int:  # fmt: skip
    """Find the local forces that agree with the motion they cause; return the iterations, 0 without convergence.

    `blocks` says where each block of laws begins and the last one ends. `places` (4, c + 1) has the rows `SENSES` to
    `SCALAR`; entries j and j + 1 of `reach` say where, in `reach` itself, the runs of the columns of W begin and end
    whose scalars force j can move: pairs of the first column and the end of a run. `give` (2, acting, sensing) is the
    displacement (0) and velocity (1) along each sensing vector per unit of force along each acting vector.

    `inputs` has a row of prescribed inputs per instant; k is read: from column `sense_at` on the weights of the sensing
    vectors, their rates, the weights of the acting vectors, offsets, their rates and the functions of the laws.

    `stages` is the number of instants of the step; the scalars of the first come first. `slope`, 1/s, is the velocity
    per displacement by a force within a step. `local` (15, c) holds the trial forces, the free scalars and, in `BASE`,
    the forces of the last instant; the solution is in `TRIAL`, `PENETRATION`, `RATE`. The others are work arrays; W
    (2, force, column) has NaN in the first column of the rows that are not yet computed.
    """
    c, fraction, last, usual = local.shape[1], 1.0, math.inf, 0.0
    for i in range(c):
        usual = max(usual, abs(local[BASE, i]))
    functions = sense_at + 2 * give.shape[2] + give.shape[1] + 2 * c
    release(local)
    sense(laws, places, reach, give, inputs, k, sense_at, local, W)
    for iteration in range(1, EXTRAPOLATED + 1):
        size, agree = 0.0, True
        for i in range(c):
            size = max(size, abs(local[TRIAL, i]))
        for block in range(len(blocks) - 1):
            block_laws = laws[blocks[block] : blocks[block + 1]]
            if not is_stale(block_laws, local):
                continue
            evaluate_laws(block_laws, constants, inputs, k, functions, local, tangent, states)
            if residual(block_laws, local, tangent, size) != 0.0:
                agree = False
                if not correct(
                    block_laws, places, reach, give, inputs, k, stages, sense_at, slope, WEAK, local, tangent, active,
                    W, matrix,
                ):  # fmt: skip
                    local[STALE, block_laws[0, FIRST]] = 1.0
                sense(block_laws, places, reach, give, inputs, k, sense_at, local, W)
        if agree:
            keep_not_finite(local)
            return iteration
    for i in range(c):
        local[TRIAL, i] = local[BASE, i]
    for iteration in range(EXTRAPOLATED + 1, EXTRAPOLATED + MAX_ITERATIONS + 1):
        release(local)  # forces that grew before would leave their rounding
        sense(laws, places, reach, give, inputs, k, sense_at, local, W)
        evaluate_laws(laws, constants, inputs, k, functions, local, tangent, states)
        error = residual(laws, local, tangent, usual)
        if error == 0.0 or is_rounding(laws, places, reach, give, inputs, k, sense_at, local, tangent, W, error):
            keep_not_finite(local)
            return iteration
        if iteration > EXTRAPOLATED + FULL_STEPS and error > last and fraction > SMALLEST_PART:
            fraction *= 0.5
            for i in range(c):
                local[TRIAL, i] = local[BASE, i] - fraction * local[CHANGE, i]
            continue
        fraction, last = 1.0, error
        for i in range(c):
            local[BASE, i] = local[TRIAL, i]
        if not correct(
            laws, places, reach, give, inputs, k, stages, sense_at, slope, -1.0, local, tangent, active, W, matrix
        ):
            return 0
        for i in range(c):
            local[CHANGE, i] = local[BASE, i] - local[TRIAL, i]
    return 0


def is_stale(laws: IntArray, local: FloatArray) -> bool:
    """Return whether scalars of some laws changed since this was last asked."""
    stale = False
    for law in range(len(laws)):
        first = laws[law, FIRST]
        for i in range(first, first + laws[law, SCALARS]):
            stale = stale or local[STALE, i] != 0.0
            local[STALE, i] = 0.0
    return stale


def keep_not_finite(local: FloatArray) -> None:
    """Make forces that are not finite trial forces, which the engine reports."""
    for i in range(local.shape[1]):
        if not math.isfinite(local[ANSWER, i]):
            local[TRIAL, i] = local[ANSWER, i]


FUNCTIONS_OF_NEWTON = (
    eliminate, fill_compliance, fill_row, release, sense, residual, is_rounding, own_compliance, find_active, correct,
    is_stale, keep_not_finite, solve_local,
)  # fmt: skip
"""Functions for the compiler, in the order of their calls."""


def eliminate_numpy(matrix: FloatArray, n: int, end: int) -> bool:
    """Replace `eliminate` by numpy."""
    try:
        matrix[:n, n:end] = np.linalg.solve(matrix[:n, :n], matrix[:n, n:end])
    except np.linalg.LinAlgError:
        return False
    return True


def sense_numpy(
    laws: IntArray, places: IntArray, reach: IntArray, give: FloatArray, inputs: FloatArray, k: int, sense_at: int,
    local: FloatArray, W: FloatArray,
) -> None:  # fmt: skip
    """Replace `sense` by numpy, for a complete compliance."""
    local[PENETRATION] = local[FREE_PENETRATION] + local[TRIAL] @ W[0]
    local[RATE] = local[FREE_RATE] + local[TRIAL] @ W[1]
    local[STALE] = 1.0


NUMPY = {"eliminate": eliminate_numpy, "sense": sense_numpy}
"""Linear algebra functions of the iteration in Python."""
