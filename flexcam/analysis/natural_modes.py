"""Natural modes of cases and their similarity."""

from __future__ import annotations

from typing import Literal

import numpy as np

from flexcam.analysis.preparation import prepare
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import State, mac
from flexcam.valvetrain import ModelModes, build_structure, model_modes


def modes(
    case: Case, count: int | None = None, *, prestress: Literal["rest", "equilibrium"] | None = None
) -> ModelModes:
    """Compute the natural modes of a case's structure.

    Parameters
    ----------
    case
        Case from `flexcam.read_case`.
    count
        Number of modes; None for all computable ones.
    prestress
        Static state whose axial forces are included: installed, or in equilibrium under all loads; None for the
        unloaded structure.

    Returns
    -------
    ModelModes
        Frequencies, shapes, effective masses and descriptions.

    Raises
    ------
    InputError
        If parts are inconsistent.
    RunFailedError
        If a rigid-body motion has no mass, or a member buckles under the prestress; the message names it.

    Examples
    --------
    ``flexcam.modes(case).words(1)`` describes the second mode.
    """
    if count is not None and count < 1:
        raise refuse("count", count, "a whole number from 1")
    if prestress is None:
        return model_modes(build_structure(build_model(case)), count)
    flexible = case.with_fidelity({"model": "beams", "modes": None, "reduction": "modes"})
    ready = prepare(flexible.with_run({"start": prestress}))
    state = ready.problem.start or State.rest(ready.problem.system.size)
    return model_modes(build_structure(ready.model), count, loaded=state.displacement)


def modal_assurance(case: Case, found: ModelModes, other: Case, others: ModelModes) -> tuple[FloatArray, int]:
    """Compare the modes of two cases by the modal assurance criterion."""
    shapes: list[dict[tuple[float, ...], FloatArray]] = []
    for one, its in ((case, found), (other, others)):
        structure = build_structure(build_model(one))
        nodal = structure.dofs.nodal(its.modes.shapes.T)
        places = np.round(structure.model.mesh.nodes, 9).tolist()
        shapes.append({tuple(place): nodal[:, i, :3] for i, place in enumerate(places)})
    common = [place for place in shapes[0] if place in shapes[1]]
    if not common:
        raise refuse("--mac", str(other.path), "a model with nodes at the same places", "shapes are compared there")
    moving = sum(bool(shapes[0][place].any()) for place in common)
    columns = [np.concatenate([one[place] for place in common], axis=1).T for one in shapes]
    return mac(columns[0], columns[1]), moving
