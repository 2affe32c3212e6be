"""The one easy door: case, model, system, solve, response.

May import `case` and everything below it. What `flexcam.run` does can be done by hand with the parts it names.
The file is not called ``run.py``: a submodule of that name would hide the function ``flexcam.run``.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.budget import Budget, affordable, affordable_mesh, budget
from flexcam.case import Case, build_model, unusual
from flexcam.checkpoint import Earlier
from flexcam.checks import Fault, InputError, refuse
from flexcam.fem import COMPONENTS
from flexcam.integrate import (
    Method,
    Problem,
    State,
    fingerprint,
    outline,
    refused,
    solve,
)
from flexcam.io import Geometry, ResultFile, Unfinished, made_folder, partial_of
from flexcam.linalg import FloatArray
from flexcam.memory import Recent
from flexcam.modal import mac
from flexcam.response import Response, SaveAt, Sink, Stats
from flexcam.starting import drive_of, revolution_of, started, steps_per_revolution
from flexcam.system import Basis, Probe, Shapes, System
from flexcam.train import (
    Model,
    ModelModes,
    build_rigid,
    build_structure,
    build_system,
    chain_of,
    element_loads,
    modal_basis,
    model_modes,
    straight,
)

DEFAULT_STEPS_PER_REVOLUTION = 3600


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
        return revolution_of(self.case, self.problem.drive)


def prepare(
    case: Case, *, rigid: bool = False, model: Model | None = None, until: float | None = None,
    allow_large: bool = False,
) -> Prepared:  # fmt: skip
    """Build what a case describes, up to the point where time begins.

    Parameters
    ----------
    case
        A checked case.
    rigid
        The same mechanism with rigid members.
    model
        That of the case, where it is built already, such as for another speed.
    until
        When the search for a periodic start ends at the latest, s of `time.monotonic`; None for no limit.
    allow_large
        Whether the matrices may take more memory than there seems to be.

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
    model, system = described(case, rigid=rigid, model=model, allow_large=allow_large)
    save = SaveAt(field_every=case.record.output.field_every)
    scheme = case.record.run.integrator.made()
    try:
        problem = started(case, model, _problem(case, model, system), until=until)
    except InputError as refusal:
        raise _placed(case, refusal) from None
    problem = replace(problem, basis=_basis(case, model, problem, _kind(case, rigid=rigid)))
    if refusal := refused(problem, scheme):
        raise _placed(case, refusal)
    return Prepared(case, model, problem, scheme, save)


def standing(case: Case) -> Prepared:
    """Build what a case describes; from equilibrium where it asks for a periodic state, which takes time to find.

    Parameters
    ----------
    case
        A checked case.

    Returns
    -------
    Prepared
        As from `prepare`, of the case as it is.

    Raises
    ------
    InputError
        If parts do not fit together, or no periodic state fits the steps.
    RunFailedError
        If the start has no balance.
    """
    if case.record.run.start != "periodic":
        return prepare(case)
    ready = replace(prepare(case.with_run({"start": "equilibrium"})), case=case)
    try:
        steps_per_revolution(case, ready.problem)
    except InputError as refusal:
        raise _placed(case, refusal) from None
    return ready


def described(
    case: Case, *, rigid: bool = False, model: Model | None = None, allow_large: bool = False
) -> tuple[Model, System]:  # fmt: skip
    """Return the model of a case and its equations, before any start is looked for.

    Parameters
    ----------
    case, rigid, model, allow_large
        As for `prepare`.

    Returns
    -------
    tuple
        Model and system.

    Raises
    ------
    InputError
        If parts do not fit together.

    Examples
    --------
    ``described(case)[1].names`` are the unknowns of a case.
    """
    kind = _kind(case, rigid=rigid)
    model = model or build_model(case)
    if not allow_large:
        affordable_mesh(model.mesh)
    model = straight(model) if kind in _CHAINS else model
    make = build_rigid if kind == "rigid" else build_system
    try:
        return model, make(model, case.speed)
    except InputError as refusal:
        raise _placed(case, refusal) from None


