"""Prepare the run of a case: model, problem, integrator, output and default probe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.initial_state import camshaft_drive, revolution_time, set_initial_state, steps_per_revolution
from flexcam.analysis.resources import check_mesh_memory
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.input_checks import check_values
from flexcam.case.schema.run import GivenStartRecord
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import (
    Basis,
    Method,
    ModeBasis,
    Probe,
    Problem,
    Response,
    RunFailedError,
    SaveAt,
    System,
    method_refusal,
)
from flexcam.fem.frames import COMPONENTS
from flexcam.valvetrain import (
    ANY_SPEED,
    Chain,
    Metric,
    Model,
    build_chain,
    build_rigid,
    build_system,
    driving_contact,
    main_lift,
    modal_basis,
    straighten,
    train_metrics,
    without_compression,
)

DEFAULT_STEPS_PER_REVOLUTION = 3600
"""Default number of steps per revolution: a tenth of a degree."""


@dataclass(frozen=True, eq=False)
class PreparedRun:
    """Prepared run for `flexcam.dynamics.solve`."""

    case: Case  #: case
    model: Model  #: model of the case
    problem: Problem  #: system, drive, step and start
    scheme: Method  #: time integration method
    save: SaveAt  #: saved quantities and instants

    def __repr__(self) -> str:
        """Return a description without numbers."""
        problem = self.problem
        return f"<Prepared {self.case!r}: {problem.steps} steps of {problem.step:.4g} s, {problem.system!r}>"

    @property
    def revolution(self) -> float:
        """Duration of a camshaft revolution, s."""
        return revolution_time(self.case, self.problem.drive)


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


_CHAINS = {"sdof": 1, "chain": None}
"""Models of few masses, which represent the camshaft only by its compliance; number of masses if it is fixed."""

_CHAIN_KEYS = {"count": "fidelity.masses", "contact": "fidelity.model"}
"""Arguments of a chain, and the keys of a case that set them."""


def _build_equations(
    case: Case, model: Model | None, kind: str, *, allow_large: bool
) -> tuple[Model, System, Chain | None]:  # fmt: skip
    """Return model and equations, and the chain of masses if the case uses one."""
    model = model or build_model(case)
    if not allow_large:
        check_mesh_memory(model.mesh)
    model = straighten(model) if kind in _CHAINS else model
    try:
        system = (build_rigid if kind == "rigid" else build_system)(model, case.speed)
        if kind not in _CHAINS or not system.size:
            return model, system, None
        chain = build_chain(model, case.speed, _CHAINS[kind] or case.record.fidelity.masses)
    except InputError as refusal:
        faults = (replace(fault, where=_CHAIN_KEYS.get(fault.where, fault.where)) for fault in refusal.faults)
        raise _add_lines(case, InputError(faults)) from None
    return model, without_compression(system, chain.unfelt), chain


def _reduced_basis(case: Case, problem: Problem, chain: Chain | None) -> Basis | None:
    """Return the basis of a reduced model; None for the full degrees of freedom."""
    fidelity = case.record.fidelity
    if chain is not None:
        return ModeBasis(chain.shapes, chain.system.names, _residual_start(case, problem, chain.shapes))
    if fidelity.modes is None or not problem.system.size:
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


def scalar_probe(ready: PreparedRun) -> str:
    """Return the default probe of a case: the point of a rocker, else the first moved by a cam, else the first."""
    points = [rocker.point for rocker in ready.model.rockers.values()]
    probes = [probe for probe in ready.problem.system.probes if probe.name in ready.model.probes]
    if not probes:
        raise refuse("output.probes", "none", "at least one point to compare at", "", 'add probes = ["valve"]')
    ordered = sorted(probes, key=lambda probe: probe.name not in points)
    moved = _driven_probes(ready)
    found = next((moved[probe.name] for probe in ordered if probe.name in moved), None)
    return _follower_component(ready, ordered[0]) if found is None else found.component


@dataclass(frozen=True)
class DrivenProbe:
    """Probe that a cam moves."""

    name: str  #: name of the point
    component: str  #: name of its component of largest motion
    sign: float  #: 1 or -1: the sign of this motion as the cam lifts
    contact: str | None  #: contact of the cam; None if it is not known


def driven_probe(ready: PreparedRun, probe: str | None = None) -> DrivenProbe | None:
    """Return the default probe of a case, or the one with a given name, as far as a cam moves it."""
    moved = _driven_probes(ready)
    if probe is not None:
        return moved.get(probe)
    default = scalar_probe(ready)
    return next((one for one in moved.values() if one.component == default), None)


def _driven_probes(ready: PreparedRun) -> dict[str, DrivenProbe]:
    """Return the probes moved by the rigid train."""
    if not ready.model.cam_contacts:
        return {}
    try:
        rigid = build_rigid(ready.model, ANY_SPEED)
    except InputError:  # no rigid train exists: the first probe is used
        return {}
    found: dict[str, DrivenProbe] = {}
    for probe in rigid.probes:
        paths = [np.zeros(1) if one is None else one(_REVOLUTION_ANGLES, 0) for one in probe.offset]
        i = int(np.argmax([np.ptp(path) for path in paths]))
        if np.ptp(paths[i]) > 0.0:
            sign = 1.0 if paths[i].max() > -paths[i].min() else -1.0
            contact = driving_contact(ready.model, probe.name)
            found[probe.name] = DrivenProbe(probe.name, _component_name(probe, i), sign, contact)
    return found


_REVOLUTION_ANGLES = np.linspace(0.0, 2.0 * np.pi, 361)
"""Angles of a revolution, rad; a lift between two of them would be too short."""


def _follower_component(ready: PreparedRun, probe: Probe) -> str:
    """Return the free component of a probe along the direction of the first follower, or its first free one."""
    model = ready.model
    contact = next(iter(model.cam_contacts.values()), None)
    along = "" if contact is None else COMPONENTS[int(np.argmax(np.abs(contact.direction)))]
    nodes = model.mesh.points.get(probe.name, ())
    held = {
        one for point, ones in model.supports.items() if np.isin(nodes, model.mesh.points[point]).any() for one in ones
    }
    free = [one for one in probe.components if one not in held] or list(probe.components)
    return _component_name(probe, probe.components.index(along if along in free else free[0]))


def _component_name(probe: Probe, component: int) -> str:
    """Return the name of a component of a probe; a scalar probe keeps its name."""
    return probe.name if len(probe.components) == 1 else f"{probe.name}.{probe.components[component]}"


@dataclass(frozen=True)
class RevolutionChange:
    """Difference of the last revolution of a run from the one before."""

    motion: float  #: maximum difference of the default probe, relative to its range
    #: root mean square of the difference of a contact force on the main lift of its cam, relative to the force's
    force: float
    contact: str = ""  #: contact of this force; empty without a cam


def revolution_change(ready: PreparedRun, response: Response) -> RevolutionChange | None:
    """Return the deviation of the last revolution of a run from periodic; None without two revolutions."""
    time, period = response.time, ready.revolution
    if not len(time) or time[-1] - time[0] < (2.0 - _ROUNDING) * period - ready.problem.step:
        return None
    last = response.latest(period)

    def difference(values: FloatArray) -> FloatArray:
        return values[last] - np.interp(time[last] - period, time, values)

    moved = response[scalar_probe(ready)].displacement if ready.model.probes else np.zeros(len(time))
    changes = dict[str, float]()
    for name, contact in ready.model.cam_contacts.items():
        if (force := response.channels.get(f"contacts.{name}.force")) is not None:
            lift = ready.model.cams[contact.cam].event(response.angle[last])
            lifted = lift > main_lift(ready.model, contact.cam)
            changes[name] = _ratio(np.linalg.norm(difference(force)[lifted]), np.linalg.norm(force[last][lifted]))
    contact = max(changes, key=lambda name: changes[name], default="")
    motion = _ratio(np.abs(difference(moved)).max(), np.ptp(moved[last]))
    return RevolutionChange(motion, changes.get(contact, 0.0), contact)


def _ratio(part: float | np.floating, whole: float | np.floating) -> float:
    if part <= _ROUNDING * whole:
        return 0.0
    return float(part / whole) if whole > 0.0 else 1.0


_ROUNDING = 1e-9  # relative size of rounding errors


def compute_metrics(ready: PreparedRun, response: Response, names: Sequence[str] | None = None) -> list[Metric]:
    """Return the metrics of the last revolution of a run, without those that its model cannot compute.

    With names, costly metrics that are not among them are left out.
    """
    found = train_metrics(ready.model, response, ready.revolution, names)
    if ready.case.record.fidelity.model not in _CHAINS:
        return found

    def changes(metric: Metric) -> bool:
        values = response.channels[metric.name.rpartition(".")[0].replace(".power", ".torque")]
        return bool(np.ptp(values) > _ROUNDING * np.abs(values).max())

    return [one for one in found if not one.name.startswith(("cams.", "supports.")) or changes(one)]
