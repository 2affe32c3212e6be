"""Measures of runs: histories, norms and distances; valve spring settings of a case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from flexcam.analysis.petrescu import Setting, SingleMassModel, evaluate_setting
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import SLOPES, AngleFunction, Response, Series, constant, peak, value_range
from flexcam.valvetrain import Cam, CamContact, Model, Spring, build_structure, follower_train, free_speed


def compute_settings(case: Case) -> list[Setting]:
    """Return the closed-form results of a case and of its listed settings."""
    model = build_model(case)
    where, contact = _single_item(
        "contacts", {n: one for n, one in model.cam_contacts.items() if isinstance(one, CamContact)}
    )
    if contact.stiffness is None or contact.follower in (rocker.start for rocker in model.rockers.values()):
        given = "a hertz contact, or a rocker on the follower"
        raise refuse(where, given, "a stiffness, and the valve at the follower", "the closed form is that of one mass")
    spring = _valve_spring(model, contact)
    mass, cam = follower_train(build_structure(model), contact, where).mass, model.cams[contact.cam]
    rows: list[tuple[str, float, float, float]] = [
        (case.name, case.speed, spring.stiffness, (spring.installed_force or 0.0) / spring.stiffness)
    ]
    for name, one in case.record.settings.items():
        given = one.camshaft_speed, one.stiffness, one.installed_compression
        speed, k, x0 = (own if new is None else new for new, own in zip(given, rows[0][1:], strict=True))
        rows.append((name, speed, k, x0))
    return [
        evaluate_setting(
            name, SingleMassModel(cam.event, mass, contact.stiffness, k, x0), _speed_function(case, cam, speed), speed
        )
        for name, speed, k, x0 in rows
    ]


def _single_item(kind: str, found: Mapping[str, CamContact]) -> tuple[str, CamContact]:
    if len(found) != 1:
        given = f"{len(found)} contacts of a cam in true contact"
        raise refuse(kind, given, "one", "the closed form is that of one mass under one cam")
    name, contact = next(iter(found.items()))
    return f"contacts.{name}", contact


def _valve_spring(model: Model, contact: CamContact) -> Spring:
    found = [one for one in model.springs.values() if one.installed_force and one.stiffness > 0.0]
    if len(found) != 1 or found[0].at != contact.follower:
        given = f"{len(found)} springs with stiffness and preload, not one at {contact.follower!r}"
        why, remedy = "the closed form is that of one mass on one spring", "give it an installed_compression"
        raise refuse("springs", given, f"one at {contact.follower!r}", why, remedy)
    return found[0]


def _speed_function(case: Case, cam: Cam, speed: float) -> AngleFunction:
    """Return the camshaft speed over the cam angle: that of a freely rotating cam or a constant."""
    free = case.record.run.free_running
    if free is None:
        return constant(speed)
    if cam.follower is None:
        why = "the inertia of the cam follows from its base circle"
        raise refuse("run.free_running.cam", "no base circle", "base_radius and follower", why, "add both")
    return free_speed(cam.event, cam.follower.base_radius, speed, free.cam_mass, free.follower_mass)


Norm = Literal["max", "rms"]
"""Norm of the difference of two histories: maximum or root mean square."""

_MOTIONS = {"lift": "displacement", "velocity": "velocity", "acceleration": "acceleration"}
_UNITS = {"lift": "m", "velocity": "m/s", "acceleration": "m/s^2"}


@dataclass(frozen=True, eq=False)
class Histories:
    """Histories of a run by quantity, at common instants.

    Parameters
    ----------
    time
        Instants, s, shape (m,).
    values
        History by quantity, SI, shape (m,): ``lift``, ``velocity`` and ``acceleration`` of the probe, ``force NAME`` of
        every contact.
    slopes
        Rate of a quantity that is cubic between two instants, by name, shape (m,); other quantities are linear there.
    """

    time: FloatArray
    values: Mapping[str, FloatArray]
    slopes: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])

    def unit(self, quantity: str) -> str:
        """Return the SI unit of a quantity."""
        return _UNITS.get(quantity, "N")

    def size(self, quantity: str) -> float:
        """Return the maximum absolute value of a quantity; for the lift its range, unless it is constant."""
        history = self.time, self.values[quantity], self.slopes.get(quantity)
        moved = value_range(*history) if quantity == "lift" else 0.0
        return moved or peak(*history)[0]


def extract_histories(response: Response, probe: str) -> Histories:
    """Return the compared histories of a run."""
    history = response[probe]
    if history.displacement.ndim != 1:
        raise refuse("probe", repr(probe), "one scalar: " + ", ".join(f"{probe}.{c}" for c in history.components))
    motions: dict[str, FloatArray] = {name: getattr(history, series) for name, series in _MOTIONS.items()}
    slopes = {name: getattr(history, SLOPES[series]) for name, series in _MOTIONS.items() if series in SLOPES}
    forces = {
        f"force {name.split('.')[1]}": values
        for name, values in response.channels.items()
        if name.startswith("contacts.") and name.endswith(".force")
    }
    return Histories(response.time, {**motions, **forces}, slopes)


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
    step, shorter = _step(coarse), _step(fine)
    every = max(round(step / shorter), 1) if shorter > 0.0 else 1
    count = min(len(coarse.time), (len(fine.time) - 1) // every + 1)
    if np.abs(fine.time[::every][:count] - coarse.time[:count]).max(initial=0.0) > _INSTANT_TOLERANCE * step:
        raise refuse("responses", "instants that do not meet", "steps that divide each other")
    found: dict[str, float] = {}
    for name in (name for name in coarse.values if name in fine.values):
        apart = fine.values[name][::every][:count] - coarse.values[name][:count]
        found[name] = (
            _root_mean_square(apart)
            if select_norm(name, norm) == "rms"
            else _maximum_difference(fine, coarse, name, apart)
        )
    return found


def _maximum_difference(fine: Histories, coarse: Histories, name: str, apart: FloatArray) -> float:
    """Return the maximum difference of a quantity, given the difference at common instants."""
    found = max(float(np.abs(apart).max(initial=0.0)), abs(fine.size(name) - coarse.size(name)))
    slopes = coarse.slopes.get(name)
    if slopes is None or len(coarse.time) < _MIN_INSTANTS:
        return found
    both = fine.time <= coarse.time[-1]
    values, rates = coarse.values[name][:, None], slopes[:, None]
    between = Series(values, rates, np.zeros_like(rates)).interpolate(coarse.time, fine.time[both]).displacement[:, 0]
    return max(found, float(np.abs(fine.values[name][both] - between).max(initial=0.0)))


def _step(one: Histories) -> float:
    return float(one.time[-1] - one.time[0]) / (len(one.time) - 1) if len(one.time) > 1 else 0.0


def _root_mean_square(values: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


_MIN_INSTANTS = 2
"""Minimum number of instants."""

_INSTANT_TOLERANCE = 1e-6
"""Tolerance for equal instants relative to a step."""
