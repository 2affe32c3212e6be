"""Initial state of a run and the camshaft's drive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flexcam.case.case import Case
from flexcam.case.schema.run import FreeRunningRecord, GivenStartRecord, ResultStartRecord
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.dynamics import (
    ConstantSpeed,
    Drive,
    FluctuatingSpeed,
    Problem,
    SpeedByAngle,
    State,
    System,
    installed_state,
    moving_equilibrium,
    solve_periodic,
)
from flexcam.io import read_result, resolve_file
from flexcam.io.result_reader import unknown_fields
from flexcam.valvetrain import Model, build_structure, free_running

_REVOLUTION = 2.0 * math.pi
_SAME_ANGLE = 1e-9  # tolerance for equal cam angles, rad: rounding of speed times time


def camshaft_drive(case: Case, model: Model, start: float = 0.0) -> Drive:
    """Return the drive of the camshaft."""
    run = case.record.run
    if run.fluctuation is not None:
        swing = run.fluctuation
        phases = swing.phases or [0.0] * len(swing.orders)
        return FluctuatingSpeed(case.speed, tuple(swing.orders), tuple(swing.amplitudes), tuple(phases), start)
    if run.free_running is not None:
        return _free_running_drive(case, model, run.free_running, start)
    return ConstantSpeed(case.speed, start)


def _free_running_drive(
    case: Case, model: Model, free: FreeRunningRecord, angle: float, time: float = 0.0
) -> SpeedByAngle:  # fmt: skip
    return free_running(model, case.speed, free.cam, free.cam_mass, free.follower_mass, angle, time)


def revolution_time(case: Case, drive: Drive) -> float:
    """Return the duration of a camshaft revolution, s."""
    return drive.period if isinstance(drive, SpeedByAngle) else _REVOLUTION / case.speed


def set_initial_state(case: Case, model: Model, problem: Problem, *, until: float | None = None) -> Problem:
    """Return a problem with the initial state requested by its case."""
    system = problem.system
    match case.record.run.start:
        case "rest" | "equilibrium" | "periodic" if system.is_kinematic:
            return replace(problem, start=replace(State.rest(system.size), periodicity=_periodicity(case)))
        case "rest":
            return replace(problem, start=installed_state(system, problem.drive))
        case "equilibrium":
            return replace(problem, start=_equilibrium_state(problem))
        case "periodic":
            one = replace(problem, start=_equilibrium_state(problem), steps=steps_per_revolution(case, problem))
            start = solve_periodic(one, case.record.run.integrator.part, until=until)
            return replace(problem, start=start)
        case ResultStartRecord(result=name):
            state, angle = _last_state(case, model, system, name)
            taken = round(state.time / problem.step)
            state = replace(state, taken=taken if taken * problem.step == state.time else 0)
            drive, free = problem.drive, case.record.run.free_running
            missing = angle - float(drive.at(np.array([state.time])).angle[0])
            if abs(missing) > _SAME_ANGLE and free is not None:
                drive = _free_running_drive(case, model, free, angle, state.time)
            elif abs(missing) > _SAME_ANGLE:
                drive = camshaft_drive(case, model, missing)
            return replace(problem, drive=drive, start=state)
        case GivenStartRecord(displacement=displacement, velocity=velocity):
            given = {"displacement": displacement, "velocity": velocity}
            faults = [f for kind, values in given.items() for f in _unknown_dof_faults(case, system, values, kind)]
            if faults:
                raise InputError(faults)
            return replace(problem, start=State(_given_state(system, displacement), _given_state(system, velocity)))


def _periodicity(case: Case) -> float | None:
    """Return the deviation of a prescribed motion from a periodic one, if the case asks for it."""
    return 0.0 if case.record.run.start == "periodic" else None


def _equilibrium_state(problem: Problem) -> State:
    return moving_equilibrium(problem.system, problem.drive)


def steps_per_revolution(case: Case, problem: Problem) -> int:
    """Return the number of steps per revolution, the period of a periodic state."""
    for key, given in excitation_without_period(case).items():
        allowed = "an excitation that repeats each revolution with start = periodic"
        raise refuse(key, given, allowed, "the state repeats with the camshaft")
    revolution = revolution_time(case, problem.drive)
    steps = round(revolution / problem.step)
    if abs(steps * problem.step - revolution) > _SAME_ANGLE * revolution:
        given, why = f"a step of {problem.step:g} s", "the periodic state is that after a whole revolution"
        raise refuse("run.step", given, "a whole number of steps per revolution", why, "use steps_per_revolution")
    return steps


def excitation_without_period(case: Case) -> dict[str, str]:
    """Return the excitations that do not repeat with a revolution of the camshaft: what is given, by key."""
    speed = case.record.run.fluctuation
    broken = [order for order in speed.orders if order % 1.0] if speed else []
    found = {"run.fluctuation.orders": f"order {broken[0]:g}"} if broken else {}
    for name, spring in case.record.springs.items():
        if spring.pulsation is not None and spring.pulsation.order % 1.0:
            found[f"springs.{name}.pulsation.order"] = f"order {spring.pulsation.order:g}"
    for name, load in case.record.loads.items():
        if load.table is not None and (load.table.over_time or load.repeat is False):
            found[f"loads.{name}.table"] = "a load over time or without repetition"
    return found


def _unknown_dof_faults(case: Case, system: System, values: Mapping[str, float], kind: str) -> list[Fault]:
    """Return the faults of initial values that are not degrees of freedom; the rigid mechanism has none."""
    wrong = [name for name in values if name not in system.names] if not system.is_kinematic else []
    where, allowed = case.place(("run", "start", kind)), "a free component such as 'cam.uy'"
    return [Fault(where, repr(name), allowed, "", suggest_name(name, system.names)) for name in wrong]


def _given_state(system: System, values: Mapping[str, float]) -> FloatArray:
    row = np.zeros(system.size)
    for name, value in values.items() if not system.is_kinematic else ():
        row[system.names.index(name)] = value
    return row


def _last_state(case: Case, model: Model, system: System, name: str) -> tuple[State, float]:
    """Return the last saved state of a result and its cam angle."""
    where = case.place(("run", "start"))
    result = read_result(resolve_file(case.path, name, where))
    response = result.response
    if not np.array_equal(result.mesh.nodes, model.mesh.nodes) or not len(response.field_time):
        raise refuse(where, name, "a result of the same mesh with at least one saved field")
    time, angle = float(response.field_time[-1]), float(response.field_angle[-1])
    if system.is_kinematic:  # the state of the rigid mechanism is its angle
        return replace(State.rest(system.size), time=time), angle
    free = build_structure(model).dofs.numbers >= 0
    if any(values[-1].reshape(-1, 6)[~free].any() for values in vars(response.fields).values()):
        raise refuse(where, name, "a result of the same supports", "it moves nodes that this model fixes")
    try:
        fields = unknown_fields(response, free, system.names[int(free.sum()) :])
    except InputError as refusal:
        why = f"it does not contain {refusal.faults[0].given}"
        raise refuse(where, name, "a result of the same model", why) from None
    inner, states = response.inner, sum(force.states for force in system.local_forces)
    if len(inner) != states:
        raise refuse(where, name, "a result of the same contacts", f"it has {len(inner)} of {states} internal states")
    moved, moving, pushed = fields.displacement[-1], fields.velocity[-1], fields.acceleration[-1]
    return State(moved, moving, time, inner if states else None, acceleration=pushed), angle
