"""Prepare the run of a case: model, equations, camshaft drive, initial state, integrator and output."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flexcam.analysis.prepared_run import MASS_CHAINS, PreparedRun, revolution_time
from flexcam.analysis.resources import check_mesh_memory
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.input_checks import check_values
from flexcam.case.schema.run import FreeRunningRecord, GivenStartRecord, ResultStartRecord
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.dynamics import (
    Basis,
    ConstantSpeed,
    Drive,
    FluctuatingSpeed,
    ModeBasis,
    PhasedSpeed,
    Problem,
    RunFailedError,
    SaveAt,
    SpeedByAngle,
    State,
    System,
    installed_state,
    method_refusal,
    moving_equilibrium,
    solve_periodic,
)
from flexcam.io import read_result, resolve_file
from flexcam.io.result_reader import unknown_fields
from flexcam.valvetrain import (
    Chain,
    Model,
    build_chain,
    build_rigid,
    build_structure,
    build_system,
    free_running,
    modal_basis,
    straighten,
    without_compression,
)

DEFAULT_STEPS_PER_REVOLUTION = 3600
"""Default number of steps per revolution: a tenth of a degree."""


def prepare(
    case: Case, *, rigid: bool = False, model: Model | None = None, until: float | None = None,
    allow_large: bool = False, runs: int = 1,
) -> PreparedRun:  # fmt: skip
    """Build the problem described by a case.

    Parameters
    ----------
    case
        Checked case.
    rigid
        Build the same mechanism with rigid members.
    model
        Model of the case if it is already built, for example for another speed.
    until
        Latest end of the search for a periodic state, s of `time.monotonic`; None for no limit.
    allow_large
        Whether the matrices may exceed the available memory.
    runs
        Number of planned runs of this kind, as in `flexcam.dynamics.Problem`.

    Returns
    -------
    PreparedRun
        Model, problem and scheme.

    Raises
    ------
    InputError
        If parts are inconsistent.
    RunFailedError
        If no static equilibrium exists.

    Examples
    --------
    ``prepare(case).problem.system`` is the `System` of a case, for custom studies.
    """
    kind = "rigid" if rigid else case.record.fidelity.model
    model, system, chain = _build_equations(case, model, kind, allow_large=allow_large)
    save = SaveAt(field_every=case.record.output.field_every)
    scheme = case.record.run.integrator.part
    try:
        plain = replace(_make_problem(case, model, system), runs=runs)
        if rigid:  # the rigid companion of a flexible run; the engine was requested for the flexible one
            plain = replace(plain, engine="auto")
        problem = set_initial_state(case, model, plain, until=until)
    except InputError as refusal:
        raise _add_lines(case, refusal) from None
    except RunFailedError as failure:  # an unusual value, such as 207 Pa, is the probable cause
        unusual = [warning.removeprefix("Warning: ") for warning in check_values(case)]
        raise RunFailedError(replace(failure.status, remedy="; ".join([*unusual, failure.status.remedy]))) from None
    problem = replace(problem, basis=_reduced_basis(case, problem, chain))
    if refusal := method_refusal(problem, scheme):
        raise _add_lines(case, refusal)
    return PreparedRun(case, model, problem, scheme, save)


def prepare_without_periodic_search(case: Case) -> PreparedRun:
    """Prepare a case; a periodic initial state, which is expensive, is replaced by equilibrium."""
    if case.record.run.start != "periodic":
        return prepare(case)
    ready = replace(prepare(case.with_run({"start": "equilibrium"})), case=case)
    try:
        steps_per_revolution(case, ready.problem)
    except InputError as refusal:
        raise _add_lines(case, refusal) from None
    return ready


def build_problem(case: Case) -> tuple[Model, System]:
    """Return the model of a case and its equations without an initial state."""
    return _build_equations(case, None, case.record.fidelity.model, allow_large=False)[:2]


_CHAIN_KEYS = {"count": "fidelity.masses", "contact": "fidelity.model"}
"""Arguments of a chain, and the keys of a case that set them."""


def _build_equations(
    case: Case, model: Model | None, kind: str, *, allow_large: bool
) -> tuple[Model, System, Chain | None]:  # fmt: skip
    """Return model and equations, and the chain of masses if the case uses one."""
    model = model or build_model(case)
    if not allow_large:
        check_mesh_memory(model.mesh)
    model = straighten(model) if kind in MASS_CHAINS else model
    try:
        system = (build_rigid if kind == "rigid" else build_system)(model, case.speed)
        if kind not in MASS_CHAINS or system.is_kinematic:
            return model, system, None
        chain = build_chain(model, case.speed, MASS_CHAINS[kind] or case.record.fidelity.masses)
    except InputError as refusal:
        faults = (replace(fault, where=_CHAIN_KEYS.get(fault.where, fault.where)) for fault in refusal.faults)
        raise _add_lines(case, InputError(faults)) from None
    return model, without_compression(system, chain.unfelt), chain


def _reduced_basis(case: Case, problem: Problem, chain: Chain | None) -> Basis | None:
    """Return the basis of a reduced model; None for the full degrees of freedom."""
    fidelity = case.record.fidelity
    if chain is not None:
        return ModeBasis(chain.shapes, chain.system.names, _residual_start(case, problem, chain.shapes))
    if fidelity.modes is None or problem.system.is_kinematic:
        return None
    return modal_basis(problem, fidelity.modes, by_parts=fidelity.reduction == "craig-bampton")


def _residual_start(case: Case, problem: Problem, shapes: FloatArray) -> FloatArray | None:
    """Return the part of the initial state outside the chain's shapes, decoupled from them, which stays constant.

    Forces that do not act at the masses, such as that of an installed spring, cause deflections outside their shapes.
    Without this part a chain would not start in its equilibrium, and would vibrate permanently.
    """
    if problem.start is None or isinstance(case.record.run.start, GivenStartRecord):
        return None
    begun, stiff = problem.start.displacement, problem.system.stiffness.multiply(shapes)
    return begun - shapes @ np.linalg.lstsq(shapes.T @ stiff, stiff.T @ begun)[0]


def _add_lines(case: Case, refusal: InputError) -> InputError:
    """Return an error with the lines of its keys in the case file added."""
    return InputError(
        fault if " (" in fault.where else replace(fault, where=case.place(tuple(fault.where.split("."))))
        for fault in refusal.faults
    )


def _make_problem(case: Case, model: Model, system: System) -> Problem:
    run, drive = case.record.run, camshaft_drive(case, model)
    per_revolution = run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    revolution = revolution_time(case, drive)
    step = run.step or revolution / per_revolution
    steps = round(run.revolutions * revolution / step)
    if steps < 1:
        given = f"{run.revolutions:g} revolutions with a step of {step:g} s"
        raise refuse("run", given, "at least one step", "", "take more revolutions or a smaller step")
    adaptive, prune = run.adaptive.part if run.adaptive else None, case.record.fidelity.prune
    return Problem(system, drive, step, steps, adaptive=adaptive, prune=prune, engine=run.engine)


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
    if run.phaser is not None:
        for name, load in case.record.loads.items():
            if load.table is not None and not load.table.over_time:
                where, why = case.place(("loads", name, "table")), "the phaser turns the cam against the crankshaft"
                raise refuse(where, "a table over an angle with run.phaser", "a table over time", why)
        times, shifts = zip(*run.phaser, strict=True)
        return PhasedSpeed(case.speed, times, shifts, start)
    return ConstantSpeed(case.speed, start)


def _free_running_drive(
    case: Case, model: Model, free: FreeRunningRecord, angle: float, time: float = 0.0
) -> SpeedByAngle:  # fmt: skip
    return free_running(model, case.speed, free.cam, free.cam_mass, free.follower_mass, angle, time)


def set_initial_state(case: Case, model: Model, problem: Problem, *, until: float | None = None) -> Problem:
    """Return a problem with the initial state requested by its case."""
    system = problem.system
    match case.record.run.start:
        case "rest" | "equilibrium" | "periodic" as kind if system.is_kinematic:
            periodicity = 0.0 if kind == "periodic" else None
            return replace(problem, start=replace(State.rest(system.size), periodicity=periodicity))
        case "rest":
            return replace(problem, start=installed_state(system, problem.drive))
        case "equilibrium":
            return replace(problem, start=moving_equilibrium(system, problem.drive))
        case "periodic":
            start, steps = moving_equilibrium(system, problem.drive), steps_per_revolution(case, problem)
            one = replace(problem, start=start, steps=steps)
            return replace(problem, start=solve_periodic(one, case.record.run.integrator.part, until=until))
        case ResultStartRecord(result=name):
            state, angle = _last_state(case, model, system, name)
            drive, free = problem.drive, case.record.run.free_running
            missing = angle - float(drive.at(np.array([state.time])).angle[0])
            if abs(missing) > _SAME_ANGLE and free is not None:
                drive = _free_running_drive(case, model, free, angle, state.time)
            elif abs(missing) > _SAME_ANGLE:
                drive = camshaft_drive(case, model, missing)
            return replace(problem, drive=drive, start=state)
        case GivenStartRecord(displacement=displacement, velocity=velocity):
            given = {"displacement": displacement, "velocity": velocity}
            return replace(problem, start=_given_state(case, system, given))


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
    if case.record.run.phaser is not None:
        found["run.phaser"] = "a shaft that turns against its drive"
    for name, spring in case.record.springs.items():
        if spring.pulsation is not None and spring.pulsation.order % 1.0:
            found[f"springs.{name}.pulsation.order"] = f"order {spring.pulsation.order:g}"
    for name, load in case.record.loads.items():
        if load.table is not None and (load.table.over_time or load.repeat is False):
            found[f"loads.{name}.table"] = "a load over time or without repetition"
    return found


def _given_state(case: Case, system: System, given: Mapping[str, Mapping[str, float]]) -> State:
    """Return the state of given displacements and velocities; the rigid mechanism has none."""
    rows, faults, allowed = np.zeros((2, system.size)), list[Fault](), "a free component such as 'cam.uy'"
    for row, (kind, values) in zip(rows, given.items() if not system.is_kinematic else (), strict=False):
        for name, value in values.items():
            if name in system.names:
                row[system.names.index(name)] = value
            else:
                where, near = case.place(("run", "start", kind)), suggest_name(name, system.names)
                faults.append(Fault(where, repr(name), allowed, "", near))
    if faults:
        raise InputError(faults)
    return State(rows[0], rows[1])


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
    dofs = build_structure(model).dofs
    free = dofs.numbers >= 0
    if any(values[-1].reshape(-1, 6)[~dofs.moving].any() for values in response.fields):
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
