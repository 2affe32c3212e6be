"""Build the problem of a case: equations, camshaft drive, steps, initial state, basis and integrator."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from flexcam.case.case import Case
from flexcam.case.schema.run import GivenStartRecord, ResultStartRecord
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.dynamics import (
    Basis,
    ConstantSpeed,
    Drive,
    FluctuatingSpeed,
    Method,
    ModeBasis,
    Problem,
    SpeedByAngle,
    State,
    System,
    default_method,
    method_refusal,
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

MASS_CHAINS = {"sdof": 1, "chain": None}
"""Models of few masses, which represent the camshaft only by its compliance; number of masses if it is fixed."""


def revolution_time(case: Case, drive: Drive) -> float:
    """Return the duration of a camshaft revolution, s."""
    return drive.period if isinstance(drive, SpeedByAngle) else 2.0 * math.pi / case.speed


def integration_method(case: Case, problem: Problem) -> Method:
    """Return the integrator of a case, by default the one that suits its problem."""
    integrator = case.record.run.integrator
    return default_method(problem) if integrator is None else integrator.part


# arguments of a chain, and the keys of a case that set them
_CHAIN_KEYS = {"count": "fidelity.masses", "contact": "fidelity.model"}


def build_equations(case: Case, model: Model, kind: str) -> tuple[Model, System, Chain | None]:
    """Return model and equations, and the chain of masses if the case uses one."""
    model = straighten(model) if kind in MASS_CHAINS else model
    system = (build_rigid if kind == "rigid" else build_system)(model, case.speed)
    if kind not in MASS_CHAINS or system.is_kinematic:
        return model, system, None
    try:
        chain = build_chain(model, case.speed, MASS_CHAINS[kind] or case.record.fidelity.masses)
    except InputError as refusal:
        raise InputError(replace(f, where=_CHAIN_KEYS.get(f.where, f.where)) for f in refusal.faults) from None
    return model, without_compression(system, chain.unstrained), chain


def locate_run_faults(case: Case, refusal: InputError) -> InputError:
    """Return an error with the lines of its keys in the case file added, at the key that gives the steps."""
    run, faults = case.record.run, list(refusal.faults)
    if run.step is None:
        count = run.steps_per_revolution or f"{DEFAULT_STEPS_PER_REVOLUTION} by default"
        faults = [
            replace(fault, where="run.steps_per_revolution", given=f"{count}, which is a step of {fault.given}",
                    allowed=f"steps of {fault.allowed}") if fault.where == "run.step" else fault
            for fault in faults
        ]  # fmt: skip
    return InputError(map(case.places.locate, faults))


def make_problem(case: Case, model: Model, system: System) -> Problem:
    """Return the problem of a case, without an initial state."""
    run, drive = case.record.run, camshaft_drive(case, model)
    per_revolution = run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    revolution = revolution_time(case, drive)
    step = run.step or revolution / per_revolution
    steps = round(run.revolutions * revolution / step)
    if steps < 1:
        given = f"revolutions = {run.revolutions:g} with a step of {step:g} s"
        raise refuse("run", given, "at least one step", "", "use more revolutions or a smaller step")
    adaptive, prune = run.adaptive.part if run.adaptive else None, case.record.fidelity.prune
    return Problem(system, drive, step, steps, adaptive=adaptive, prune=prune, engine=run.engine)


def reduced_basis(case: Case, problem: Problem, chain: Chain | None) -> Basis | None:
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
    initial, forces = problem.start.displacement, problem.system.stiffness.multiply(shapes)
    return initial - shapes @ np.linalg.lstsq(shapes.T @ forces, forces.T @ initial)[0]


_SAME_ANGLE = 1e-9  # tolerance for equal cam angles, rad: rounding of speed times time


def camshaft_drive(case: Case, model: Model, start: float = 0.0, time: float = 0.0) -> Drive:
    """Return the drive of the camshaft from its angle at time zero, or at a given time if it runs freely."""
    run = case.record.run
    if run.fluctuation is not None:
        swing = run.fluctuation
        phases = swing.phases or [0.0] * len(swing.orders)
        return FluctuatingSpeed(case.speed, tuple(swing.orders), tuple(swing.amplitudes), tuple(phases), start)
    if run.free_running is not None:
        free = run.free_running
        return free_running(model, case.speed, free.cam, free.cam_mass, free.follower_mass, start, time)
    return ConstantSpeed(case.speed, start)


def set_given_state(case: Case, model: Model, problem: Problem) -> Problem:
    """Return a problem with the initial state of its case, if values or the last state of a result define it."""
    start = case.record.run.start
    if isinstance(start, GivenStartRecord):
        return replace(problem, start=_given_state(case, problem.system, start))
    if not isinstance(start, ResultStartRecord):
        return problem
    state, angle = _last_state(case, model, problem.system, start.result)
    drive, free = problem.drive, case.record.run.free_running is not None
    missing = angle - float(drive.at(np.array([state.time])).angle[0])
    if abs(missing) > _SAME_ANGLE:
        drive = camshaft_drive(case, model, angle if free else missing, state.time)
    return replace(problem, drive=drive, start=state)


def check_run(case: Case, model: Model, system: System, chain: Chain | None, *, method: bool) -> None:
    """Check steps, given or periodic initial state and, if required, the integrator, without a run."""
    problem = make_problem(case, model, system)
    if case.record.run.start == "periodic":
        steps_per_revolution(case, problem)
    set_given_state(case, model, problem)
    problem = replace(problem, basis=reduced_basis(case, problem, chain))
    if method and (refusal := method_refusal(problem, integration_method(case, problem))):
        raise refusal


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
    fractional = [order for order in speed.orders if order % 1.0] if speed else []
    excitations = {"run.fluctuation.orders": f"order {fractional[0]:g}"} if fractional else {}
    excitations |= {f"phasers.{name}": "a shaft that turns against its drive" for name in case.record.phasers}
    for name, spring in case.record.springs.items():
        if spring.pulsation is not None and spring.pulsation.order % 1.0:
            excitations[f"springs.{name}.pulsation.order"] = f"order {spring.pulsation.order:g}"
    for name, load in case.record.loads.items():
        if load.table is not None and (load.table.over_time or load.repeat is False):
            excitations[f"loads.{name}.table"] = "a load over time or without repetition"
    return excitations


def _given_state(case: Case, system: System, start: GivenStartRecord) -> State:
    """Return the state of given displacements and velocities; the rigid mechanism has none."""
    rows, faults, allowed = np.zeros((2, system.size)), list[Fault](), "a free component such as 'cam.uy'"
    for row, (kind, values) in zip(rows, start if not system.is_kinematic else (), strict=False):
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
    try:
        result = read_result(resolve_file(case.path, name, where))
    except InputError as refusal:
        file = case.place(("run", "start", "result"))
        raise InputError(replace(fault, where=file) for fault in refusal.faults) from None
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
    u, v, a = fields.displacement[-1], fields.velocity[-1], fields.acceleration[-1]
    return State(u, v, time, inner if states else None, acceleration=a), angle
