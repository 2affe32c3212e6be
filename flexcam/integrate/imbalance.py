"""By how much the forces of a run are out of balance: what the equation of motion lacks, computed from its parts.

The time integration balances forces by its own operators; here they are put together anew, from the matrices, the loads
and the local forces: between saved fields, where some ways through time take their state anew, and at the last step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexcam.checkpoint import Arrays
from flexcam.integrate.local import LocalForces
from flexcam.integrate.moment import Track
from flexcam.integrate.schedule import Schedule
from flexcam.linalg import FloatArray, IntArray, operator
from flexcam.system import Observed, System

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class Imbalance:
    """The largest force out of balance, as a part of the largest force, over a run.

    Forces and torques count by the displacement that each causes in its own unknown within a step, in the energy norm,
    so that no unit of an unknown matters.

    Parameters
    ----------
    system
        The system.
    forces
        Its local forces, stacked.
    step
        s.
    """

    def __init__(self, system: System, forces: LocalForces, step: float) -> None:
        self._forces, self._vectors = forces, system.load_vectors()
        self._matrices = [operator(one) for one in (system.mass, system.damping, system.stiffness)]
        stiff = np.abs(system.stiffness.diagonal()) + np.abs(system.mass.diagonal()) / step**2
        self._weights = np.divide(1.0, np.sqrt(stiff), out=np.zeros_like(stiff), where=stiff > 0.0)
        self._largest = np.full(2, -1.0)

    @property
    def share(self) -> float:
        """The largest so far, 1; zero where nothing acts, negative where no instant was looked at."""
        lacking, acting = self._largest
        return float(lacking / acting if acting > 0.0 else acting)

    def look(self, track: Track, seen: Observed, schedule: Schedule, rows: IntArray) -> None:
        """Take some instants into account."""
        if not len(rows) or not len(self._weights):
            return
        moved = (track.a[rows], track.v[rows], track.d[rows])
        parts = [_product(matrix, one) for matrix, one in zip(self._matrices, moved, strict=True)]
        parts.append(-seen.histories[rows] @ self._vectors)
        if self._forces.count:
            acted = (seen.forces[rows] @ schedule.acts) * schedule.acted[rows]
            parts.append(-acted @ self._forces.act.vectors)
        each = np.array(parts)
        self._largest = np.maximum(self._largest, [self._size(each.sum(axis=0)), self._size(each)])

    def _size(self, rows: FloatArray) -> float:
        weighed = rows * self._weights
        return float(np.sqrt(np.einsum("...i,...i->...", weighed, weighed).max()))

    def state(self) -> Arrays:
        """Return what the rest of the run goes on from."""
        return {"imbalance": self._largest.copy()}

    def restore(self, state: Arrays) -> None:
        """Go on from what `state` returned."""
        self._largest = state["imbalance"].copy()


def _product(matrix: FloatArray | csr_array, rows: FloatArray) -> FloatArray:
    return np.asarray(matrix @ rows.T, dtype=float).T
