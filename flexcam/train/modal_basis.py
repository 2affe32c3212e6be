"""The few shapes in which a run of a train is integrated: its modes, and the static answers that they miss."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexcam import modal
from flexcam.integrate import Problem, reached
from flexcam.linalg import FloatArray, IntArray, by_group, groups, null_space, pins
from flexcam.system import Selection, Shapes, System, projected


def modal_basis(problem: Problem, count: int, *, by_parts: bool = False) -> Shapes:
    """Return the lowest modes of a problem's system, with the static answers to all that pushes or watches it."""
    n = problem.system.size
    chosen = Selection(np.arange(n), np.zeros(n))
    if problem.prune:
        found = reached(problem)
        chosen = Selection(np.flatnonzero(found.moving), found.held)
    if not chosen.size:
        return Shapes(np.zeros((n, 0)), still=chosen.held)
    own = projected(problem.system, chosen)
    places = _places(own)
    if by_parts:
        boundary, parts = _parts(own, places)
        vectors = modal.craig_bampton(own.mass, own.stiffness, boundary, parts, count)
    else:
        vectors = modal.corrected_modes(own.mass, own.stiffness, places, count, free=own.free)
    return Shapes(chosen.spread(vectors.T).T, still=chosen.held)


def _parts(system: System, places: FloatArray) -> tuple[IntArray, list[IntArray]]:
    """Return the unknowns that are pushed or watched, or free without them, and the others in groups they part."""
    kept: NDArray[np.bool_] = np.array(places.any(axis=0))
    held = np.flatnonzero(~kept)
    while len(held) and (loose := null_space(system.stiffness.part(held))).shape[1]:
        kept[held[pins(loose)]] = True  # a part that moves freely between kept unknowns is held by one more each
        held = np.flatnonzero(~kept)
    joined = system.stiffness.part(held) + system.mass.part(held)
    labels = groups(len(held), joined.rows, joined.cols)
    return np.flatnonzero(kept), [held[group] for group in by_group(labels)]


def _places(system: System) -> FloatArray:
    """Return the rows of all loads, of what local forces sense and act on, and of all probes, shape (k, n)."""
    forces = [one.vectors for force in system.local_forces for one in (*force.sense, *force.act)]
    rows = np.concatenate([system.load_vectors(), *forces, *(probe.rows for probe in system.probes)])
    return rows[rows.any(axis=1)]
