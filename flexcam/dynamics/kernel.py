"""The kernel: many steps of a system in modal coordinates with local forces, in one call of compiled code.

A step is one stage of the generalized-alpha family, or the two stages of the collocation, at its middle and its end; a
local force then is one scalar per stage.

Arrays, a row per quantity: `state` holds q, v, a, the forces on the modes and work rows; `operator` mass, damping,
stiffness and the coefficients of a step. `answers` the response to each acting vector; `vectors` the sensing vectors
and then the acting ones; `inputs` a row per step of loads and prescribed inputs. `runs`, `answer_runs` and `mode_runs`
list the runs of nonzero entries of vectors, answers and rows of coupled modes. Their entries b and b + 1 are the places
in the array itself where the pairs of row b (first entry and end of a run) begin and end. They are unsigned: an index
that cannot be negative needs no check, so that the compiler vectorizes the loops over runs.
"""
# Elements of arrays are numbers to the compiler and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false, reportReturnType=false

from __future__ import annotations

import math

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.force_laws import (
    BASE,
    BEGIN,
    DEPTH,
    FIRST,
    FREE_PENETRATION,
    FREE_RATE,
    FUNCTIONS_OF_LAWS,
    NEW_STATE,
    OWN,
    PENETRATION,
    RATE,
    SCALARS,
    SPAN,
    STATE,
    TRIAL,
    passes_ramp,
)
from flexcam.dynamics.generalized_alpha import predict
from flexcam.dynamics.local_newton import FUNCTIONS_OF_NEWTON, SCALAR, fill_compliance, solve_local
from flexcam.dynamics.massless import massless_rates

DONE, SWITCHED, UNSETTLED, TOO_LONG = 0, 1, 2, 3
"""Results of `march`."""

LARGEST_RATIO, LARGEST_SUM = 1.0, 2.25
"""Limits of the collocation for (omega h)^2 of contacts, with the length h of a stage: of each alone, and of the sum of
those that move each other, which is not below the value of their fastest motion. The step is stable up to 1.55^2."""

Q, V, A, LOAD, Q_FREE, V_FREE, PUSH, ACCELERATION, Q_TRIAL, V_TRIAL = range(10)
"""Rows of the state: the instant; the prediction; the forces; the acceleration and the motion without local forces."""
BEGIN_FORCE, MIDDLE_FORCE, END_FORCE = 4, 5, 6
"""Rows in the collocation in place of the prediction: forces on the modes; the motion at its end follows that at its
middle."""
STATE_SIZE = 12
LAST_FORCE, LAST_PENETRATION, LAST_RATE, TREND, LAST_CHANGE, LAST_DEPTH = range(6)
"""Rows of the local forces of the last instant: force, penetration, rate, extrapolated and last change of the force,
penetration with the lift of a cam."""
FORCE_SIZE = 6
STEP, BETA, GAMMA, ALPHA_M, ALPHA_F = range(5)
"""Entries of the scheme."""
MASS, DAMPING, STIFFNESS, INVERSE = range(4)
"""Rows of the operator: matrices of the modes and the inverse of the effective mass."""
STAGE = 3
"""Row of the operator where the coefficients of the first stage of the collocation begin: of displacement, velocity and
acceleration by (q, v, force at begin, middle and end), those of the acceleration by q and v of the stage."""

PARTS = 4
"""Parts of a step of the collocation in which a contact opens or closes; even, so that a part ends at its middle."""

INPUTS, BEFORE, RESULTS, SAVED = 0, 1, 2, 4
"""Rows of the work array of divided steps: prescribed inputs of a part; those of the instant before the first row; the
results at both stages of a part; then the saved beginning of the step: modes, local forces, internal states."""
PART_ROWS = SAVED + 4 + FORCE_SIZE + 1

VANISHED = 1e-150
"""Motion below which a mode is at rest: denormal numbers are very slow."""


def dot(row: FloatArray, values: FloatArray, runs: IntArray, b: int) -> float:
    """Return the product of a row, of whose entries differ from zero those in runs, and values.

    Inner loops count from zero, so that the compiler vectorizes them.
    """
    total = 0.0
    for at in range(runs[b], runs[b + 1], 2):
        begin = runs[at]
        for m in range(runs[at + 1] - begin):
            total += row[begin + m] * values[begin + m]
    return total


