"""The local forces of a step in machine code: Newton's iteration on those that react to themselves."""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

import math

from flexcam.integrate.compiled.kernel import inner, respond
from flexcam.linalg import FloatArray, IntArray

_TOLERANCE = 1e-12
_ROUNDING = 16.0 * 2.220446049250313e-16
_MOST_ITERATIONS = 60
_WHOLE_STEPS = 20
_WEAK = 0.02
"""Change of a force by its own effect within a step, as a part of it, below which it is weak."""

_PATIENT = 12
"""Iterations after which no force is taken for weak any more."""


@inner
def eliminated(matrix: FloatArray, n: int, end: int) -> bool:
    """Solve a system whose right sides are columns n up to an end, by Gauss with the largest pivot; tell whether."""
    for i in range(n):
        p = i
        for r in range(i + 1, n):
            if abs(matrix[r, i]) > abs(matrix[p, i]):
                p = r
        if matrix[p, i] == 0.0:
            return False
        if p != i:
            for j in range(i, end):
                kept = matrix[i, j]
                matrix[i, j] = matrix[p, j]
                matrix[p, j] = kept
        for r in range(i + 1, n):
            part = matrix[r, i] / matrix[i, i]
            if part != 0.0:
                for j in range(i, end):
                    matrix[r, j] -= part * matrix[i, j]
    for i in range(n - 1, -1, -1):
        for j in range(n, end):
            matrix[i, j] /= matrix[i, i]
        for r in range(i):
            part = matrix[r, i]
            for j in range(n, end):
                matrix[r, j] -= part * matrix[i, j]
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
    """Correct the forces (row 0): by Newton's step where they react to themselves, by the laws' answer elsewhere."""
    turn, act = sense + give.shape[1], sense + 2 * give.shape[1]
    n = act - act  # zero, as a number: a literal one would be compiled apart
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
        local[0, stiff[0, row]] -= part * matrix[0, row, n]
    return True


@inner
def settled(
    laws: IntArray, constants: FloatArray, places: IntArray, give: FloatArray, given: FloatArray, k: int, sense: int,
    half: float, to_d: float, to_v: float, local: FloatArray, tangent: FloatArray, states: FloatArray,
    moved: FloatArray, stiff: IntArray, matrix: FloatArray,
) -> int:  # fmt: skip
    """Find the local forces that agree with the motion they cause; return the iterations, 0 if there are none."""
    c, senses = local.shape[1], give.shape[1]
    turn, act = sense + senses, sense + 2 * senses
    functions = act + give.shape[0] + 2 * c
    for iteration in range(1, _MOST_ITERATIONS + 1):
        for s in range(senses):
            moved[s] = 0.0
        for j in range(c):
            if local[0, j] != 0.0:
                for b in range(places[1, j], places[1, j + 1]):
                    weight = local[0, j] * given[k, act + b]
                    for s in range(senses):
                        moved[s] += give[b, s] * weight
        for i in range(c):
            by_d, by_v = 0.0, 0.0
            for s in range(places[0, i], places[0, i + 1]):
                by_d += to_d * given[k, sense + s] * moved[s]
                by_v += (to_v * given[k, sense + s] + to_d * given[k, turn + s]) * moved[s]
            local[1, i], local[2, i] = local[4, i] + by_d, local[5, i] + by_v
        respond(laws, constants, given, k, functions, half, local, tangent, states)
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
        if not corrected(laws, places, give, given, k, sense, to_d, to_v, iteration, local, tangent, stiff, matrix):
            return 0
    return 0
