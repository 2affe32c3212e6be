"""One step in machine code: what it would come to, and how it is taken.

Arrays stand together, so that few are handed on: `operator` has mass, damping, stiffness and the inverse of the step's
operator, and what unit forces add to the accelerations; `vectors` those that sense and those that act; `given` a row
per step of loads, of what follows from the cam (`PackedForces.cam`) and of the time.
"""

# Numbers taken out of arrays are numbers to the compiler, and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

from flexcam.integrate.compiled.kernel import inner
from flexcam.integrate.compiled.newton import settled
from flexcam.integrate.led import BETA, GAMMA
from flexcam.linalg import FloatArray, IntArray

_GONE = 1e-150
"""Motion that is none any more: what dies out further would end in numbers that processors handle very slowly."""


@inner
def freed(scheme: FloatArray, operator: FloatArray, coupled: FloatArray, loads: FloatArray, state: FloatArray) -> None:
    """Put where a step leads without its acceleration (rows 4, 5), what accelerates it without forces (6), that (7).

    Where damping couples motions, the acceleration is not known from a motion alone: row 7 is to be put behind.
    """
    h, beta, gamma, alpha_m, alpha_f = scheme[0], scheme[1], scheme[2], scheme[3], scheme[4]
    new, n = 1.0 - alpha_f, state.shape[1]
    for i in range(n):
        there = state[0, i] + h * state[1, i] + (0.5 - beta) * h * h * state[2, i]
        moving = state[1, i] + (1.0 - gamma) * h * state[2, i]
        right = new * (loads[i] - operator[2, i] * there - operator[1, i] * moving)
        if alpha_f != 0.0 or alpha_m != 0.0:
            old = state[3, i] - operator[2, i] * state[0, i] - operator[1, i] * state[1, i]
            right += alpha_f * old - alpha_m * operator[0, i] * state[2, i]
        state[4, i], state[5, i], state[6, i], state[7, i] = there, moving, right, operator[3, i] * right
    if len(coupled) > 0:
        for i in range(n):
            state[7, i] = new * state[5, i] + alpha_f * state[1, i]
        for i in range(n):
            slowed = 0.0
            for j in range(n):
                slowed += coupled[i, j] * state[7, j]
            state[6, i] -= slowed


@inner
def answered(
    k: int, scheme: FloatArray, give: FloatArray, vectors: FloatArray, given: FloatArray, laws: IntArray,
    constants: FloatArray, places: IntArray, state: FloatArray, forces: FloatArray, states: FloatArray,
    local: FloatArray, tangent: FloatArray, moved: FloatArray, stiff: IntArray, matrix: FloatArray,
) -> int:  # fmt: skip
    """Find the local forces at a step's end; return the iterations, 0 if there are no such forces.

    Before, what they sense without their own effect (rows 4 and 5), and a guess.
    """
    half, to_d, to_v = 0.5 * scheme[0], scheme[1] * scheme[0] * scheme[0], scheme[2] * scheme[0]
    n, c, senses = state.shape[1], local.shape[1], give.shape[1]
    offset = n + 2 * senses + give.shape[0]
    for i in range(n):
        state[8, i] = state[4, i] + to_d * state[7, i]
        state[9, i] = state[5, i] + to_v * state[7, i]
    for i in range(c):
        gap, rate = given[k, offset + i], given[k, offset + c + i]
        for b in range(places[0, i], places[0, i + 1]):
            on_d, on_v = 0.0, 0.0
            for m in range(n):
                on_d += vectors[b, m] * state[8, m]
                on_v += vectors[b, m] * state[9, m]
            gap += given[k, n + b] * on_d
            rate += given[k, n + b] * on_v + given[k, n + senses + b] * on_d
        local[4, i], local[5, i], local[0, i] = gap, rate, forces[0, i] + forces[3, i]
        local[6, i], local[8, i] = -1.0, forces[0, i]
    for z in range(states.shape[1]):
        states[2, z] = states[0, z] + half * states[1, z]
    return settled(
        laws, constants, places, give, given, k, n, half, to_d, to_v, local, tangent, states, moved, stiff, matrix
    )


