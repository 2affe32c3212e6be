"""Energies stored by the local forces that act against what they sense."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flexcam.linalg import FloatArray, IntArray
from flexcam.system import ForceLaw
from flexcam.system.force_laws import CUSTOM, FIRST, KIND, LAWS

if TYPE_CHECKING:
    from flexcam.integrate.local import LocalForces


class StoredEnergy:
    """Energy of some conservative local forces at m instants.

    Parameters
    ----------
    forces
        The local forces of a system.
    scalars
        Which of the sensed scalars, ascending, shape (r,); None for all. Laws are taken whole.

    Attributes
    ----------
    lossy
        Positions, among these scalars, of those whose laws may dissipate energy.
    """

    def __init__(self, forces: LocalForces, scalars: IntArray | None = None) -> None:
        self._forces = forces
        self._scalars = np.arange(forces.count) if scalars is None else scalars
        table = forces.table.laws
        stores = np.isin(table[:, FIRST], self._scalars) & (forces.storing[table[:, FIRST]] > 0.0)
        self._laws = table[stores & (table[:, KIND] != CUSTOM)]
        varies = [bool(LAWS[kind].functions) for kind in self._laws[:, KIND].tolist()]
        self._varying = self._laws[varies]
        lossy = np.zeros(forces.count, dtype=bool)
        for force, part, _ in forces.parts:
            lossy[part] = isinstance(force.law, ForceLaw) and not force.law.lossless
        self.lossy: IntArray = np.flatnonzero(lossy[self._scalars] & (forces.storing[self._scalars] > 0.0))

    def at(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the energy, J, (m,), its derivatives by the scalars, (m, r), and by all internal states, (m, s)."""
        energy, force, by_state = self._forces.energies(
            self._all(gap), state, self._forces.function_values(angle), self._laws
        )
        return energy.sum(axis=1), force[:, self._scalars], by_state

    def varying(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the energy of the laws that depend on the cam angle, J, shape (m,)."""
        if not len(self._varying):
            return np.zeros(len(gap))
        functions = self._forces.function_values(angle)
        return self._forces.energies(self._all(gap), state, functions, self._varying)[0].sum(axis=1)

    def _all(self, gap: FloatArray) -> FloatArray:
        """Return the scalars among all of the system, zero for the others."""
        if len(self._scalars) == self._forces.count:
            return gap
        whole = np.zeros((len(gap), self._forces.count))
        whole[:, self._scalars] = gap
        return whole
