"""Ladder of models of a case, from rigid to refined beams, and mapping of initial states between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.comparison import Histories, extract_histories
from flexcam.analysis.preparation import (
    DEFAULT_STEPS_PER_REVOLUTION,
    prepare,
    prepare_without_periodic_search,
)
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.schema.run import GivenStartRecord
from flexcam.core import FloatArray
from flexcam.core.errors import InputError
from flexcam.dynamics import RunFailedError, integrated_size, solve
from flexcam.fem.recovery import deflection
from flexcam.valvetrain import Structure, build_structure
from flexcam.valvetrain.structure import inner_name, spring_parts


def map_initial_state(case: Case, other: Case) -> Case:
    """Return a case with the initial state of another one, where that is given at nodes.

    Points between two nodes of a member follow the shape functions of its elements: otherwise a finer mesh would have
    points at rest between moving ones, and start with an impact that the given mesh does not have. Between the ends of
    a spring part the motion is linear.
    """
    start = case.record.run.start
    if not isinstance(start, GivenStartRecord):
        return other
    structure, its = (build_structure(build_model(one)) for one in (case, other))
    parts = {name: (one.elements, other.record.members[name].elements) for name, one in case.record.members.items()}
    seen = [_map_nodal_values(structure, its, parts, values) for values in (start.displacement, start.velocity)]
    return other.with_run({"start": GivenStartRecord(displacement=seen[0], velocity=seen[1])})


def _map_nodal_values(
    structure: Structure, its: Structure, parts: Mapping[str, tuple[int, int]], values: Mapping[str, float]
) -> dict[str, float]:
    """Map named values from one mesh to another; values that do not belong to nodes are unchanged."""
    names, mesh = structure.dofs.names, structure.model.mesh
    on_nodes = names[: int((structure.dofs.numbers >= 0).sum())]
    row = np.array([values.get(name, 0.0) if name in on_nodes else 0.0 for name in names])
    nodal = structure.dofs.nodal(row)
    found, given = np.zeros((len(its.model.mesh.nodes), 6)), len(mesh.nodes)
    for name, elements in mesh.element_ranges().items():
        found[its.model.mesh.lines[name]] = _interpolate_member(structure, nodal, elements, *parts[name])
        given -= (elements.stop - elements.start) // parts[name][0] * (parts[name][0] - 1)
    found[:given] = nodal[:given]  # the nodes of the case come first in all its meshes
    free = its.dofs.numbers >= 0
    numbers: list[int] = its.dofs.numbers[free].tolist()
    amounts: list[float] = found[free].tolist()
    moved = {its.dofs.names[i]: x for i, x in zip(numbers, amounts, strict=True) if x}
    beside = {name: value for name, value in values.items() if name not in on_nodes}
    return moved | _map_spring_values(structure, its, values, beside)


def _map_spring_values(
    structure: Structure, its: Structure, values: Mapping[str, float], beside: Mapping[str, float]
) -> dict[str, float]:
    """Map values of internal spring nodes to springs with another number of parts."""
    found, row = dict(beside), np.array([values.get(name, 0.0) for name in structure.dofs.names])
    for name, spring in structure.model.springs.items():
        own, parts = spring.elements, its.model.springs[name].elements
        if own == parts:
            continue
        ends = spring_parts(structure, name, spring)
        line = [float(ends[0][0] @ row), *(float(high @ row) for _, high in ends)]
        for i in range(1, own):
            found.pop(inner_name(name, i), None)
        inner = np.interp(np.arange(1, parts) / parts, np.arange(own + 1) / own, line).tolist()
        found |= {inner_name(name, i): value for i, value in enumerate(inner, start=1) if value}
    return found


def _interpolate_member(structure: Structure, nodal: FloatArray, elements: slice, parts: int, other: int) -> FloatArray:
    """Return the motion at the nodes of a member that has `other` elements per segment instead of `parts`."""
    local = deflection(structure.beams, nodal, other, elements)
    triads = structure.beams.triads[elements]
    turned = [np.einsum("eji,epj->epi", triads, local[..., kind]) for kind in (slice(0, 3), slice(3, 6))]
    whole = np.concatenate(turned, axis=-1)
    line = np.concatenate([whole[:, :-1].reshape(-1, 6), whole[-1:, -1]])
    return line[::parts]


_ELEMENTS = (1, 2)  # elements per segment of every member, in addition to those of the case and twice as many
_MODE_COUNTS = (3, 10, 30)  # numbers of modes of the reduced models


@dataclass(frozen=True, eq=False)
class ModelLevel:
    """Model of a case."""

    name: str  #: name, such as ``rigid`` or ``beams x2``
    words: str  #: description
    case: Case  #: case with the settings of this model


def run_count(case: Case, work: int) -> int:
    """Return the number of runs like that of a case with this sum of steps per revolution, at least one.

    Setup that speeds up many short runs may not pay for a single run.
    """
    return max(round(work / steps_per_revolution_of(case)), 1) if work else 1


def run_histories(case: Case, probe: str, until: float | None = None, work: int = 0) -> Histories:
    """Return the compared histories of a case's run; `work` is the steps per revolution of all planned runs."""
    ready = prepare(case, until=until, runs=run_count(case, work))
    response = solve(ready.problem, ready.scheme, save=ready.save, until=until)
    if not response.status.ok:
        raise RunFailedError(response.status)
    return extract_histories(response, probe)