def predict_modes(
    scheme: FloatArray, operator: FloatArray, coupled: FloatArray, inverse: FloatArray, mode_runs: IntArray,
    loads: FloatArray, state: FloatArray,
) -> None:  # fmt: skip
    """Write the prediction of the step, and the acceleration and motion at its end without local forces."""
    h, new, n = scheme[STEP], 1.0 - scheme[ALPHA_F], state.shape[1]
    for i in range(n):
        q, v = predict(state[Q, i], state[V, i], state[A, i], h, scheme[BETA], scheme[GAMMA])
        push = new * (loads[i] - operator[STIFFNESS, i] * q - operator[DAMPING, i] * v)
        if scheme[ALPHA_F] != 0.0 or scheme[ALPHA_M] != 0.0:
            old = state[LOAD, i] - operator[STIFFNESS, i] * state[Q, i] - operator[DAMPING, i] * state[V, i]
            push += scheme[ALPHA_F] * old - scheme[ALPHA_M] * operator[MASS, i] * state[A, i]
        state[Q_FREE, i], state[V_FREE, i], state[PUSH, i] = q, v, push
        state[ACCELERATION, i] = operator[INVERSE, i] * push
    if len(coupled) > 0:
        for i in range(n):
            state[ACCELERATION, i] = new * state[V_FREE, i] + scheme[ALPHA_F] * state[V, i]
        for i in range(n):
            state[PUSH, i] -= dot(coupled[i], state[ACCELERATION], mode_runs, i)
        for i in range(n):
            state[ACCELERATION, i] = dot(inverse[0, 0, i], state[PUSH], mode_runs, i)
    to_d, to_v = scheme[BETA] * h * h, scheme[GAMMA] * h
    for i in range(n):
        state[Q_TRIAL, i] = state[Q_FREE, i] + to_d * state[ACCELERATION, i]
        state[V_TRIAL, i] = state[V_FREE, i] + to_v * state[ACCELERATION, i]


