"""The local forces of a step in machine code: Newton's iteration on those that react to themselves."""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

import math

from flexcam.integrate.compiled.kernel import inner, respond
from flexcam.integrate.iteration import LEAST_PART, MOST_ITERATIONS, ROUNDING, TOLERANCE, WHOLE_STEPS
from flexcam.linalg import FloatArray, IntArray

_WEAK = 2e-3
"""Change of a force by its own effect within a step, as a part of it, below which it is weak."""

_SHORT = 12
"""Iterations that may be short ones, from a guess, with weak forces taken as they come. Behind them all begins anew as
in `flexcam.integrate.settle`: from the forces of the last instant, none of them weak."""


@inner
def eliminated(matrix: FloatArray, n: int, end: int) -> bool:
    """Solve a system whose right sides are columns n up to an end, by Gauss with the largest pivot; tell whether.

    Inner loops count from zero: where no index can count from an array's end, the compiler takes many at once.
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
                kept = matrix[i, i + j]
                matrix[i, i + j] = matrix[p, i + j]
                matrix[p, i + j] = kept
        for r in range(i + 1, n):
            part = matrix[r, i] / matrix[i, i]
            if part != 0.0:
                for j in range(end - i):
                    matrix[r, i + j] -= part * matrix[i, i + j]
    for back in range(n):
        i = n - 1 - back
        for j in range(end - n):
            matrix[i, n + j] /= matrix[i, i]
        for r in range(i):
            part = matrix[r, i]
            for j in range(end - n):
                matrix[r, n + j] -= part * matrix[i, n + j]
    return True


@inner
def moved_by(
    i: int, j: int, places: IntArray, give: FloatArray, given: FloatArray, k: int, sense: int, act: int
) -> float:
    """Return what a unit of force j does to scalar i, per unit of what acceleration adds."""
    found = 0.0
    for b in range(places[1, j], places[1, j + 1]):
        for s in range(places[0, i], places[0, i + 1]):
            found += given[k, sense + s] * give[b, s] * given[k, act + b]
    return found


@inner
def corrected(
    laws: IntArray, places: IntArray, give: FloatArray, given: FloatArray, k: int, sense: int, to_d: float, to_v: float,
    iteration: int, local: FloatArray, tangent: FloatArray, stiff: IntArray, matrix: FloatArray,
) -> bool:  # fmt: skip
    """Correct the forces (row 0): by Newton's step where they react to themselves, by the laws' answer elsewhere.

    What those do to each other (matrices 1 and 2) holds for all iterations of a step as long as they are the same ones,
    and so does what a force does to its own scalar (row 6).
    """
    turn, act = sense + give.shape[1], sense + 2 * give.shape[1]
    n = act - act  # zero, as a number: a literal one would be compiled apart
    weak = _WEAK if iteration <= _SHORT else -1.0  # also those that react through others alone
    same = iteration > 1
    for law in range(len(laws)):
        first, size = laws[law, 1], laws[law, 2]
        reacts, strong = False, weak < 0.0
        for i in range(first, first + size):
            for r in range(size):
                reacts = reacts or tangent[0, i, r] != 0.0 or tangent[1, i, r] != 0.0
        if reacts and local[6, first] < 0.0:
            for i in range(first, first + size):
                local[6, i] = math.sqrt(abs(moved_by(i, i, places, give, given, k, sense, act)))
        for i in range(first, first + size):
            reaction = 0.0
            for r in range(size if reacts else 0):
                reaction += (to_d * abs(tangent[0, i, r]) + to_v * abs(tangent[1, i, r])) * local[6, first + r]
            strong = strong or reaction * local[6, i] > weak
        for i in range(first, first + size):
            if strong:
                same = same and stiff[0, n] == i
                stiff[0, n], stiff[1, n] = i, law
                n += 1
            else:
                local[0, i] = local[3, i]
    if n < stiff.shape[1]:
        stiff[0, n] = -1  # one more the next time is another one
    for row in range(0 if same else n):
        for column in range(n):
            moved = moved_by(stiff[0, row], stiff[0, column], places, give, given, k, sense, act)
            turned = moved_by(stiff[0, row], stiff[0, column], places, give, given, k, turn, act)
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
    if not eliminated(matrix[0], n, n + 1):
        return False
    for row in range(n):
        local[0, stiff[0, row]] -= matrix[0, row, n]
    return True


@inner
def sensed(
    places: IntArray, give: FloatArray, given: FloatArray, k: int, sense: int, to_d: float, to_v: float,
    local: FloatArray, moved: FloatArray,
) -> None:  # fmt: skip
    """Put what is sensed under the forces (rows 1 and 2)."""
    senses = give.shape[1]
    turn, act = sense + senses, sense + 2 * senses
    for s in range(senses):
        moved[s] = 0.0
    for j in range(local.shape[1]):
        if local[0, j] != 0.0:
            for b in range(places[1, j], places[1, j + 1]):
                weight = local[0, j] * given[k, act + b]
                for s in range(senses):
                    moved[s] += give[b, s] * weight
    for i in range(local.shape[1]):
        by_d, by_v = 0.0, 0.0
        for s in range(places[0, i], places[0, i + 1]):
            by_d += to_d * given[k, sense + s] * moved[s]
            by_v += (to_v * given[k, sense + s] + to_d * given[k, turn + s]) * moved[s]
        local[1, i], local[2, i] = local[4, i] + by_d, local[5, i] + by_v


@inner
def missed(laws: IntArray, local: FloatArray, tangent: FloatArray, usual: float) -> float:
    """Return how far the forces are from the laws' answers; zero where that is rounding, or not a number."""
    worst, size, rounding, total = 0.0, usual, 0.0, 0.0
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
    if worst <= TOLERANCE * size + ROUNDING * rounding or not math.isfinite(total):
        return 0.0
    return worst