@inner
def pushed(
    k: int, act: int, places: IntArray, vectors: FloatArray, first: int, given: FloatArray, local: FloatArray,
    total: FloatArray,
) -> None:  # fmt: skip
    """Add what the local forces do along vectors, from the first of them on."""
    for j in range(local.shape[1]):
        if local[0, j] != 0.0:
            for b in range(places[1, j], places[1, j + 1]):
                weight = local[0, j] * given[k, act + b]
                for i in range(len(total)):
                    total[i] += weight * vectors[first + b, i]


@inner
def multiplied(matrix: FloatArray, vector: FloatArray, product: FloatArray) -> None:
    """Put a matrix times a vector."""
    for i in range(len(vector)):
        total = 0.0
        for j in range(len(vector)):
            total += matrix[i, j] * vector[j]
        product[i] = total


@inner
def advanced(scheme: FloatArray, operator: FloatArray, loads: FloatArray, state: FloatArray) -> None:
    """Let motion and loads move along to a step's end; what has no mass is led as `flexcam.integrate.led` has it."""
    h = scheme[0]
    average = scheme[1] == 0.25 and scheme[2] == 0.5 and scheme[3] == 0.0 and scheme[4] == 0.0
    to_d, to_v = scheme[1] * scheme[0] * scheme[0], scheme[2] * scheme[0]
    for i in range(state.shape[1]):
        a = state[7, i]
        q, v = state[4, i] + to_d * a, state[5, i] + to_v * a
        if operator[0, i] == 0.0 and operator[1, i] == 0.0:
            a = ((q - state[0, i]) / h - state[1, i] - (0.5 - BETA) * h * state[2, i]) / (BETA * h)
            v = state[1, i] + h * ((1.0 - GAMMA) * state[2, i] + GAMMA * a)
        elif operator[0, i] == 0.0 and average:
            a = (v - state[1, i]) / h
        still = abs(q) < _GONE and abs(v) < _GONE and abs(a) < _GONE
        state[0, i], state[1, i], state[2, i] = (0.0, 0.0, 0.0) if still else (q, v, a)
        state[3, i] = loads[i]


@inner
def shown(state: FloatArray, row: FloatArray) -> None:
    """Put displacement, velocity and acceleration into a row of results."""
    n = state.shape[1]
    for i in range(n):
        row[i], row[n + i], row[2 * n + i] = state[0, i], state[1, i], state[2, i]


@inner
def taken(
    k: int, trend: float, scheme: FloatArray, operator: FloatArray, vectors: FloatArray, given: FloatArray,
    places: IntArray, state: FloatArray, forces: FloatArray, states: FloatArray, local: FloatArray, row: FloatArray,
) -> None:  # fmt: skip
    """Let everything move along to a step's end, and put it into a row of results.

    With a trend of one, local forces are taken to go on changing as they do; with zero, nothing is known of that.
    """
    n, c, senses = state.shape[1], local.shape[1], len(vectors) + 4 - len(operator)
    pushed(k, n + 2 * senses, places, operator, len(operator) - len(vectors) + senses, given, local, state[7])
    for j in range(c):
        change = trend * (local[0, j] - forces[0, j])
        forces[3, j] = change if forces[4, j] == 0.0 else 2.0 * change - forces[4, j]  # what the next guess adds
        forces[4, j] = change
        forces[0, j], forces[1, j], forces[2, j] = local[0, j], local[1, j], local[2, j]
        row[3 * n + j] = local[0, j]
    for z in range(states.shape[1]):
        states[0, z], states[1, z] = states[3, z], states[4, z]
        row[3 * n + c + z] = states[0, z]
    advanced(scheme, operator, given[k], state)
    pushed(k, n + 2 * senses, places, vectors, senses, given, local, state[3])
    shown(state, row)
