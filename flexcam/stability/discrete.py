"""Whether the time integration itself grows: its spectral radius over the modes of the linearized system.

They are the modes of what is integrated: motions that nothing can start, and those left out of a reduced model, have no
step to grow in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from flexcam.integrate import Method, Tangents, basis_of, highest_frequency
from flexcam.linalg import FloatArray
from flexcam.response import Response
from flexcam.runner import Prepared
from flexcam.system import projected

MOST = 400
"""Unknowns up to which the system is linearized about its motion; above it its highest mode is, without contacts."""

_LOOKS = 24
"""Instants of the last revolution that are looked at: contacts open and close, and their stiffness changes."""

_FREE = 1e-9
"""Part of the highest frequency squared below which a motion is free."""


@dataclass(frozen=True)
class Discrete:
    """Growth of a mode by the time integration.

    Parameters
    ----------
    radius
        Largest factor by which a mode grows in one step.
    frequency
        Of the mode it belongs to, Hz.
    damping
        Its damping ratio.
    moving
        What moves most in it, by name.
    angle
        Cam angle at which it is so, rad.
    critical_step
        Up to which no mode grows, s; infinite where the method has no limit.
    """

    radius: float
    frequency: float
    damping: float
    moving: tuple[str, ...]
    angle: float
    critical_step: float

    @property
    def looked_at(self) -> bool:
        """Whether there was a mode to look at."""
        return bool(self.moving)


@dataclass(frozen=True, eq=False)
class _Swings:
    """Natural motions at an instant: angular frequencies, damping ratios, shapes as columns."""

    omegas: FloatArray
    ratios: FloatArray
    shapes: FloatArray


def discrete(ready: Prepared, method: Method, response: Response) -> Discrete:
    """Return which mode the time integration endangers most."""
    step, names = ready.problem.step, ready.problem.system.names
    if ready.problem.system.size > MOST:
        return _of_the_highest(ready, method)
    worst, critical = Discrete(0.0, 0.0, 0.0, (), 0.0, math.inf), math.inf
    limited = method.stable_to() < math.inf
    for angle, swings in _along(ready, response):
        if not len(swings.omegas):
            continue
        pairs = zip(swings.omegas.tolist(), swings.ratios.tolist(), strict=True)
        radii = [method.spectral_radius(omega * step, max(ratio, 0.0)) for omega, ratio in pairs]
        most = max(range(len(radii)), key=lambda i: (round(radii[i], 9), swings.omegas[i]))
        here = Discrete(
            radii[most], float(swings.omegas[most]) / (2.0 * math.pi), float(swings.ratios[most]),
            _moving(swings.shapes[:, most], names), angle, math.inf,
        )  # fmt: skip
        if limited:
            ratio = max(float(swings.ratios[-1]), 0.0)
            critical = min(critical, method.stable_to(ratio) / float(swings.omegas[-1]))
        if (round(here.radius, 9), here.frequency) > (round(worst.radius, 9), worst.frequency):
            worst = here
    return Discrete(worst.radius, worst.frequency, worst.damping, worst.moving, worst.angle, critical)


def _of_the_highest(ready: Prepared, method: Method) -> Discrete:
    """Return the growth of the highest mode without contacts: methods that have a limit have it there."""
    basis, system = basis_of(ready.problem), ready.problem.system
    omega, moving = highest_frequency(projected(system, basis) if basis is not None and basis.size else system)
    radius, limit = method.spectral_radius(omega * ready.problem.step), method.stable_to()
    return Discrete(radius, omega / (2.0 * math.pi), 0.0, tuple(moving), 0.0, limit / omega if omega else math.inf)


def _along(ready: Prepared, response: Response) -> list[tuple[float, _Swings]]:
    """Return cam angle and natural motions at some instants of the last revolution."""
    system = ready.problem.system
    if not 0 < system.size <= MOST or not len(response.field_time):
        return []
    late: list[int] = np.flatnonzero(response.field_time > response.field_time[-1] - ready.revolution).tolist()
    chosen = late[:: max(len(late) // _LOOKS, 1)]
    fields = response.fields.at(np.isin(np.arange(len(response.field_time)), chosen))
    motion = ready.problem.drive.at(response.field_time[chosen])
    tangents = Tangents(system, motion, fields.displacement, fields.velocity)
    basis = basis_of(ready.problem)
    within = basis.spread(np.eye(basis.size)).T if basis is not None and basis.size else np.eye(system.size)
    last = None
    found: list[tuple[float, _Swings]] = []
    for i in range(len(chosen)):
        C, K = tangents.at(i)
        if last is None or not np.array_equal(K, last):
            swings = _swings(*(within.T @ matrix @ within for matrix in (tangents.mass, C, K)))
            shown = replace(swings, shapes=within @ swings.shapes)
            found.append((float(response.field_angle[chosen[i]]), shown))
        last = K
    return found


def _swings(M: FloatArray, C: FloatArray, K: FloatArray) -> _Swings:
    """Return the natural motions of matrices that need not be symmetric, lowest first, without free or growing ones."""
    from scipy.linalg import eig

    values, vectors = (np.asarray(one) for one in eig(K, M))
    squares: FloatArray = np.real(values)
    good = np.isfinite(squares) & (np.abs(np.imag(values)) <= np.abs(squares))
    good &= squares > _FREE * np.max(np.abs(squares[good]), initial=0.0)
    order = np.flatnonzero(good)[np.argsort(squares[good])]
    omegas, shapes = np.sqrt(squares[order]), np.real(vectors[:, order])
    heavy = np.einsum("ik,ik->k", shapes, M @ shapes)
    slowed = np.einsum("ik,ik->k", shapes, C @ shapes)
    return _Swings(omegas, slowed / np.where(heavy > 0.0, 2.0 * omegas * heavy, np.inf), shapes)


def _moving(shape: FloatArray, names: tuple[str, ...]) -> tuple[str, ...]:
    order: list[int] = np.argsort(-np.abs(shape)).tolist()
    return tuple(names[i] for i in order[:3])