def _kind(case: Case, *, rigid: bool) -> str:
    """Return which model of a case is meant."""
    return "rigid" if rigid else case.record.fidelity.model


_CHAINS = {"sdof": 1, "chain": None}
"""Models of few masses, and how many where that is no choice."""

_KEYS = {"count": "fidelity.masses", "contact": "fidelity.model"}
"""What is asked of a chain, and the keys of a case that ask it."""


def _basis(case: Case, model: Model, problem: Problem, kind: str) -> Basis | None:
    """Return what a case is integrated in; None for its own unknowns."""
    fidelity = case.record.fidelity
    if not problem.system.size:
        return None
    if kind in _CHAINS:
        try:
            found = chain_of(model, case.speed, _CHAINS[kind] or fidelity.masses)
        except InputError as refusal:
            named = InputError(replace(one, where=_KEYS.get(one.where, one.where)) for one in refusal.faults)
            raise _placed(case, named) from None
        return Shapes(found.shapes, found.system.names)
    by_parts = fidelity.reduction == "craig-bampton"
    return None if fidelity.modes is None else modal_basis(problem, fidelity.modes, by_parts=by_parts)


def _placed(case: Case, refusal: InputError) -> InputError:
    """Return a refusal with its keys' lines in the case file, where they are not told yet."""
    told = (fault if " (" in fault.where else replace(fault, where=case.place(tuple(fault.where.split("."))))
            for fault in refusal.faults)  # fmt: skip
    return InputError(told)


def _problem(case: Case, model: Model, system: System) -> Problem:
    run, drive = case.record.run, drive_of(case, model)
    per_revolution = run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    revolution = revolution_of(case, drive)
    step = run.step or revolution / per_revolution
    steps = round(run.revolutions * revolution / step)
    if steps < 1:
        given = f"{run.revolutions:g} revolutions with a step of {step:g} s"
        raise refuse("run", given, "at least one step", "", "more revolutions or a smaller step")
    adaptive = run.adaptive.made() if run.adaptive else None
    prune = case.record.fidelity.prune
    return Problem(system, drive, step, steps, adaptive=adaptive, prune=prune, path=run.path)


def scalar_probe(ready: Prepared) -> str:
    """Return the probe that stands for a case: a rocker's point, else the first that a cam moves, else the first.

    Parameters
    ----------
    ready
        A case made ready to run.

    Returns
    -------
    str
        Such as ``"valve"``; of a probe with several components that which the cam moves most: ``"tappet.uy"``.

    Raises
    ------
    InputError
        If the case has no probe.

    Examples
    --------
    ``scalar_probe(prepare(case))`` is where `flexcam compare` looks, unless it is told another place.
    """
    points = [rocker.point for rocker in ready.model.rockers.values()]
    probes = [probe for probe in ready.problem.system.probes if probe.name in ready.model.probes]
    if not probes:
        raise refuse("output.probes", "none", "at least one point to compare at", "", 'add probes = ["valve"]')
    ordered = sorted(probes, key=lambda probe: probe.name not in points)
    moved = _moved_by_cams(ready)
    return next((moved[probe.name] for probe in ordered if probe.name in moved), _along_follower(ready, ordered[0]))


def _moved_by_cams(ready: Prepared) -> dict[str, str]:
    """Return the probes that the rigid train moves, each with the component that it moves most."""
    if not ready.model.driven:
        return {}
    try:
        rigid = build_rigid(ready.model, ready.case.speed)
    except InputError:  # no rigid train can be made of it: then the first probe will do
        return {}
    strokes = {probe: [0.0 if one is None else float(np.ptp(one(_ROUND, 0))) for one in probe.offset]
               for probe in rigid.probes}  # fmt: skip
    return {probe.name: _named(probe, int(np.argmax(path))) for probe, path in strokes.items() if max(path) > 0.0}


