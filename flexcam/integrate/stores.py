"""What local laws store, side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexcam.linalg import FloatArray, IntArray
from flexcam.system import Changing, Formula, Formulated, LocalLaw, Smooth, Stored, Storing

Placed = tuple[Storing, slice, slice]
"""A law, and its places among the sensed scalars and the internal states."""


_Energy = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""Of what a law senses, its internal states and cam angles."""


class Stores:
    """Storing laws side by side.

    Parameters
    ----------
    laws
        The laws.

    Attributes
    ----------
    lossy
        Scalars of the laws that may lose some of what they take, ascending.
    """

    def __init__(self, laws: Sequence[Placed]) -> None:
        self._laws = laws
        self._energies = [(_energy(law), part, inner) for law, part, inner in laws]
        self._changing = [(_changing(law), part, inner) for law, part, inner in laws if not _steady(law, part)]
        lossy = [i for law, part, _ in laws if not _lossless(law, part) for i in range(part.start, part.stop)]
        self.lossy: IntArray = np.array(lossy, dtype=np.intp)

    def stored(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> Stored:
        """Return the energy of all laws and its derivatives, zero for scalars that store none."""
        energy = np.zeros(len(angle))
        by_gap, by_state = np.zeros_like(gap), np.zeros_like(state)
        for law, part, inner in self._laws:
            one = law.stored(gap[:, part], state[:, inner], angle)
            energy += one.energy
            by_gap[:, part], by_state[:, inner] = one.by_gap, one.by_state
        return Stored(energy, by_gap, by_state)

    def energy(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the energy alone, J, shape (m,); asked as `stored`."""
        return _sum(self._energies, gap, state, angle)

    def changing(self, gap: FloatArray, state: FloatArray, angle: FloatArray) -> FloatArray:
        """Return the part of the energy that depends on the cam angle, J, shape (m,); asked as `stored`."""
        return _sum(self._changing, gap, state, angle)

    def among(self, scalars: IntArray) -> Stores:
        """Return the laws all of whose scalars are among some, ascending; over these alone."""
        laws: list[Placed] = []
        for law, part, inner in self._laws:
            first, end = np.searchsorted(scalars, [part.start, part.stop]).tolist()
            if end - first == part.stop - part.start:
                laws.append((law, slice(first, end), inner))
        return Stores(laws)


def _sum(
    energies: Sequence[tuple[_Energy, slice, slice]], gap: FloatArray, state: FloatArray, angle: FloatArray
) -> FloatArray:
    energy = np.zeros(len(angle))
    for law, part, inner in energies:
        energy += law(gap[:, part], state[:, inner], angle)
    return energy


def _energy(law: Storing) -> _Energy:
    """Return a law's energy alone."""
    if isinstance(law, Smooth):
        return lambda gap, state, angle: law.energy(gap)
    return lambda gap, state, angle: law.stored(gap, state, angle).energy


def _changing(law: Storing) -> _Energy:
    """Return the part of a law's energy that depends on the cam angle: all, where the law does not know better."""
    return law.changing if isinstance(law, Changing) else _energy(law)


def _formulas(law: Storing | LocalLaw, part: slice) -> tuple[Formula, ...] | None:
    return law.formulas(part.stop - part.start) if isinstance(law, Formulated) else None


def _steady(law: Storing, part: slice) -> bool:
    """Tell whether a law is known not to depend on the cam angle."""
    formulas = _formulas(law, part)
    return formulas is not None and not any(one.functions for one in formulas)


def _lossless(law: Storing, part: slice) -> bool:
    """Tell whether a law is known to give back all that it takes."""
    formulas = _formulas(law, part)
    return formulas is not None and all(one.lossless for one in formulas)