@inner
def negligible(
    laws: IntArray, places: IntArray, give: FloatArray, given: FloatArray, k: int, sense: int, to_d: float, to_v: float,
    local: FloatArray, tangent: FloatArray, off: float,
) -> bool:  # fmt: skip
    """Tell whether what is missing moves nothing but by rounding, or is the rounding of the sums that are sensed."""
    turn, act = sense + give.shape[1], sense + 2 * give.shape[1]
    still, rounding = True, 0.0
    for law in range(len(laws)):
        first = laws[law, 1]
        for i in range(first, first + laws[law, 2]):
            gap, rate, by_gap, by_rate = abs(local[4, i]), abs(local[5, i]), 0.0, 0.0
            for j in range(local.shape[1]):
                moved = moved_by(i, j, places, give, given, k, sense, act)
                turned = moved_by(i, j, places, give, given, k, turn, act)
                on_gap, on_rate = abs(to_d * moved), abs(to_v * moved + to_d * turned)
                missing = abs(local[0, j] - local[3, j])
                gap += on_gap * abs(local[0, j])
                rate += on_rate * abs(local[0, j])
                by_gap += on_gap * missing
                by_rate += on_rate * missing
            if by_gap > ROUNDING * gap or by_rate > ROUNDING * rate:
                still = False
            rounding = max(rounding, abs(tangent[0, i, i - first]) * gap + abs(tangent[1, i, i - first]) * rate)
    return still or off <= ROUNDING * rounding


@inner
def settled(
    laws: IntArray, constants: FloatArray, places: IntArray, give: FloatArray, given: FloatArray, k: int, sense: int,
    half: float, to_d: float, to_v: float, local: FloatArray, tangent: FloatArray, states: FloatArray,
    moved: FloatArray, stiff: IntArray, matrix: FloatArray,
) -> int:  # fmt: skip
    """Find the local forces that agree with the motion they cause; return the iterations, 0 if there are none.

    Row 8 of the local scalars holds the forces of the last instant, then those that a correction (row 9) is made to.
    """
    c, part, last, usual = local.shape[1], 1.0, math.inf, 0.0
    for i in range(c):
        usual = max(usual, abs(local[8, i]))
    functions = sense + 2 * give.shape[1] + give.shape[0] + 2 * c
    for iteration in range(1, _SHORT + MOST_ITERATIONS + 1):
        if iteration == _SHORT + 1:
            for i in range(c):
                local[0, i] = local[8, i]
        sensed(places, give, given, k, sense, to_d, to_v, local, moved)
        respond(laws, constants, given, k, functions, half, local, tangent, states)
        off = missed(laws, local, tangent, usual if iteration > _SHORT else 0.0)
        if off == 0.0 or (
            iteration > _SHORT and negligible(laws, places, give, given, k, sense, to_d, to_v, local, tangent, off)
        ):
            for i in range(c):
                if not math.isfinite(local[3, i]):
                    local[0, i] = local[3, i]  # is reported; a finite answer is farther off than a force that settled
            return iteration
        if iteration <= _SHORT:
            corrected(laws, places, give, given, k, sense, to_d, to_v, iteration, local, tangent, stiff, matrix)
        elif iteration > _SHORT + WHOLE_STEPS and off > last and part > LEAST_PART:
            part *= 0.5
            for i in range(c):
                local[0, i] = local[8, i] - part * local[9, i]
        else:
            part, last = 1.0, off
            for i in range(c):
                local[8, i] = local[0, i]
            if not corrected(laws, places, give, given, k, sense, to_d, to_v, iteration, local, tangent, stiff, matrix):
                return 0
            for i in range(c):
                local[9, i] = local[8, i] - local[0, i]
    return 0
