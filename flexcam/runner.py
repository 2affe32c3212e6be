"""The one easy door: case, model, system, solve, response.

May import `case` and everything below it. What `flexcam.run` does can be done by hand with the parts it names.
The file is not called ``run.py``: a submodule of that name would hide the function ``flexcam.run``.
"""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.case import Case, build_model
from flexcam.case.tables.run import GivenStartRecord, ResultStartRecord
from flexcam.checks import InputError, did_you_mean, refuse
from flexcam.integrate import (
    Method,
    Problem,
    State,
    carried_equilibrium,
    outline,
    periodic,
    rest,
    solve,
)
from flexcam.io import Geometry, ResultFile, made_folder, read_result
from flexcam.linalg import FloatArray
from flexcam.modal import mac
from flexcam.response import Response, SaveAt, Sink
from flexcam.system import ConstantSpeed, Drive, FluctuatingSpeed, SpeedByAngle, System
from flexcam.train import (
    Model,
    ModelModes,
    build_rigid,
    build_structure,
    build_system,
    element_loads,
    free_running,
    model_modes,
)

DEFAULT_STEPS_PER_REVOLUTION = 3600

_REVOLUTION = 2.0 * math.pi


@dataclass(frozen=True, eq=False)
class Prepared:
    """Everything a run needs, ready for `flexcam.integrate.solve`.

    Parameters
    ----------
    case
        The case.
    model
        Its model.
    problem
        System, drive, step and start.
    scheme
        Of the time integration.
    save
        What is kept.
    """

    case: Case
    model: Model
    problem: Problem
    scheme: Method
    save: SaveAt

    @property
    def revolution(self) -> float:
        """Time of a camshaft revolution, s."""
        drive = self.problem.drive
        return drive.period if isinstance(drive, SpeedByAngle) else _REVOLUTION / self.case.speed


def prepare(case: Case, *, rigid: bool = False) -> Prepared:
    """Build what a case describes, up to the point where time begins.

    Parameters
    ----------
    case
        A checked case.
    rigid
        The same mechanism with rigid members.

    Returns
    -------
    Prepared
        Model, problem and scheme.

    Raises
    ------
    InputError
        If parts do not fit together.
    RunFailedError
        If the start has no balance.

    Examples
    --------
    ``prepare(case).problem.system`` is the `System` of a case, for one's own studies.
    """
    model = build_model(case)
    make = build_rigid if rigid else build_system
    try:
        system = make(model, case.speed)
    except InputError as refusal:
        raise InputError(replace(f, where=case.place(tuple(f.where.split(".")))) for f in refusal.faults) from None
    save = SaveAt(field_every=case.record.output.field_every)
    return Prepared(case, model, _problem(case, model, system), case.record.run.integrator.made(), save)


def _problem(case: Case, model: Model, system: System) -> Problem:
    run, drive = case.record.run, _drive(case, model)
    per_revolution = run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    revolution = drive.period if isinstance(drive, SpeedByAngle) else _REVOLUTION / case.speed
    step = run.step or revolution / per_revolution
    steps = round(run.revolutions * revolution / step)
    if steps < 1:
        given = f"{run.revolutions:g} revolutions with a step of {step:g} s"
        raise refuse("run", given, "at least one step", "", "more revolutions or a smaller step")
    if run.start == "periodic":
        return _periodic(case, Problem(system, drive, step, steps, _guess(system, drive)), revolution)
    state, angle = _start(case, model, system, drive)
    if angle is not None:  # a restart goes on at the result's cam angle, also at another speed
        drive = _from_angle(case, model, drive, angle, state.time)
    return Problem(system, drive, step, steps, state)


def _drive(case: Case, model: Model, start: float = 0.0) -> Drive:
    """Return how the camshaft turns, the cam angle at time zero given."""
    run = case.record.run
    if run.fluctuation is not None:
        return FluctuatingSpeed(case.speed, *run.fluctuation.made(), start)
    if run.free_running is not None:
        return free_running(model, case.speed, *run.free_running.made(), start)
    return ConstantSpeed(case.speed, start)


def _from_angle(case: Case, model: Model, drive: Drive, angle: float, time: float) -> Drive:
    """Return the drive that passes a cam angle at a time."""
    missing = angle - float(drive.at(np.array([time])).angle[0])
    if abs(missing) <= _SAME_ANGLE:
        return drive
    free = case.record.run.free_running
    if free is not None:
        return free_running(model, case.speed, *free.made(), angle, time)
    return _drive(case, model, missing)


