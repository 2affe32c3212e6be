"""Histories of the quantities of a run, and the distance between two runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import SERIES, SLOPES, Response, Series, component_unit, peak, scalar_history, value_range
from flexcam.valvetrain import seating

_INSTANT_TOLERANCE = 1e-6  # tolerance for equal instants relative to a step

Norm = Literal["max", "rms"]
"""Norm of the difference of two histories: maximum or root mean square."""

_MOTIONS = {"lift": "displacement", "velocity": "velocity", "acceleration": "acceleration"}
_SEATING = "seating velocity"


@dataclass(frozen=True, eq=False)
class Histories:
    """Histories of a run by quantity, at common instants."""

    time: FloatArray  #: instants, s, shape (m,)
    #: history by quantity, SI, shape (m,): ``lift``, ``velocity`` and ``acceleration`` of the probe, ``force NAME`` of
    #: every contact; a seating velocity is constant
    values: Mapping[str, FloatArray]
    #: rate of a quantity that is cubic between two instants, by name, shape (m,); other quantities are linear there
    slopes: Mapping[str, FloatArray]
    component: str  #: of the probe

    def unit(self, quantity: str) -> str:
        """Return the SI unit of a quantity."""
        if quantity in _MOTIONS:
            return component_unit(self.component, SERIES[_MOTIONS[quantity]])
        return "m/s" if quantity.startswith(_SEATING) else "N"

    def size(self, quantity: str) -> float:
        """Return the maximum absolute value of a quantity; for the lift its range, unless it is constant."""
        history = self.time, self.values[quantity], self.slopes.get(quantity)
        extent = value_range(*history) if quantity == "lift" else 0.0
        return extent or peak(*history)[0]


def extract_histories(response: Response, probe: str) -> Histories:
    """Return the compared histories of a run."""
    history = scalar_history(response, probe)
    motions: dict[str, FloatArray] = {name: getattr(history, series) for name, series in _MOTIONS.items()}
    slopes = {name: getattr(history, SLOPES[series]) for name, series in _MOTIONS.items() if series in SLOPES}
    forces = {
        f"force {name.split('.')[1]}": values
        for name, values in response.channels.items()
        if name.startswith("contacts.") and name.endswith(".force")
    }
    return Histories(response.time, {**motions, **forces}, slopes, history.components[0])


def with_seating(histories: Histories, response: Response) -> Histories:
    """Return histories with the seating velocity of every valve in the last revolution."""
    last = response.angle > response.angle[-1] - 2.0 * np.pi
    values = dict(histories.values)
    for name in (channel.removesuffix(".gap") for channel in response.channels if channel.endswith(".gap")):
        if f"{name}.velocity" in response.channels:
            gap, velocity = (response.channels[f"{name}.{series}"][last] for series in ("gap", "velocity"))
            if (closing := seating(gap, velocity, response.angle[last])) is not None:
                seat = f"{_SEATING} {name.partition('.')[2]}"
                values[seat] = np.full_like(response.time, closing.velocity)
    return replace(histories, values=values)


def select_norm(quantity: str, asked: Norm | None) -> Norm:
    """Return the norm for the error of a quantity: the requested one, else the maximum for a force.

    The maximum is the relevant measure of a force; an impact of a few steps hardly affects its root mean square.
    """
    return asked or ("max" if quantity.startswith("force") else "rms")


def distance(one: Histories, other: Histories, *, norm: Norm | None = "max") -> dict[str, float]:
    """Return the difference of two runs by quantity, SI; without a norm each in the norm of `select_norm`.

    Root mean squares use the common instants. Maxima do too, except for motions with slopes, which use all instants of
    the finer run; they are not less than the difference of the maxima of both runs.
    """
    fine, coarse = (one, other) if len(one.time) >= len(other.time) else (other, one)
    step, shorter = (float(np.ptp(part.time)) / max(len(part.time) - 1, 1) for part in (coarse, fine))
    every = max(round(step / shorter), 1) if shorter > 0.0 else 1
    count = min(len(coarse.time), (len(fine.time) - 1) // every + 1)
    if np.abs(fine.time[::every][:count] - coarse.time[:count]).max(initial=0.0) > _INSTANT_TOLERANCE * step:
        raise refuse("responses", "instants that differ", "one step a multiple of the other")
    differences: dict[str, float] = {}
    for name in (name for name in coarse.values if name in fine.values):
        difference = fine.values[name][::every][:count] - coarse.values[name][:count]
        if select_norm(name, norm) == "max":
            differences[name] = _maximum_difference(fine, coarse, name, difference)
        else:
            differences[name] = float(np.sqrt(np.mean(difference**2))) if count else 0.0
    return differences


def _maximum_difference(fine: Histories, coarse: Histories, name: str, difference: FloatArray) -> float:
    """Return the maximum difference of a quantity, given the difference at common instants."""
    maximum = max(float(np.abs(difference).max(initial=0.0)), abs(fine.size(name) - coarse.size(name)))
    slopes = coarse.slopes.get(name)
    if slopes is None or len(coarse.time) < 2:
        return maximum
    common = fine.time <= coarse.time[-1]
    values, rates = coarse.values[name][:, None], slopes[:, None]
    curve = Series(values, rates, np.zeros_like(rates)).interpolate(coarse.time, fine.time[common]).displacement[:, 0]
    return max(maximum, float(np.abs(fine.values[name][common] - curve).max(initial=0.0)))
