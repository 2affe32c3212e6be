"""What of a run is held against another run: the motion of the valve and the contact forces, over cam angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.response import Response

_MOTIONS = {"lift": "displacement", "velocity": "velocity", "acceleration": "acceleration"}
_UNITS = {"lift": "m", "velocity": "m/s", "acceleration": "m/s^2"}


@dataclass(frozen=True, eq=False)
class Measured:
    """Histories of a run by quantity, at common instants.

    Parameters
    ----------
    time
        s, shape (m,).
    values
        Name of the quantity to its history, SI, shape (m,): ``lift``, ``velocity`` and ``acceleration`` of the probe,
        ``force NAME`` of every contact.
    """

    time: FloatArray
    values: Mapping[str, FloatArray]

    def unit(self, quantity: str) -> str:
        """Return the SI unit of a quantity."""
        return _UNITS.get(quantity, "N")

    def size(self, quantity: str) -> float:
        """Return the largest absolute value of a quantity, of the lift its range unless it stands still."""
        values = self.values[quantity]
        moved = float(np.ptp(values)) if quantity == "lift" else 0.0
        return moved or float(np.abs(values).max(initial=0.0))


def measured(response: Response, probe: str) -> Measured:
    """Return what of a run is compared."""
    history = response[probe]
    if history.displacement.ndim != 1:
        raise refuse("probe", repr(probe), "one scalar: " + ", ".join(f"{probe}.{c}" for c in history.components))
    motions: dict[str, FloatArray] = {name: getattr(history, series) for name, series in _MOTIONS.items()}
    forces = {
        f"force {name.split('.')[1]}": values
        for name, values in response.channels.items()
        if name.startswith("contacts.") and name.endswith(".force")
    }
    return Measured(response.time, {**motions, **forces})


def distance(one: Measured, other: Measured, *, rms: bool = False) -> dict[str, float]:
    """Return the difference of two runs by quantity, SI, at the instants both have."""
    fine, coarse = (one, other) if len(one.time) >= len(other.time) else (other, one)
    step, shorter = _step(coarse), _step(fine)
    every = max(round(step / shorter), 1) if shorter > 0.0 else 1
    count = min(len(coarse.time), (len(fine.time) - 1) // every + 1)
    if np.abs(fine.time[::every][:count] - coarse.time[:count]).max(initial=0.0) > _SAME * step:
        raise refuse("responses", "instants that do not meet", "steps that divide each other")
    return {
        name: _size(fine.values[name][::every][:count] - values[:count], rms)
        for name, values in coarse.values.items()
        if name in fine.values
    }


def _step(one: Measured) -> float:
    return float(one.time[-1] - one.time[0]) / (len(one.time) - 1) if len(one.time) > 1 else 0.0


def _size(values: FloatArray, rms: bool) -> float:
    if not len(values):
        return 0.0
    return float(np.sqrt(np.mean(values**2)) if rms else np.abs(values).max())


_SAME = 1e-6
"""Part of a step by which instants may miss each other."""