def _guess(system: System, drive: Drive) -> State:
    return carried_equilibrium(system, drive) if system.size else State.rest(0)


def _periodic(case: Case, problem: Problem, revolution: float) -> Problem:
    """Return the problem from its periodic state."""
    if not problem.system.size:
        return replace(problem, start=replace(State.rest(0), periodicity=0.0))
    per_revolution = round(revolution / problem.step)
    if abs(per_revolution * problem.step - revolution) > _SAME_ANGLE * revolution:
        given, why = f"a step of {problem.step:g} s", "the periodic state is that after a whole revolution"
        raise refuse("run.step", given, "a whole number of steps per revolution", why, "use steps_per_revolution")
    one = replace(problem, steps=per_revolution)
    return replace(problem, start=periodic(one, case.record.run.integrator.made()))


_SAME_ANGLE = 1e-9
"""Difference of cam angle, rad, that is the rounding of speed times time."""


def _start(case: Case, model: Model, system: System, drive: Drive) -> tuple[State, float | None]:
    """Return the start and, for a restart, the cam angle it belongs to."""
    match case.record.run.start:
        case "rest":
            return rest(system, drive), None
        case "equilibrium" | "periodic":
            return _guess(system, drive), None
        case ResultStartRecord(result=name):
            return _last_state(case, model, system, name)
        case GivenStartRecord(displacement=displacement, velocity=velocity):
            moved, moving = (
                _given(case, system, *one) for one in ((displacement, "displacement"), (velocity, "velocity"))
            )
            return State(moved, moving), None


def _given(case: Case, system: System, values: Mapping[str, float], kind: str) -> FloatArray:
    row = np.zeros(system.size)
    for name, value in values.items() if system.size else ():  # the rigid mechanism has no component to place
        if name not in system.names:
            where = case.place(("run", "start", kind))
            raise refuse(where, repr(name), "a free component such as 'cam.uy'", "", did_you_mean(name, system.names))
        row[system.names.index(name)] = value
    return row


def _last_state(case: Case, model: Model, system: System, name: str) -> tuple[State, float]:
    """Return the last saved state of a result and its cam angle."""
    where = case.place(("run", "start"))
    result = read_result(case.path.parent / name)
    response = result.response
    if not np.array_equal(result.mesh.nodes, model.mesh.nodes) or not len(response.field_time):
        raise refuse(where, name, "a result of the same mesh with at least one saved field")
    time, angle = float(response.field_time[-1]), float(response.field_angle[-1])
    if not system.size:  # the rigid mechanism has no state but its angle
        return State(np.zeros(0), np.zeros(0), time), angle
    numbers = build_structure(model).dofs.numbers
    free = numbers >= 0
    nodal = [series[-1].reshape(-1, 6) for series in (response.fields.displacement, response.fields.velocity)]
    if any(values[~free].any() for values in nodal):
        raise refuse(where, name, "a result of the same supports", "it moves where this model is held")
    inner = system.names[int(free.sum()) :]
    try:
        histories = [response[one] for one in inner]
    except InputError as refusal:
        why = f"it does not hold {refusal.faults[0].given}"
        raise refuse(where, name, "a result of the same model", why) from None
    at = int(np.searchsorted(response.time, time - 1e-12 * max(abs(time), 1.0)))
    rest_of = [[float(getattr(one, name)[at]) for one in histories] for name in ("displacement", "velocity")]
    moved, moving = (np.concatenate([one[free], more]) for one, more in zip(nodal, rest_of, strict=True))
    inner = response.inner
    states = sum(len(force.law.start_state) for force in system.local_forces)
    if len(inner) != states:
        raise refuse(where, name, "a result of the same contacts", f"it holds {len(inner)} of {states} internal states")
    return State(moved, moving, time, inner if states else None), angle


def run(case: Case, *, rigid: bool = False, sinks: Sequence[Sink] = ()) -> Response:
    """Solve a case in time.

    Parameters
    ----------
    case
        From `flexcam.read_case`.
    rigid
        Solve the same mechanism with rigid members.
    sinks
        Further takers of the results, such as a result file.

    Returns
    -------
    Response
        Histories of the probes, fields, status.

    Raises
    ------
    InputError
        If parts do not fit together.
    RunFailedError
        If the run cannot even start.

    Examples
    --------
    ``flexcam.run(flexcam.read_case("cases/tayeb/model-3-shm.toml"))["valve"].displacement`` is the lift of the valve.
    """
    ready = prepare(case, rigid=rigid)
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks)