def with_steps(case: Case, per_revolution: int) -> Case:
    """Return a case with another number of steps per revolution."""
    return case.with_run({"steps_per_revolution": per_revolution, "step": None})


def steps_per_revolution_of(case: Case) -> int:
    """Return the steps per camshaft revolution of a case, rounded if it gives a time step."""
    run = case.record.run
    if run.step is None:
        return run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    ready = prepare(case, rigid=True)
    return round(ready.revolution / ready.problem.step)


def with_elements(case: Case, factor: int | None = None, each: int | None = None) -> Case:
    """Return a case with another number of elements per segment of its members and springs."""
    members = {
        name: one.model_copy(update={"elements": each or one.elements * (factor or 1)})
        for name, one in case.record.members.items()
    }
    springs = case.record.springs | {
        name: one.model_copy(update={"elements": one.elements * (factor or 1)})
        for name, one in case.record.springs.items()
        if one.part.mass or one.elements > 1
    }
    made = replace(case, record=case.record.model_copy(update={"members": members, "springs": springs}))
    return map_initial_state(case, made)


def with_beam_model(case: Case) -> Case:
    """Return a case with all degrees of freedom of its beams, regardless of its fidelity."""
    return case.with_fidelity(
        {"model": "beams", "tolerance": None, "estimate": False, "modes": None, "reduction": "modes"}
    )


def _count_unknowns(rung: ModelLevel) -> int | None:
    """Return the unknowns of a model; None if its case has none such: a chain requires a single train with nodes."""
    try:
        problem = prepare_without_periodic_search(rung.case).problem
    except (InputError, RunFailedError):
        return None
    return integrated_size(problem)


def model_ladder(case: Case) -> tuple[ModelLevel, ...]:
    """Return the models of a case from coarse to fine."""
    beams = with_beam_model(case)
    own = {one.elements for one in case.record.members.values()}
    unknowns = prepare_without_periodic_search(beams).problem.system.size
    fewer = [
        ModelLevel(f"beams {n}", f"{n} element{'s' if n > 1 else ''} per segment", with_elements(beams, each=n))
        for n in _ELEMENTS
        if n < min(own, default=0)
    ]
    modes: dict[int | None, ModelLevel] = {}
    for n in _MODE_COUNTS:
        if 2 * n < unknowns:
            words, case_n = f"{n} modes with the static answers they miss", beams.with_fidelity({"modes": n})
            level = ModelLevel(f"modes {n}", words, case_n)
            # Among the static answers of one basis are the next modes of a short train.
            modes.setdefault(_count_unknowns(level), level)
    chains = [
        ModelLevel("sdof", "one mass for the train", beams.with_fidelity({"model": "sdof"})),
        ModelLevel("chain 3", "three masses along the train", beams.with_fidelity({"model": "chain", "masses": 3})),
    ]
    return (
        ModelLevel("rigid", "rigid members", beams.with_fidelity({"model": "rigid"}).with_run({"engine": "auto"})),
        *(rung for rung in chains if _count_unknowns(rung) is not None),
        *modes.values(),
        *fewer,
        ModelLevel("beams", "the unchanged case", beams),
        ModelLevel("beams x2", "twice its elements", with_elements(beams, factor=2)),
    )