def find_forces(
    k: int, stages: int, slope: float, give: FloatArray, vectors: FloatArray, runs: IntArray, inputs: FloatArray,
    laws: IntArray, blocks: IntArray, constants: FloatArray, places: IntArray, reach: IntArray, varying: IntArray,
    state: FloatArray, forces: FloatArray, states: FloatArray, local: FloatArray, tangent: FloatArray, active: IntArray,
    W: FloatArray, matrix: FloatArray,
) -> int:  # fmt: skip
    """Find the local forces at the stages of a step; return the iterations, 0 without convergence."""
    n, c, senses = state.shape[1], local.shape[1], give.shape[2]
    sense_at = stages * n
    offset = sense_at + 2 * senses + give.shape[1]
    for i in range(c):
        trial = Q_TRIAL + 2 * (stages * i // c)
        penetration, rate = inputs[k, offset + i], inputs[k, offset + c + i]
        for b in range(places[0, i], places[0, i + 1]):
            on_d, on_v = dot(vectors[b], state[trial], runs, b), dot(vectors[b], state[trial + 1], runs, b)
            penetration += inputs[k, sense_at + b] * on_d
            rate += inputs[k, sense_at + b] * on_v + inputs[k, sense_at + senses + b] * on_d
        local[FREE_PENETRATION, i], local[FREE_RATE, i] = penetration, rate
        local[TRIAL, i], local[BASE, i] = forces[LAST_FORCE, i] + forces[TREND, i], forces[LAST_FORCE, i]
    for v in range(len(varying)):
        i = varying[v]
        local[OWN, i], W[0, i, 0] = -1.0, math.nan
        for at in range(reach[i], reach[i + 1], 2):
            for column in range(reach[at], reach[at + 1]):
                j = places[SCALAR, column]
                if W[0, j, 0] == W[0, j, 0]:
                    fill_compliance(i, j, places, give, inputs, k, sense_at, W)
    return solve_local(
        laws, blocks, constants, places, reach, give, inputs, k, stages, sense_at, slope, local, tangent, states,
        active, W, matrix,
    )  # fmt: skip


def add_forces(
    k: int, act: int, places: IntArray, vectors: FloatArray, runs: IntArray, first: int, inputs: FloatArray,
    local: FloatArray, begin: int, state: FloatArray, row: int,
) -> None:  # fmt: skip
    """Add the effect of the local forces from `begin` on along vectors, from the first of them on, to a row."""
    for j in range(begin, local.shape[1]):
        if local[TRIAL, j] != 0.0:
            for b in range(places[1, j], places[1, j + 1]):
                weight = local[TRIAL, j] * inputs[k, act + b]
                for at in range(runs[first + b], runs[first + b + 1], 2):
                    run = runs[at]
                    for i in range(runs[at + 1] - run):
                        state[row, run + i] += weight * vectors[first + b, run + i]


def correct_modes(
    scheme: FloatArray, operator: FloatArray, loads: FloatArray, state: FloatArray, row: FloatArray
) -> None:
    """Advance the modes to the end of the step and write their motion to a row of results."""
    h, beta, gamma, n = scheme[STEP], scheme[BETA], scheme[GAMMA], state.shape[1]
    average = beta == 0.25 and gamma == 0.5 and scheme[ALPHA_M] == 0.0 and scheme[ALPHA_F] == 0.0
    for i in range(n):
        a = state[ACCELERATION, i]
        q, v = state[Q_FREE, i] + beta * h * h * a, state[V_FREE, i] + gamma * h * a
        if operator[MASS, i] == 0.0 and operator[DAMPING, i] == 0.0:
            v, a = massless_rates(q - state[Q, i], state[V, i], state[A, i], h)
        elif operator[MASS, i] == 0.0 and average:
            a = (v - state[V, i]) / h
        if abs(q) < VANISHED and abs(v) < VANISHED and abs(a) < VANISHED:
            q, v, a = 0.0, 0.0, 0.0
        state[Q, i], state[V, i], state[A, i], state[LOAD, i] = q, v, a, loads[i]
        row[i], row[n + i], row[2 * n + i] = q, v, a


def crosses_zero(local: FloatArray, switching: IntArray) -> bool:
    """Return whether a switching scalar (row 0) is on another side of zero than before (row 1)."""
    for at in range(switching.shape[1]):
        closed = local[DEPTH, switching[0, at]] > 0.0
        if closed != (switching[1, at] == 1):
            return True
    return False


def leaves_ramp(local: FloatArray, forces: FloatArray, switching: IntArray, ramps: FloatArray) -> bool:
    """Return whether a switching scalar passes the end of the ramp of its damping."""
    for at in range(min(switching.shape[1], len(ramps))):
        i = switching[0, at]
        if passes_ramp(forces[LAST_DEPTH, i], local[DEPTH, i], ramps[at]):
            return True
    return False


def contact_ratio(
    k: int, stages: int, laws: IntArray, blocks: IntArray, places: IntArray, hold: FloatArray, inputs: FloatArray,
    sense_at: int, tangent: FloatArray,
) -> float:  # fmt: skip
    """Return the largest (omega h)^2 of the contacts of a step, relative to its limit.

    `hold` (acts, senses) is h^2 times the acceleration along a sensing vector by a unit of force along an acting one,
    as far as the modes answer within a step.
    """
    acts, senses, largest = len(hold), hold.shape[1], 0.0
    act_at = sense_at + 2 * stages * senses
    for block in range(len(blocks) - 1):
        total = 0.0
        for law in range(blocks[block], blocks[block + 1]):
            first = laws[law, FIRST]
            for i in range(first, first + laws[law, SCALARS]):
                stiffness = abs(tangent[0, i, i - first])
                if stiffness != 0.0:
                    response = 0.0
                    for b in range(places[1, i], places[1, i + 1]):
                        for s in range(places[0, i], places[0, i + 1]):
                            response += hold[b % acts, s % senses] * inputs[k, act_at + b] * inputs[k, sense_at + s]
                    largest = max(largest, stiffness * abs(response) / LARGEST_RATIO)
                    total += stiffness * abs(response)
        largest = max(largest, total / (stages * LARGEST_SUM))
    return largest


def keep_forces(stages: int, forces: FloatArray, local: FloatArray) -> None:
    """Keep the local forces of a step as the last ones, and extrapolate them to the next step.

    Stages of the collocation lie at equal distances: a cubic leads through those of the last two steps, and after the
    first step a parabola through the last three instants.
    """
    count = local.shape[1] // stages
    for j in range(local.shape[1]):
        change = local[TRIAL, j] - forces[LAST_FORCE, j]
        if stages == 1:
            forces[TREND, j] = change if forces[LAST_CHANGE, j] == 0.0 else 2.0 * change - forces[LAST_CHANGE, j]
        elif j < count:
            end = count + j
            f2, f1, f0 = forces[LAST_FORCE, end], local[TRIAL, j], local[TRIAL, end]
            f3 = f0 - 3.0 * (f1 - f2) if forces[LAST_CHANGE, j] == 0.0 else forces[LAST_FORCE, j]
            forces[TREND, j], forces[TREND, end] = (
                4.0 * f0 - 7.0 * f1 + 4.0 * f2 - f3, 9.0 * f0 - 20.0 * f1 + 15.0 * f2 - 4.0 * f3
            )  # fmt: skip
        forces[LAST_CHANGE, j] = change
    for j in range(local.shape[1]):
        forces[LAST_FORCE, j], forces[LAST_PENETRATION, j] = local[TRIAL, j], local[PENETRATION, j]
        forces[LAST_RATE, j], forces[LAST_DEPTH, j] = local[RATE, j], local[DEPTH, j]


def stage_value(operator: FloatArray, row: int, i: int, q: float, v: float, state: FloatArray) -> float:
    """Return the quantity of mode i whose coefficients begin at a row of the operator."""
    return (
        operator[row, i] * q + operator[row + 1, i] * v + operator[row + 2, i] * state[BEGIN_FORCE, i]
        + operator[row + 3, i] * state[MIDDLE_FORCE, i] + operator[row + 4, i] * state[END_FORCE, i]
    )  # fmt: skip


def move_stages(operator: FloatArray, state: FloatArray) -> None:
    """Write the motion at both stages under the forces on the modes."""
    for i in range(state.shape[1]):
        q, v = state[Q, i], state[V, i]
        for stage in range(2):
            row = STAGE + 15 * stage
            state[Q_TRIAL + 2 * stage, i] = stage_value(operator, row, i, q, v, state)
            state[V_TRIAL + 2 * stage, i] = stage_value(operator, row + 5, i, q, v, state)


def predict_stages(
    operator: FloatArray, coupled: FloatArray, inverse: FloatArray, mode_runs: IntArray, loads: FloatArray,
    state: FloatArray,
) -> None:  # fmt: skip
    """Write the forces on the modes and the motion at both stages without local forces."""
    n = state.shape[1]
    for i in range(n):
        state[BEGIN_FORCE, i], state[MIDDLE_FORCE, i], state[END_FORCE, i] = state[LOAD, i], loads[i], loads[n + i]
    if len(coupled) > 0:
        for i in range(n):
            state[BEGIN_FORCE, i] -= dot(coupled[i], state[V], mode_runs, i)
    move_stages(operator, state)
    if len(coupled) > 0:
        for i in range(n):
            middle, end = 0.0, 0.0
            for at in range(mode_runs[i], mode_runs[i + 1], 2):
                begin = mode_runs[at]
                for m in range(mode_runs[at + 1] - begin):
                    at_middle, at_end = state[V_TRIAL, begin + m], state[V_TRIAL + 2, begin + m]
                    middle += inverse[0, 0, i, begin + m] * at_middle + inverse[0, 1, i, begin + m] * at_end
                    end += inverse[1, 0, i, begin + m] * at_middle + inverse[1, 1, i, begin + m] * at_end
            state[MIDDLE_FORCE, i] -= middle
            state[END_FORCE, i] -= end
        move_stages(operator, state)


def correct_stages(operator: FloatArray, loads: FloatArray, state: FloatArray, rows: FloatArray) -> None:
    """Advance the modes to the end of a collocation step and write their motion to the rows of both stages."""
    n = state.shape[1]
    move_stages(operator, state)
    for i in range(n):
        q, v, a = 0.0, 0.0, 0.0
        for stage in range(2):
            q, v = state[Q_TRIAL + 2 * stage, i], state[V_TRIAL + 2 * stage, i]
            a = stage_value(operator, STAGE + 15 * stage + 10, i, q, v, state)
            if abs(q) < VANISHED and abs(v) < VANISHED and abs(a) < VANISHED:
                q, v, a = 0.0, 0.0, 0.0
            rows[stage, i], rows[stage, n + i], rows[stage, 2 * n + i] = q, v, a
        state[Q, i], state[V, i], state[A, i], state[LOAD, i] = q, v, a, loads[n + i]


def accept(
    k: int, stages: int, scheme: FloatArray, operator: FloatArray, answers: FloatArray, answer_runs: IntArray,
    vectors: FloatArray, runs: IntArray, inputs: FloatArray, places: IntArray, state: FloatArray, forces: FloatArray,
    states: FloatArray, local: FloatArray, rows: FloatArray,
) -> None:  # fmt: skip
    """Advance everything to the end of the step and write a row of results per stage."""
    n, senses, last = state.shape[1], len(vectors) - answers.shape[1], stages - 1
    c, inner, act = local.shape[1] // stages, states.shape[1] // stages, stages * n + 2 * senses
    for stage in range(stages):
        row = ACCELERATION if stages == 1 else MIDDLE_FORCE + stage
        add_forces(k, act, places, answers[stage], answer_runs, 0, inputs, local, 0, state, row)
        for j in range(c):
            rows[stage, 3 * n + j] = local[TRIAL, stage * c + j]
        for z in range(inner):
            rows[stage, 3 * n + c + z] = states[NEW_STATE, stage * inner + z]
    keep_forces(stages, forces, local)
    for j in range(c):
        forces[LAST_PENETRATION, j] = forces[LAST_PENETRATION, last * c + j]  # all stages begin where the step begins
    for z in range(states.shape[1]):
        states[STATE, z] = states[NEW_STATE, last * inner + z % inner]
    if stages == 2:
        correct_stages(operator, inputs[k], state, rows)
    else:
        correct_modes(scheme, operator, inputs[k], state, rows[0])
    add_forces(k, act, places, vectors, runs, senses, inputs, local, last * c, state, LOAD)


def changes_side(local: FloatArray, forces: FloatArray, touching: IntArray, stages: int) -> bool:
    """Return whether one of some scalars is on another side of zero at a stage than at the beginning of the step."""
    count = local.shape[1] // stages
    for at in range(len(touching)):
        i = touching[at]
        closed = forces[LAST_DEPTH, (stages - 1) * count + i] > 0.0
        for stage in range(stages):
            if (local[DEPTH, stage * count + i] > 0.0) != closed:
                return True
    return False


def interpolate(cuts: IntArray, before: FloatArray, row: FloatArray, part: int, into: FloatArray) -> None:
    """Write the prescribed inputs at both stages of a part of a step; parts count from 1.

    They lie on the parabola through the inputs at the end of the row before, and at middle and end of this row. `cuts`
    are the columns at which a kind of inputs begins, with its values at both stages.
    """
    for p in range(len(cuts) - 1):
        begin, size = cuts[p], (cuts[p + 1] - cuts[p]) // 2
        for stage in range(2):
            x = (part - 0.5 + 0.5 * stage) / PARTS
            for i in range(size):
                first, middle, last = before[begin + size + i], row[begin + i], row[begin + size + i]
                slope, bend = 4.0 * middle - 3.0 * first - last, 2.0 * (first - 2.0 * middle + last)
                into[begin + stage * size + i] = first + x * (slope + x * bend)


def copy_rows(count: int, source: FloatArray, into: FloatArray) -> None:
    """Copy the first rows of an array to another one, which may have more or fewer columns."""
    for row in range(count):
        for i in range(min(source.shape[1], into.shape[1])):
            into[row, i] = source[row, i]


def forget_trend(forces: FloatArray) -> None:
    """Begin the extrapolation of the local forces again."""
    for j in range(forces.shape[1]):
        forces[TREND, j], forces[LAST_CHANGE, j] = 0.0, 0.0


def march(
    begin: int, end: int, stages: int, lengths: FloatArray, slopes: FloatArray, scheme: FloatArray,
    operator: FloatArray, answers: FloatArray, answer_runs: IntArray, give: FloatArray, hold: FloatArray,
    inverse: FloatArray, coupled: FloatArray, mode_runs: IntArray, vectors: FloatArray, runs: IntArray,
    inputs: FloatArray, cuts: IntArray, parts: FloatArray, laws: IntArray, blocks: IntArray, constants: FloatArray,
    places: IntArray, reach: IntArray, owners: IntArray, varying: IntArray, touching: IntArray, state: FloatArray,
    forces: FloatArray, states: FloatArray, local: FloatArray, tangent: FloatArray, active: IntArray, W: FloatArray,
    matrix: FloatArray, switching: IntArray, ramps: FloatArray, results: FloatArray, count: IntArray,
) -> int:  # fmt: skip
    """Advance over rows of the prescribed inputs; return how it ended.

    The state, the local forces and the internal states advance; `count` receives the row reached and the iterations.
    The integration ends before a step in which a switching scalar changes sides or passes the ramp of its damping, the
    local forces do not converge, or contacts are too stiff for its length. A step in which a touching scalar changes
    sides is divided into `PARTS`.

    Arrays that depend on the length of a step have an axis in front: whole steps, then parts. Results have a row per
    stage.
    """
    k, part, n = begin, 0, state.shape[1]
    while k < end:
        count[0] = k
        level = 1 if part > 0 else 0
        source, at = inputs, k
        if part > 0:
            interpolate(cuts, inputs[k - 1] if k > 0 else parts[BEFORE], inputs[k], part, parts[INPUTS])
            source, at = parts, INPUTS
        if stages == 2:
            predict_stages(operator[level], coupled, inverse[level], mode_runs, source[at], state)
        else:
            predict_modes(scheme, operator[level], coupled, inverse[level], mode_runs, source[at], state)
        for z in range(states.shape[1]):
            states[BEGIN, z] = forces[LAST_PENETRATION, owners[z]]
            states[SPAN, z] = lengths[level] * (1 + z * stages // states.shape[1])
        iterations = find_forces(
            at, stages, slopes[level], give[level], vectors, runs, source, laws, blocks, constants, places, reach,
            varying, state, forces, states, local[level], tangent, active, W[level], matrix,
        )  # fmt: skip
        crossed = iterations > 0 and (
            crosses_zero(local[level], switching) or leaves_ramp(local[level], forces, switching, ramps)
        )
        if iterations == 0 or crossed:
            if part > 0:
                copy_rows(4, parts[SAVED:], state)
                copy_rows(FORCE_SIZE, parts[SAVED + 4 :], forces)
                copy_rows(1, parts[SAVED + 4 + FORCE_SIZE :], states)
            return SWITCHED if crossed else UNSETTLED
        count[1] += iterations
        if part == 0:
            if len(hold) > 0 and contact_ratio(
                k, stages, laws, blocks, places, hold, inputs, stages * n, tangent
            ) > 1.0:  # fmt: skip
                return TOO_LONG
            if changes_side(local[0], forces, touching, stages):
                copy_rows(4, state, parts[SAVED:])
                copy_rows(FORCE_SIZE, forces, parts[SAVED + 4 :])
                copy_rows(1, states, parts[SAVED + 4 + FORCE_SIZE :])
                forget_trend(forces)
                part = 1
                continue
        rows = parts[RESULTS:SAVED] if part > 0 else results[stages * k : stages * (k + 1)]
        accept(
            at, stages, scheme, operator[level], answers[level], answer_runs, vectors, runs, source, places, state,
            forces, states, local[level], rows,
        )  # fmt: skip
        if 2 * part == PARTS or part == PARTS:
            copy_rows(1, parts[RESULTS + 1 :], results[stages * k + 2 * part // PARTS - 1 :])
        if part == PARTS:
            forget_trend(forces)
        part = (part + 1) % (PARTS + 1) if part > 0 else 0
        if part == 0:
            k += 1
    count[0] = end
    return DONE


FUNCTIONS_OF_KERNEL = (
    predict, massless_rates, *FUNCTIONS_OF_LAWS, *FUNCTIONS_OF_NEWTON, dot, predict_modes, find_forces, add_forces,
    correct_modes, crosses_zero, leaves_ramp, contact_ratio, keep_forces, stage_value, move_stages, predict_stages,
    correct_stages, accept, changes_side, interpolate, copy_rows, forget_trend, march,
)  # fmt: skip
"""Functions for the compiler, in the order of their calls."""
