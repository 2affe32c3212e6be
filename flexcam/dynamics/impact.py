"""Impacts of several bodies at once: Newton's law of restitution as a linear complementarity problem.

With the rate of approach u of every closed contact and its impulse p, the rate after the impact is ``u - W p``, where W
= G M^-1 G^T is the Delassus matrix. Newton's law requires ``0 <= p``, ``W p >= (1 + e) u``, and no impulse if a contact
separates faster. B. Brogliato, Nonsmooth Mechanics, 3rd ed. (2016), ch. 5; V. Acary and B. Brogliato, Numerical Methods
for Nonsmooth Dynamical Systems (2008), ch. 3 and 12; O. Bruels, V. Acary, A. Cardona, Comput. Methods Appl. Mech. Eng.
281 (2014). The kinetic energy changes by ``sum p (e - 1) u/2``: it never grows for e up to 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexcam.core import FloatArray, IntArray

_ROUNDING = 1e-12
"""Relative size below which an impulse is zero."""


@dataclass(frozen=True, eq=False)
class Impact:
    """Closed contacts at an instant, k of them.

    Parameters
    ----------
    sense, turning
        G and its time derivative, shape (k, n).
    gained
        Velocity per unit of each impulse, -M^-1 G^T, shape (n, k).
    restitution
        e, shape (k,).
    """

    sense: FloatArray
    turning: FloatArray
    gained: FloatArray
    restitution: FloatArray

    @cached_property
    def delassus(self) -> FloatArray:
        """Delassus matrix W, shape (k, k)."""
        return -self.sense @ self.gained

    def reversal(self, rate: FloatArray) -> FloatArray:
        """Return the minimum factor of the rate that an impulse removes, shape (k,).

        A contact that separates slowly, by oscillation on its stiffness, may return with the same velocity; stopping it
        would add energy.
        """
        return np.where(rate >= 0.0, 1.0 + self.restitution, 2.0)

    def impulse(self, rate: FloatArray) -> FloatArray:
        """Return the impulses, shape (k,); zeros if no impulse can separate the bodies, as between closing walls."""
        return solve_complementarity(self.delassus, self.reversal(rate) * rate)

    def part(self, which: IntArray) -> Impact:
        """Return a subset of the contacts."""
        return Impact(self.sense[which], self.turning[which], self.gained[:, which], self.restitution[which])

    def velocity_change(self, rate: FloatArray, factor: FloatArray) -> FloatArray:
        """Return the velocity change, shape (n, ...), that removes a factor of the rates, shape (k, ...)."""
        asked = (factor * rate.T).T
        return np.asarray(self.gained @ np.linalg.lstsq(self.delassus, asked, rcond=_ROUNDING)[0], dtype=float)


def solve_complementarity(W: FloatArray, asked: FloatArray) -> FloatArray:
    """Return p >= 0 with W p >= b and p (W p - b) = 0 for a symmetric W without negative eigenvalues.

    The solution is the smallest change of velocity in the mass norm: least distance programming by non-negative least
    squares, C. L. Lawson and R. J. Hanson, Solving Least Squares Problems (1974), ch. 23. All solutions give the same
    velocities; zeros where there is none.
    """
    nothing = np.zeros(len(asked))
    if len(asked) == 1:
        return np.maximum(asked / W[0], 0.0)
    scale = 1.0 / np.sqrt(np.diag(W))
    sized, wanted = scale[:, None] * W * scale, scale * asked
    if not (size := float(wanted.max())) > 0.0:
        return nothing
    pushes = _solve_active_set(sized, wanted / size)
    if pushes is None:
        return nothing
    held = np.flatnonzero(pushes > _ROUNDING * pushes.max())
    found = nothing.copy()
    found[held] = np.linalg.lstsq(sized[np.ix_(held, held)], wanted[held], rcond=_ROUNDING)[0]
    return scale * np.maximum(found, 0.0)


def _solve_active_set(W: FloatArray, asked: FloatArray) -> FloatArray | None:
    """Return the solution to some digits, which identifies the active contacts; None without a solution."""
    from scipy.optimize import nnls

    values, vectors = np.linalg.eigh(W)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    matrix, aim = np.vstack([root, asked]), np.append(np.zeros(len(asked)), 1.0)
    try:
        amounts = np.asarray(nnls(matrix, aim)[0], dtype=float)
    except RuntimeError:  # iteration limit of the active set
        return None
    left = 1.0 - float(asked @ amounts)
    return amounts / left if left > _ROUNDING else None
