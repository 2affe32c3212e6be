"""The few shapes in which a run of a train is integrated: its modes, and the static answers that they miss."""

from __future__ import annotations

import numpy as np

from flexcam import modal
from flexcam.integrate import Problem, reached
from flexcam.linalg import FloatArray
from flexcam.system import Selection, Shapes, System, projected


def modal_basis(problem: Problem, count: int) -> Shapes:
    """Return the lowest modes of a problem's system, with the static answers to all that pushes or watches it.

    Parameters
    ----------
    problem
        The problem; of what nothing can move no mode is taken, where it is to be pruned.
    count
        How many modes with stiffness.

    Returns
    -------
    Shapes
        For `Problem.basis`.

    Raises
    ------
    RunFailedError
        If the modes cannot be computed.
    """
    n = problem.system.size
    chosen = Selection(np.arange(n), np.zeros(n))
    if problem.prune:
        found = reached(problem)
        chosen = Selection(np.flatnonzero(found.moving), found.held)
    if not chosen.size:
        return Shapes(np.zeros((n, 0)), still=chosen.held)
    own = projected(problem.system, chosen)
    vectors = modal.corrected_modes(own.mass, own.stiffness, _places(own), count, free=own.free)
    return Shapes(chosen.spread(vectors.T).T, still=chosen.held)


def _places(system: System) -> FloatArray:
    """Return the rows of all loads, of what local forces sense and act on, and of all probes, shape (k, n)."""
    forces = [one.vectors for force in system.local_forces for one in (*force.sense, *force.act)]
    rows = np.concatenate([system.load_vectors(), *forces, *(probe.rows for probe in system.probes)])
    return rows[rows.any(axis=1)]
