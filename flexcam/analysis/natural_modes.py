"""Natural modes of cases and their similarity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexcam.analysis.preparation import prepare
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse
from flexcam.dynamics import RunFailedError, State, mac
from flexcam.valvetrain import CamContact, ModelModes, build_structure, model_modes, modes_on_the_lift


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
        raise refuse("count", count, "a whole number, at least 1")
    if prestress is None:
        return model_modes(build_structure(build_model(case)), count)
    flexible = case.with_fidelity({"model": "beams", "modes": None, "reduction": "modes"})
    ready = prepare(flexible.with_run({"start": prestress}))
    state = ready.problem.start or State.rest(ready.problem.system.size)
    return model_modes(build_structure(ready.model), count, loaded=state.displacement)


@dataclass(frozen=True, eq=False)
class ClosedModes:
    """Modes of a train with its contacts as in static equilibrium."""

    contact: str  #: contact of the cam that stands at its base circle or at its full lift
    #: `base_circle`, `full_lift`: modes
    base_circle: ModelModes
    full_lift: ModelModes


_MAX_UNKNOWNS = 1000  # number of unknowns up to which the modes of every cam take seconds


def closed_modes(case: Case) -> tuple[list[ClosedModes], str]:
    """Return the modes with contacts closed for every cam; without a static equilibrium none, and the reason."""
    model = build_model(case)
    if (size := build_structure(model).dofs.size) > _MAX_UNKNOWNS:
        return [], f"No modes with contacts closed: {size} unknowns, computed up to {_MAX_UNKNOWNS}"
    contacts = [name for name, one in model.cam_contacts.items() if isinstance(one, CamContact)]
    try:
        found: list[ClosedModes] = []
        for name in contacts:
            base = modes_on_the_lift(model, name, case.speed, base_circle=True).found
            found.append(ClosedModes(name, base, modes_on_the_lift(model, name, case.speed).found))
    except (InputError, RunFailedError) as failure:
        return [], f"No modes with contacts closed: {failure}"
    return found, ""


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
        raise refuse("--mac", str(other.path), "a model with the same nodes", "mode shapes are compared at the nodes")
    moving = sum(bool(shapes[0][place].any()) for place in common)
    columns = [np.concatenate([one[place] for place in common], axis=1).T for one in shapes]
    return mac(columns[0], columns[1]), moving