_ROUND = np.linspace(0.0, 2.0 * np.pi, 361)
"""Angles of a revolution; a lift between two of them would be none."""


def _along_follower(ready: Prepared, probe: Probe) -> str:
    """Return the component of a probe along the first follower's direction, or its first one."""
    contact = next(iter(ready.model.driven.values()), None)
    along = "" if contact is None else COMPONENTS[int(np.argmax(np.abs(contact.direction)))]
    return _named(probe, probe.components.index(along) if along in probe.components else 0)


def _named(probe: Probe, component: int) -> str:
    """Return what a component of a probe is called; a probe of one has its own name."""
    return probe.name if len(probe.components) == 1 else f"{probe.name}.{probe.components[component]}"


def recent(ready: Prepared) -> Recent:
    """Return what keeps no more of a run in memory than its summary needs.

    Parameters
    ----------
    ready
        From `prepare`.

    Returns
    -------
    Recent
        For `flexcam.solve`: the histories of the last revolution and the last field.

    Examples
    --------
    ``flexcam.solve(ready.problem, ready.scheme, sinks=[file], memory=recent(ready))`` takes as much memory for a
    thousand revolutions as for two.
    """
    return Recent(outline(ready.problem.system, channels=ready.save.channels), ready.revolution)


def budget_of(ready: Prepared, keep: Literal["all", "revolution"] = "all") -> Budget:
    """Return what a run takes of memory and disk.

    Parameters
    ----------
    ready
        From `prepare`.
    keep
        As in `run`.

    Returns
    -------
    Budget
        Estimated, in bytes.
    """
    kept = None if keep == "all" else round(ready.revolution / ready.problem.step)
    return budget(ready.problem, ready.model.mesh, ready.save, kept=kept)


def run(
    case: Case, *, rigid: bool = False, sinks: Sequence[Sink] = (), keep: Literal["all", "revolution"] = "all",
    allow_large: bool = False, resume: Earlier | None = None,
) -> Response:  # fmt: skip
    """Solve a case in time.

    Parameters
    ----------
    case
        From `flexcam.read_case`.
    rigid
        Solve the same mechanism with rigid members.
    sinks
        Further takers of the results, such as a result file.
    keep
        What the response holds: all of the run, or its last revolution and last field, with which memory does not
        grow with the length of the run.
    allow_large
        Whether a run may take more memory than there seems to be.
    resume
        What a run of this case finished before it broke off, from `unfinished`; it goes on from there.

    Returns
    -------
    Response
        Histories of the probes, fields, status.

    Raises
    ------
    InputError
        If parts do not fit together, or memory is too short.
    RunFailedError
        If the run cannot even start.

    Examples
    --------
    ``flexcam.run(flexcam.read_case("cases/tayeb/model-3-shm.toml"))["valve"].displacement`` is the lift of the valve.
    """
    if keep not in _KEPT:
        raise refuse("keep", repr(keep), " or ".join(map(repr, _KEPT)))
    ready = prepare(case, rigid=rigid, allow_large=allow_large)
    if not allow_large:
        affordable(budget_of(ready, keep))
    memory = recent(ready) if keep == "revolution" else None
    return solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks, memory=memory, resume=resume)


_KEPT = ("all", "revolution")


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
    ready = prepare(case.with_run({"start": prestress}))
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