def modes(
    case: Case, count: int | None = None, *, prestress: Literal["rest", "equilibrium"] | None = None
) -> ModelModes:
    """Compute the natural modes of a case's structure.

    Parameters
    ----------
    case
        From `flexcam.read_case`.
    count
        How many; None for all that can be computed.
    prestress
        The static state whose axial forces are counted in: as installed, or in equilibrium under all loads; None for
        the unloaded structure.

    Returns
    -------
    ModelModes
        Frequencies, shapes, effective masses and what moves, in words.

    Raises
    ------
    InputError
        If parts do not fit together.
    RunFailedError
        If a free motion has no mass, or the prestress is beyond buckling.

    Examples
    --------
    ``flexcam.modes(case).words(1)`` says what moves in the second mode.
    """
    if prestress is None:
        return model_modes(build_structure(build_model(case)), count)
    run = case.record.run.model_copy(update={"start": prestress})
    ready = prepare(replace(case, record=case.record.model_copy(update={"run": run})))
    state = ready.problem.start or State.rest(ready.problem.system.size)
    return model_modes(build_structure(ready.model), count, loaded=state.displacement)


def mode_likeness(case: Case, found: ModelModes, other: Case, others: ModelModes) -> FloatArray:
    """Compare the modes of two cases by the modal assurance criterion.

    Parameters
    ----------
    case, found
        A case and its modes.
    other, others
        Another case and its modes; translations are compared at the nodes that lie at the same places in both.

    Returns
    -------
    ndarray
        Shape (modes of `case`, modes of `other`), 0 to 1.

    Raises
    ------
    InputError
        If no node of the one lies where a node of the other lies.
    """
    shapes: list[dict[tuple[float, ...], FloatArray]] = []
    for one, its in ((case, found), (other, others)):
        structure = build_structure(build_model(one))
        nodal = structure.dofs.nodal(its.modes.shapes.T)
        places = np.round(structure.model.mesh.nodes, 9).tolist()
        shapes.append({tuple(place): nodal[:, i, :3] for i, place in enumerate(places)})
    common = [place for place in shapes[0] if place in shapes[1]]
    if not common:
        raise refuse("--mac", str(other.path), "a model with nodes at the same places", "shapes are compared there")
    columns = [np.concatenate([one[place] for place in common], axis=1).T for one in shapes]
    return mac(columns[0], columns[1])


def geometry_of(model: Model) -> Geometry:
    """Return what the results of a model are drawn on.

    Parameters
    ----------
    model
        The model.

    Returns
    -------
    Geometry
        For the result files.
    """
    structure = build_structure(model)
    sections = {name: member.section for name, member in model.members.items()}
    return Geometry(model.mesh, structure.dofs, structure.beams, sections, element_loads(structure))


def result_file(ready: Prepared, folder: str | Path, *, overwrite: bool = False) -> ResultFile:
    """Open the result file of a run, to be given to `solve` as a sink.

    Parameters
    ----------
    ready
        From `prepare`.
    folder
        Where it goes, made if it does not exist; the file is named after the case.
    overwrite
        Whether an existing result may be replaced once the new one is complete.

    Returns
    -------
    ResultFile
        The sink; its `path` is the file.

    Raises
    ------
    InputError
        If the result exists and may not be replaced, or the folder cannot be made.
    """
    path, about = made_folder(Path(folder)) / f"{ready.case.name}.vtkhdf", _about(ready.case)
    names = outline(ready.problem.system)
    return ResultFile(path, geometry_of(ready.model), names, save=ready.save, about=about, overwrite=overwrite)


def _about(case: Case) -> dict[str, str]:
    """Return what must be known of a result later: the case, as written and as resolved, and what computed it."""
    return {
        "title": case.record.title,
        "case_file": str(case.path),
        "case": case.text,
        "overrides": json.dumps(case.overrides),
        "resolved": case.record.model_dump_json(by_alias=True),
        "flexcam": version("flexcam"),
        "python": platform.python_version(),
        **{package: version(package) for package in ("numpy", "scipy", "h5py", "meshio")},
        "platform": platform.platform(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }
