"""Modal reduction: modes with static correction, and Craig-Bampton reduction.

Truncated modes miss the response of higher modes to a load, which is static for slow loads. With static correction,
displacements under loads at the given points are exact in statics. R. R. Craig and A. J. Kurdila, Fundamentals of
Structural Dynamics, 2nd ed. (2006), ch. 17; R. R. Craig and M. C. C. Bampton, Coupling of substructures for dynamic
analyses, AIAA J. 6 (1968).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexcam.core import (
    FloatArray,
    IntArray,
    SingularMatrixError,
    Triplets,
    diagonal_scale,
    factorize,
    select_constraints,
)
from flexcam.core.errors import refuse
from flexcam.dynamics.modes import Modes, modes

_DEPENDENT = 1e-10
"""Fraction of strain energy of a static solution below which it depends linearly on others."""

_STILL = 1e-12
"""Fraction of the size of a shape, as square root of its strain energy, that is rounding."""


def corrected_modes(
    mass: Triplets, stiffness: Triplets, places: FloatArray, count: int, *, free: FloatArray | None = None
) -> FloatArray:
    """Return the lowest modes with their static correction."""
    rigid = modes(mass, stiffness, 1, free=free).rigid if free is None else free.shape[1]
    found = modes(mass, stiffness, rigid + count, free=free)
    shapes = found.shapes
    missed = places.T - mass.multiply(shapes) @ (shapes.T @ places.T)
    answers = _static_solutions(stiffness, missed, shapes[:, : found.rigid])
    answers -= shapes @ (shapes.T @ mass.multiply(answers))
    known = (places @ shapes[:, found.rigid :]) ** 2 @ found.omegas[found.rigid :] ** -2.0
    return np.hstack([shapes, _orthogonalize(mass, stiffness, answers, known)])


def _static_solutions(stiffness: Triplets, loads: FloatArray, rigid: FloatArray) -> FloatArray:
    """Return static solutions for loads that do no work on the free motions, shape (n, k)."""
    held = select_constraints(rigid / diagonal_scale(stiffness)[:, None])
    kept = np.setdiff1d(np.arange(stiffness.size), held)
    answers = np.zeros(loads.shape)
    answers[kept] = factorize(stiffness.part(kept)).solve(loads[kept])
    return answers


def _orthogonalize(mass: Triplets, stiffness: Triplets, shapes: FloatArray, known: FloatArray) -> FloatArray:
    """Return shapes of the same span with unit stiffness and diagonal mass, the lightest last.

    A shape is used if its energy exceeds that of its projection on the others.
    """
    energy = np.maximum(np.einsum("ik,ik->k", shapes, stiffness.multiply(shapes)), 0.0)
    kept = energy > _DEPENDENT * (known + energy)
    shapes = shapes[:, kept] / np.sqrt(energy[kept])
    values, vectors = np.linalg.eigh(shapes.T @ stiffness.multiply(shapes))
    good = values > _DEPENDENT
    unit = shapes @ (vectors[:, good] / np.sqrt(values[good]))
    _, turned = np.linalg.eigh(unit.T @ mass.multiply(unit))
    found = unit @ turned[:, ::-1]
    # Otherwise a shape of a massless unknown would have the mass of rounding and a very high frequency.
    return np.where(np.abs(found) > _STILL * diagonal_scale(stiffness)[:, None], found, 0.0)


def craig_bampton(
    mass: Triplets, stiffness: Triplets, boundary: IntArray, interiors: Sequence[IntArray], count: int
) -> FloatArray:
    """Return the Craig-Bampton basis: boundary unknowns, constraint modes and fixed-interface modes."""
    inner = np.concatenate([np.zeros(0, np.intp), *interiors])
    if not np.array_equal(np.sort(np.concatenate([boundary, inner])), np.arange(stiffness.size)):
        raise refuse("boundary and interiors", f"{len(boundary)} + {len(inner)} unknowns", "every unknown once")
    unit = np.zeros((stiffness.size, len(boundary)))
    unit[boundary, np.arange(len(boundary))] = 1.0
    try:
        unit[inner] = -factorize(stiffness.part(inner)).solve(stiffness.multiply(unit)[inner])
    except SingularMatrixError as fault:
        which = ", ".join(str(inner[i]) for i in fault.unknowns[:6]) or "some"
        why = "a group that moves freely has no static answer"
        raise refuse("boundary", f"unknowns {which} free while it is held", "one that holds every group", why) from None
    return np.hstack([unit, *(_fixed_interface_modes(mass, stiffness, group, count) for group in interiors)])


def _fixed_interface_modes(mass: Triplets, stiffness: Triplets, group: IntArray, count: int) -> FloatArray:
    """Return the fixed-interface modes of a group, expanded to all unknowns."""
    own = modes(mass.part(group), stiffness.part(group), count, free=np.zeros((len(group), 0)))
    shapes = np.zeros((stiffness.size, own.shapes.shape[1]))
    shapes[group] = own.shapes
    return shapes


def effective_masses(modes: Modes, mass: Triplets, motions: FloatArray) -> FloatArray:
    """Return the effective modal masses ``(phi^T M r)^2`` of mass-orthonormal modes.

    Source: R. W. Clough and J. Penzien, Dynamics of Structures, 3rd ed. (2003), sec. 26-2. Over all modes they sum
    to ``r^T M r``, the mass of the free components along r.
    """
    pulled = np.array([mass.times(motion) for motion in motions]).reshape(len(motions), mass.size)
    return (modes.shapes.T @ pulled.T) ** 2


def mac(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the modal assurance criterion of two sets of shapes on the same components.

    ``|a^T b|^2/((a^T a)(b^T b))``: 1 for shapes that agree up to a factor, 0 for orthogonal ones. Source: R. J.
    Allemang, The modal assurance criterion - twenty years of use and abuse, Sound and Vibration 37 (2003), eq. 1.
    """
    sizes = np.outer(np.sum(one**2, axis=0), np.sum(other**2, axis=0))
    return np.divide((one.T @ other) ** 2, sizes, out=np.zeros(sizes.shape), where=sizes > 0.0)