def result_file(
    ready: Prepared, folder: str | Path, *, overwrite: bool = False, resume: Unfinished | None = None,
    warnings: Callable[[Stats], Sequence[str]] | None = None,
) -> ResultFile:  # fmt: skip
    """Open the result file of a run, to be given to `solve` as a sink.

    Parameters
    ----------
    ready
        From `prepare`.
    folder
        Where it goes, made if it does not exist; the file is named after the case.
    overwrite
        Whether an existing result may be replaced once the new one is complete.
    resume
        What an earlier run finished, from `unfinished`, to be given to `solve` as well.
    warnings
        Asked at the end for what is doubtful about the run, to be kept with its status; None for nothing.

    Returns
    -------
    ResultFile
        The sink; its `path` is the file.

    Raises
    ------
    InputError
        If the result exists and may not be replaced, another process is writing it, or the folder cannot be made.
    """
    path = made_folder(Path(folder)) / f"{ready.case.name}.vtkhdf"
    about = _about(ready.case) if resume is None else resume.about
    return ResultFile(
        path, geometry_of(ready.model), outline(ready.problem.system), save=ready.save, about=about,
        overwrite=overwrite, resume=resume is not None, warnings=warnings,
    )  # fmt: skip


def unfinished(ready: Prepared, folder: str | Path) -> Unfinished:
    """Open what a run of a case finished before it was stopped, cut off or killed.

    Parameters
    ----------
    ready
        From `prepare`; the case must be the one the run was made of.
    folder
        Of the results.

    Returns
    -------
    Unfinished
        For `result_file` and `solve`: the run goes on from its last checkpoint, with the same bits as if it had never
        broken off.

    Raises
    ------
    InputError
        If there is nothing to go on from, it is damaged, or the case, flexcam or what it computes with is another.

    Examples
    --------
    >>> def resumed(ready, folder):
    ...     earlier = unfinished(ready, folder)
    ...     file = result_file(ready, folder, resume=earlier)
    ...     return solve(ready.problem, ready.scheme, save=ready.save, sinks=[file], resume=earlier)
    """
    path = Path(folder) / f"{ready.case.name}.vtkhdf"
    if not partial_of(path).exists():
        why = f"{path} is complete" if path.exists() else "there is no such file"
        raise refuse("--resume", str(partial_of(path)), "the partial result of a run", why, "leave out --resume")
    earlier = Unfinished(partial_of(path), geometry_of(ready.model), outline(ready.problem.system), ready.save)
    _refuse_others(ready, earlier)
    earlier.verify()
    return earlier


_DECISIVE = {
    "case": "the text of the case", "overrides": "--set", "resolved": "values of the case",
    "flexcam": "flexcam", "python": "python", "numpy": "numpy", "scipy": "scipy", "numba": "numba",
}  # fmt: skip
"""Texts of a result that must agree for the numbers to be the same, and what they are."""


def _refuse_others(ready: Prepared, earlier: Unfinished) -> None:
    """Refuse to go on with another case, other packages or another problem."""
    now, then = _about(ready.case), earlier.about
    differing = {what: key for key, what in _DECISIVE.items() if now[key] != then.get(key, "")}
    if not differing and earlier.checkpoint.problem != fingerprint(ready.problem, ready.scheme, ready.save):
        differing = {"a mesh or a table beside the case": ""}
    why, remedy = "a run goes on only as it began", "restore it, or run the case again with --overwrite"
    faults = [
        Fault(f"--resume: {what}", _told(now.get(key, "")), _told(then.get(key, "")), why, remedy)
        for what, key in differing.items()
    ]
    if faults:
        raise InputError(faults)


def _told(text: str) -> str:
    """Return a text that is short enough to be told."""
    return text if 0 < len(text) <= _SHORT else "another one"


_SHORT = 60


def _about(case: Case) -> dict[str, str]:
    """Return what must be known of a result later: the case, as written and as resolved, and what computed it."""
    return {
        "title": case.record.title,
        "case_file": str(case.path),
        "case": case.text,
        "overrides": json.dumps(case.overrides),
        "resolved": case.record.model_dump_json(by_alias=True),
        "warnings": "\n".join(unusual(case)),
        "flexcam": version("flexcam"),
        "python": platform.python_version(),
        **{package: version(package) for package in ("numpy", "scipy", "h5py", "meshio")},
        "numba": _version_if("numba"),
        "platform": platform.platform(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _version_if(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
