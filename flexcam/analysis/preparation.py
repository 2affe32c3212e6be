"""Prepare the run of a case: model, problem, integrator, output and default probe."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from flexcam.analysis.resources import check_mesh_memory
from flexcam.case.builder import build_model
from flexcam.case.case import Case, require_case
from flexcam.case.input_checks import check_drives, check_values
from flexcam.case.problem_builder import (
    build_equations,
    integration_method,
    locate_run_faults,
    make_problem,
    reduced_basis,
    revolution_time,
    set_given_state,
    steps_per_revolution,
)
from flexcam.case.reader import CaseFile
from flexcam.case.schema.run import CollocationRecord
from flexcam.core.errors import InputError, end_sentence, refuse
from flexcam.dynamics import (
    Cause,
    Collocation,
    ConstantSpeed,
    Method,
    PrescribedMotion,
    Probe,
    Problem,
    RunFailedError,
    SaveAt,
    State,
    System,
    check_scalar_probe,
    installed_state,
    method_refusal,
    moving_equilibrium,
    outline,
    solve_periodic,
)
from flexcam.fem.dofs import COMPONENTS
from flexcam.valvetrain import Chain, Model, driving_contact, rigid_motion


@dataclass(frozen=True, eq=False)
class PreparedRun:
    """Prepared run for `flexcam.dynamics.solve`."""

    case: Case  #: case
    model: Model  #: model of the case
    problem: Problem  #: system, drive, step and start
    scheme: Method  #: time integration method
    save: SaveAt  #: saved quantities and instants

    def __repr__(self) -> str:
        problem = self.problem
        return f"<Prepared {self.case!r}: {problem.steps} steps of {problem.step:.4g} s, {problem.system!r}>"

    @property
    def revolution(self) -> float:
        """Duration of a camshaft revolution, s."""
        return revolution_time(self.case, self.problem.drive)

    @property
    def explicit_case(self) -> Case:
        """The case with its integrator, even if this is the default."""
        if self.case.record.run.integrator is not None:
            return self.case
        if not isinstance(self.scheme, Collocation):
            return self.case.with_newmark()
        return self.case.with_run({"integrator": CollocationRecord(method="collocation")})


def scalar_probe(ready: PreparedRun, name: str | None = None) -> str:
    """Return a scalar probe by name; by default that of a rocker, else the first that a cam moves, else the first."""
    if name is not None:
        check_scalar_probe(name, outline(ready.problem.system))
        return name
    ordered = _ordered_probes(ready)
    if not ordered:
        remedy = "name a point of the case with --probe, or add probes, such as ['valve']"
        raise refuse("output.probes", "none", "at least one point", "", remedy)
    return contact_probe(ready) or _follower_component(ready, ordered[0])


def contact_probe(ready: PreparedRun, contact: str | None = None) -> str | None:
    """Return the scalar probe of a rocker, else the first, that the cam of a contact moves, or any cam."""
    driven = _driven_probes(ready.model, ready.problem.system.probes, ready.problem.system.prescribed_motion)
    moved = [driven[probe.name] for probe in _ordered_probes(ready) if probe.name in driven]
    return next((probe.component for probe in moved if contact in (None, probe.contact)), None)


def _ordered_probes(ready: PreparedRun) -> list[Probe]:
    """Return the probes of a case, those of rockers first."""
    points = [rocker.point for rocker in ready.model.rockers.values()]
    probes = [probe for probe in ready.problem.system.probes if probe.name in ready.model.probes]
    return sorted(probes, key=lambda probe: probe.name not in points)


@dataclass(frozen=True)
class DrivenProbe:
    """Probe that a cam moves."""

    name: str  #: name of the point
    component: str  #: name of its component of largest motion
    sign: float  #: 1 or -1: the sign of this motion as the cam lifts
    contact: str | None  #: contact of the cam; None if it is not known


def driven_probe(ready: PreparedRun, probe: str | None = None) -> DrivenProbe | None:
    """Return the default probe of a case, or the one with a given name, as far as a cam moves it."""
    driven = _driven_probes(ready.model, ready.problem.system.probes, ready.problem.system.prescribed_motion)
    if probe is not None:
        return driven.get(probe)
    default = scalar_probe(ready)
    return next((candidate for candidate in driven.values() if candidate.component == default), None)


@lru_cache(maxsize=4)
def _driven_probes(
    model: Model, probes: tuple[Probe, ...], prescribed: PrescribedMotion | None
) -> Mapping[str, DrivenProbe]:
    if not model.cam_contacts:
        return {}
    try:
        motion = prescribed or rigid_motion(model)
        rigid = motion.at(ConstantSpeed(1.0).at(_REVOLUTION_ANGLES))[0]
    except InputError:  # no rigid train exists: the first probe is used
        return {}
    driven: dict[str, DrivenProbe] = {}
    for probe in probes:
        paths = probe.rows @ rigid.T
        i = int(np.argmax(np.ptp(paths, axis=1)))
        if np.ptp(paths[i]) > _MOTIONLESS:
            sign = 1.0 if paths[i].max() > -paths[i].min() else -1.0
            contact = driving_contact(model, probe.name)
            driven[probe.name] = DrivenProbe(probe.name, _component_name(probe, i), sign, contact)
    return driven


_MOTIONLESS = 1e-12  # motion of a probe that is rounding, m
# angles of a revolution, rad; a lift between two of them would be too short
_REVOLUTION_ANGLES = np.linspace(0.0, 2.0 * np.pi, 361)


def _follower_component(ready: PreparedRun, probe: Probe) -> str:
    """Return the free component of a probe along the direction of the first follower, or its first free one."""
    model = ready.model
    contact = next(iter(model.cam_contacts.values()), None)
    direction = "" if contact is None else COMPONENTS[int(np.argmax(np.abs(contact.direction)))]
    nodes = model.mesh.points.get(probe.name, ())
    supports = (names for point, names in model.supports.items() if np.isin(nodes, model.mesh.points[point]).any())
    fixed = {name for names in supports for name in names}
    free = [name for name in probe.components if name not in fixed] or list(probe.components)
    return _component_name(probe, probe.components.index(direction if direction in free else free[0]))


def _component_name(probe: Probe, component: int) -> str:
    """Return the name of a component of a probe; a scalar probe keeps its name."""
    return probe.name if len(probe.components) == 1 else f"{probe.name}.{probe.components[component]}"


def prepare(
    case: Case, *, rigid: bool = False, model: Model | None = None, until: float | None = None,
    allow_large: bool = False, runs: int = 1, near: PreparedRun | None = None,
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
    near
        Prepared run of a similar case, whose equal cams are used, and near whose initial state that of this one is
        searched for.

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
    require_case(case)
    kind = "rigid" if rigid else case.record.fidelity.model
    with _all_faults(case):
        model, system, chain = _build_equations(case, model, kind, allow_large=allow_large)
        plain = replace(make_problem(case, model, system), runs=runs)
        if rigid:  # the rigid companion of a flexible run; the engine was requested for the flexible one
            plain = replace(plain, engine="auto")
        try:
            problem = set_initial_state(case, model, plain, until, near and near.problem.start)
        except RunFailedError as failure:  # an unusual value, such as 207 Pa, or a loose shaft is the probable cause
            warnings = [*(check_drives(model) if failure.status.cause is Cause.SINGULAR else ()), *check_values(case)]
            causes = [f"Possible cause: {warning.removeprefix('Warning: ')}" for warning in warnings]
            *earlier, last = failure.status.remedy, *causes
            remedy = " ".join([*map(end_sentence, earlier), last])
            raise RunFailedError(replace(failure.status, remedy=remedy)) from None
        problem = replace(problem, basis=reduced_basis(case, problem, chain))
        scheme = integration_method(case, problem)
        if refusal := method_refusal(problem, scheme):
            raise refusal
    save = SaveAt(field_every=case.record.output.field_every, unknowns=system.size)
    return PreparedRun(case, model, problem, scheme, save)


def set_initial_state(
    case: Case, model: Model, problem: Problem, until: float | None = None, near: State | None = None
) -> Problem:
    """Return a problem with the initial state requested by its case, found near a known one."""
    kind, system = case.record.run.start, problem.system
    if not isinstance(kind, str):
        return set_given_state(case, model, problem)
    if system.is_kinematic:
        start = replace(State.rest(system.size), periodicity=0.0 if kind == "periodic" else None)
    elif kind == "periodic":
        begin, steps = moving_equilibrium(system, problem.drive), steps_per_revolution(case, problem)
        cycle = replace(problem, start=begin, steps=steps)
        start = solve_periodic(cycle, integration_method(case, cycle), until=until)
    else:
        known = near.displacement if near and len(near.displacement) == system.size else None
        start = (installed_state if kind == "rest" else moving_equilibrium)(system, problem.drive, near=known)
    return replace(problem, start=start)


@contextmanager
def _all_faults(case: Case) -> Generator[None]:
    """Add the other faults of a case to an error."""
    try:
        yield
    except InputError as refusal:
        raise CaseFile.of(case).complete_refusal(locate_run_faults(case, refusal), case.overrides) from None


def prepare_without_periodic_search(case: Case, near: PreparedRun | None = None) -> PreparedRun:
    """Prepare a case as `prepare`; a periodic initial state, which is expensive, is replaced by equilibrium."""
    require_case(case)
    if case.record.run.start != "periodic":
        return prepare(case, near=near)
    ready = replace(prepare(case.with_run({"start": "equilibrium"}), near=near), case=case)
    with _all_faults(case):
        steps_per_revolution(case, ready.problem)
    return ready


def build_problem(case: Case) -> tuple[Model, System]:
    """Return the model of a case and its equations without an initial state."""
    with _all_faults(case):
        return _build_equations(case, None, case.record.fidelity.model, allow_large=False)[:2]


def _build_equations(
    case: Case, model: Model | None, kind: str, *, allow_large: bool
) -> tuple[Model, System, Chain | None]:  # fmt: skip
    model = model or build_model(case)
    if not allow_large:
        check_mesh_memory(model.mesh)
    return build_equations(case, model, kind)
