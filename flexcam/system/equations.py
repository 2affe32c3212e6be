"""The seam between the physics and everything that works on it.

A `System` is what a mechanism is, mathematically, with theta(t) the given cam angle::

    M u'' + C u' + K u = sum_k p_k phi_k(theta, omega, omega') + sum_i A_i(theta) f_i(gamma_i, gamma_i', z_i, theta)
    gamma_i = G_i(theta) u + g_i(theta)

Loads are a few vectors times scalar histories, evaluated for all steps at once. Everything nonlinear is local: a
`LocalForce` senses a few scalars gamma and acts with as many forces, so its tangent is a low-rank update. A rigid or
lumped model is the same `System` with fewer unknowns, or none: then only `Probe.offset` moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.linalg import FloatArray, Triplets
from flexcam.system.angle_functions import AngleFunction, AngleVector, Constant
from flexcam.system.channel import Channel
from flexcam.system.drive import CamMotion
from flexcam.system.local import LocalForce


@dataclass(frozen=True, eq=False)
class Load:
    """A spatial vector times a scalar history.

    Parameters
    ----------
    name
        For messages and results.
    vector
        Shape (n,), N or N m per unit of the history.
    history
        Scalar of the cam motion, vectorized.
    installed
        Whether it is there before the cam turns (a preload): a start from rest is its equilibrium.
    steady
        Whether its history is the same number at every instant: in balance, it moves nothing.
    """

    name: str
    vector: FloatArray
    history: Callable[[CamMotion], FloatArray]
    installed: bool = False
    steady: bool = False


@dataclass(frozen=True, eq=False)
class Probe:
    """What a user watches: scalars ``rows u + offset(theta)`` with their velocities and accelerations.

    Parameters
    ----------
    name
        As in the case file, such as ``"valve"``.
    components
        A name per scalar, such as ``("ux", "uy")``.
    rows
        Shape (k, n).
    offset
        Prescribed part by component; None where there is none.
    """

    name: str
    components: tuple[str, ...]
    rows: FloatArray
    offset: tuple[AngleFunction | None, ...]


@dataclass(frozen=True, eq=False)
class Carried:
    """Motions that the cam prescribes, to be shown among the results of a mechanism without unknowns.

    Parameters
    ----------
    names
        As those of unknowns, n of them.
    motion
        Over the cam angle, vectors of shape (k, n).
    """

    names: tuple[str, ...]
    motion: AngleVector

    def at(self, motion: CamMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return displacement, velocity and acceleration at some instants, shape (m, n) each."""
        cam, functions = motion.cam, self.motion.functions or (Constant(1.0),)
        each = ([cam(function, i) for function in functions] for i in range(3))
        moved, slope, bend = (np.stack(one, axis=-1) @ self.motion.vectors for one in each)
        speed, rate = motion.speed[:, None], motion.rate[:, None]
        return moved, slope * speed, bend * speed**2 + slope * rate


@dataclass(frozen=True, eq=False)
class System:
    """A mechanism as equations, see the module's head.

    Parameters
    ----------
    mass, damping, stiffness
        n x n, SI.
    names
        A name per unknown, such as ``"cam.uy"``.
    loads, local_forces, probes, channels
        As their classes say.
    free
        Motions that the stiffness leaves free, shape (n, k), where they are known; None to find them numerically.
    carried
        What is shown in place of the unknowns of a mechanism that has none.
    stored
        Strain energy of what is not among the unknowns, because it never moves, J.

    Examples
    --------
    >>> one = Triplets.from_dense([[1.0]])
    >>> System(mass=one, damping=Triplets.zeros(1), stiffness=one, names=("x",)).size
    1
    """

    mass: Triplets
    damping: Triplets
    stiffness: Triplets
    names: tuple[str, ...]
    loads: tuple[Load, ...] = ()
    local_forces: tuple[LocalForce, ...] = ()
    probes: tuple[Probe, ...] = ()
    channels: tuple[Channel, ...] = ()
    free: FloatArray | None = None
    carried: Carried | None = None
    stored: float = 0.0

    def __repr__(self) -> str:
        """Return its size and parts, not its numbers."""
        return f"<System of {self.size} unknowns, {len(self.loads)} loads, {len(self.local_forces)} local forces>"

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.mass.size

    def load_histories(self, motion: CamMotion) -> FloatArray:
        """Return the scalar histories of all loads.

        Parameters
        ----------
        motion
            Of the cam, at some instants.

        Returns
        -------
        ndarray
            Shape (times, loads); with `load_vectors` the loads in the unknowns.
        """
        if not self.loads:
            return np.zeros((*motion.angle.shape, 0))
        return np.stack([load.history(motion) for load in self.loads], axis=-1)

    def applied(self, motion: CamMotion) -> FloatArray:
        """Return the loads in the unknowns at some instants.

        Each instant has the same bits as if it were alone, which a product of matrices would not give.

        Parameters
        ----------
        motion
            Of the cam, at those instants.

        Returns
        -------
        ndarray
            N or N m, shape (times, n).
        """
        return np.einsum("tk,kn->tn", self.load_histories(motion), self._load_vectors)

    def load_vectors(self) -> FloatArray:
        """Return the spatial vectors of all loads, shape (loads, n)."""
        return self._load_vectors.copy()

    @cached_property
    def _load_vectors(self) -> FloatArray:
        return np.array([load.vector for load in self.loads]).reshape(len(self.loads), self.size)
