"""Comparison of responses: flexible against rigid at a probe, two runs by quantity, and contact models over speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.cams import event_extremes
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.core.units import RPM
from flexcam.dynamics import (
    SLOPES,
    History,
    ProgressCallback,
    Response,
    Series,
    Status,
    equilibrium,
    peak,
    reraise_interrupt,
    solve,
    track_progress,
    value_range,
)
from flexcam.dynamics.force_laws import line_load
from flexcam.valvetrain import CamContact, build_structure, build_system, hertz_line, main_lift


@dataclass(frozen=True)
class Deviation:
    """Deviation of one quantity from the rigid system."""

    #: ``displacement``, ``velocity`` or ``acceleration``
    quantity: str
    #: `peak`, `rms`: maximum difference, of the dense output, and root mean square difference, SI
    peak: float
    rms: float
    #: `rigid_peak`, `flexible_peak`: maximum absolute value of each system, SI
    rigid_peak: float
    flexible_peak: float
    angle_deg: float  #: cam angle of the maximum difference, deg

    @property
    def relative_peak(self) -> float:
        """Maximum difference relative to the rigid peak."""
        return self.peak / self.rigid_peak if self.rigid_peak > 0.0 else 0.0


@dataclass(frozen=True)
class Comparison:
    """Comparison of a flexible with a rigid response at one probe."""

    probe: str  #: name of the probe
    speed_rpm: float  #: camshaft speed, rpm
    lift: float  #: lift of the rigid system at the probe, m
    deviations: tuple[Deviation, Deviation, Deviation]  #: deviations of displacement, velocity and acceleration
    status: Status  #: status of the flexible run; the values of an incomplete run cover its finished part
    #: names of the compared systems: the first replaces the flexible, the second the rigid one
    names: tuple[str, str] = ("flexible", "rigid")

    @property
    def peak_deviation(self) -> float:
        """Maximum displacement difference relative to the lift."""
        return self.deviations[0].peak / self.lift

    @property
    def rms_deviation(self) -> float:
        """Root mean square displacement difference relative to the lift."""
        return self.deviations[0].rms / self.lift

    @property
    def peak_acceleration_ratio(self) -> float:
        """Ratio of the maximum accelerations of the flexible and the rigid system."""
        still = self.deviations[2].rigid_peak
        return self.deviations[2].flexible_peak / still if still > 0.0 else 0.0


_MIN_INSTANTS = 2
_SAME_ANGLE = 1e-6  # tolerance for equal cam angles, rad
_INSTANT_TOLERANCE = 1e-6  # tolerance for equal instants relative to a step


def compare(flexible: Response, rigid: Response, probe: str, speed_rpm: float) -> Comparison:
    """Compare a flexible with a rigid response at a scalar probe.

    Parameters
    ----------
    flexible, rigid
        Responses at the same instants; an incomplete flexible response is compared over its own length.
    probe
        Name of the probe, such as ``"valve"`` or ``"tappet.uy"``.
    speed_rpm
        Camshaft speed, rpm, stored in the comparison.

    Returns
    -------
    Comparison
        Deviations of displacement, velocity and acceleration.

    Raises
    ------
    InputError
        If the probe is not scalar, or the rigid system does not move there.

    Examples
    --------
    ``compare(flexcam.run(case), flexcam.run(case, rigid=True), "valve", 3000.0).peak_deviation``
    """
    count = len(flexible.time)
    if not np.array_equal(flexible.time, rigid.time[:count]):
        why = "the results are compared instant by instant"
        raise refuse("responses", "responses at different instants", "the same instants", why)
    moved, still = scalar_history(flexible, probe), rigid[probe]
    lift = value_range(rigid.time, still.displacement, still.velocity)
    if lift == 0.0:
        why, remedy = "it does not move in the other result", "add a follower's point to output.probes"
        raise refuse("probe", repr(probe), "a point that the cam moves", why, remedy)
    found = [_compute_deviation(name, moved, still, flexible) for name in ("displacement", "velocity", "acceleration")]
    return Comparison(probe, speed_rpm, lift, (found[0], found[1], found[2]), flexible.status)


def compare_responses(
    one: Response, other: Response, probe: str, speed_rpm: float, names: tuple[str, str]
) -> Comparison:
    """Compare two responses over their common time, at the instants of the first."""
    first, last = max(one.time[0], other.time[0]), min(one.time[-1], other.time[-1])
    times = one.time[(one.time >= first) & (one.time <= last)]
    if len(times) < _MIN_INSTANTS:
        raise refuse("responses", "no time in common", "runs that overlap", "results are compared instant by instant")
    both = one.at(times), other.at(times)
    if np.abs(both[0].angle - both[1].angle).max() > _SAME_ANGLE:
        raise refuse("responses", "the cam at different angles", "runs at one speed", "times are compared")
    return replace(compare(*both, probe, speed_rpm), names=names)


def _compute_deviation(quantity: str, moved: History, still: History, flexible: Response) -> Deviation:
    time = flexible.time
    (flexed, flexing), (rigid, turning) = (_values_and_slopes(one, quantity, len(time)) for one in (moved, still))
    difference = flexed - rigid
    largest, at = peak(time, difference, None if flexing is None or turning is None else flexing - turning)
    return Deviation(
        quantity,
        peak=largest,
        rms=float(np.sqrt(np.mean(difference**2))),
        rigid_peak=peak(time, rigid, turning)[0],
        flexible_peak=peak(time, flexed, flexing)[0],
        angle_deg=float(np.degrees(np.interp(at, time, flexible.angle))),
    )


def _values_and_slopes(history: History, quantity: str, count: int) -> tuple[FloatArray, FloatArray | None]:
    """Return the first `count` values of a quantity, and their slopes if the dense output has them."""
    slopes: FloatArray | None = getattr(history, SLOPES[quantity]) if quantity in SLOPES else None
    return getattr(history, quantity)[:count], None if slopes is None else slopes[:count]


Norm = Literal["max", "rms"]
"""Norm of the difference of two histories: maximum or root mean square."""

_MOTIONS = {"lift": "displacement", "velocity": "velocity", "acceleration": "acceleration"}
_UNITS = {"lift": "m", "velocity": "m/s", "acceleration": "m/s^2"}


@dataclass(frozen=True, eq=False)
class Histories:
    """Histories of a run by quantity, at common instants."""

    time: FloatArray  #: instants, s, shape (m,)
    #: history by quantity, SI, shape (m,): ``lift``, ``velocity`` and ``acceleration`` of the probe, ``force NAME`` of
    #: every contact
    values: Mapping[str, FloatArray]
    #: rate of a quantity that is cubic between two instants, by name, shape (m,); other quantities are linear there
    slopes: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])

    def unit(self, quantity: str) -> str:
        """Return the SI unit of a quantity."""
        return _UNITS.get(quantity, "N")

    def size(self, quantity: str) -> float:
        """Return the maximum absolute value of a quantity; for the lift its range, unless it is constant."""
        history = self.time, self.values[quantity], self.slopes.get(quantity)
        moved = value_range(*history) if quantity == "lift" else 0.0
        return moved or peak(*history)[0]


def scalar_history(response: Response, probe: str) -> History:
    """Return the history of a scalar probe."""
    history = response[probe]
    if history.displacement.ndim != 1:
        raise refuse("probe", repr(probe), "one scalar: " + ", ".join(f"{probe}.{c}" for c in history.components))
    return history


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
    step, shorter = (float(np.ptp(part.time)) / max(len(part.time) - 1, 1) for part in (coarse, fine))
    every = max(round(step / shorter), 1) if shorter > 0.0 else 1
    count = min(len(coarse.time), (len(fine.time) - 1) // every + 1)
    if np.abs(fine.time[::every][:count] - coarse.time[:count]).max(initial=0.0) > _INSTANT_TOLERANCE * step:
        raise refuse("responses", "instants that differ", "one step a multiple of the other")
    found: dict[str, float] = {}
    for name in (name for name in coarse.values if name in fine.values):
        difference = fine.values[name][::every][:count] - coarse.values[name][:count]
        if select_norm(name, norm) == "max":
            found[name] = _maximum_difference(fine, coarse, name, difference)
        else:
            found[name] = float(np.sqrt(np.mean(difference**2))) if count else 0.0
    return found


def _maximum_difference(fine: Histories, coarse: Histories, name: str, difference: FloatArray) -> float:
    """Return the maximum difference of a quantity, given the difference at common instants."""
    found = max(float(np.abs(difference).max(initial=0.0)), abs(fine.size(name) - coarse.size(name)))
    slopes = coarse.slopes.get(name)
    if slopes is None or len(coarse.time) < _MIN_INSTANTS:
        return found
    both = fine.time <= coarse.time[-1]
    values, rates = coarse.values[name][:, None], slopes[:, None]
    between = Series(values, rates, np.zeros_like(rates)).interpolate(coarse.time, fine.time[both]).displacement[:, 0]
    return max(found, float(np.abs(fine.values[name][both] - between).max(initial=0.0)))


MODELS = ("rigid", "bilateral", "unilateral")


@dataclass(frozen=True)
class ForceRange:
    """Contact force of one model at one speed, on the main lift in the last revolution."""

    least: float  #: minimum, N
    largest: float  #: maximum, N


@dataclass(frozen=True)
class SpeedResult:
    """Contact forces of the models at one speed."""

    rpm: float  #: camshaft speed, rpm
    #: forces by model: ``rigid``, ``bilateral``, ``unilateral``; None if the run did not reach its end
    forces: Mapping[str, ForceRange | None]


def compare_models_over_speed(
    case: Case, speeds: Sequence[float], *, contact: str | None = None, advance: ProgressCallback | None = None
) -> list[SpeedResult]:
    """Run a case over speeds with a rigid train, a bilateral contact and a unilateral contact."""
    model = prepare(case).model
    known = [name for name, one in model.contacts.items() if isinstance(one, CamContact) and one.unilateral]
    if not known or (contact is not None and contact not in known):
        given = "no unilateral contact" if contact is None else repr(contact)
        raise refuse("contacts", given, f"one of {', '.join(known)}" if known else "a unilateral contact")
    chosen, found = contact or known[0], list[SpeedResult]()
    for speed in track_progress(speeds, advance):
        one = case.at_speed(speed)
        rigid, free = prepare(one, rigid=True), prepare(one)
        still = _force_range(_solve_run(rigid, len(speeds)), free, chosen)
        forces: dict[str, ForceRange | None] = {"rigid": still}
        held = _with_bilateral_contact(free, chosen, still.largest if still else 0.0)
        for name, ready in (("bilateral", held), ("unilateral", free)):
            forces[name] = _force_range(_solve_run(ready, len(speeds)), free, chosen)
        found.append(SpeedResult(speed / RPM, forces))
    return found


def divergence_speed(found: Sequence[SpeedResult], first: str, second: str, tolerance: float = 0.05) -> float | None:
    """Return the lowest speed, rpm, at which two models differ by more than a fraction of the force; None if never."""
    for result in found:
        one, other = result.forces[first], result.forces[second]
        if one is None or other is None:
            return result.rpm
        size = max(one.largest, other.largest)
        if max(abs(one.largest - other.largest), abs(one.least - other.least)) > tolerance * size:
            return result.rpm
    return None


def _solve_run(ready: PreparedRun, runs: int) -> Response:
    """Return one of several runs; an interruption stops all of them."""
    response = solve(replace(ready.problem, runs=runs), ready.scheme)
    reraise_interrupt(response.status)
    return response


def _force_range(response: Response, ready: PreparedRun, contact: str) -> ForceRange | None:
    if not response.status.ok:
        return None
    model = ready.model
    cam = model.cam_contacts[contact].cam
    lifted = response.latest(ready.revolution) & (model.cams[cam].event(response.angle) > main_lift(model, cam))
    force: FloatArray = response.channels[f"contacts.{contact}.force"][lifted]
    return ForceRange(float(force.min()), float(force.max()))


def _with_bilateral_contact(ready: PreparedRun, contact: str, force: float) -> PreparedRun:
    """Return the same train with a bilateral contact."""
    part = ready.model.contacts[contact]
    if not isinstance(part, CamContact):
        raise refuse("contacts", repr(contact), "a contact with a stiffness")
    stiffness = part.stiffness
    if stiffness is None:  # the secant stiffness of the Hertz contact at full lift
        cam = ready.model.cams[part.cam]
        line = hertz_line(build_structure(ready.model), contact, part, cam)
        width, give, rest, reference, _, limit = line.law().constants
        limit *= float(line.radius(np.array([event_extremes(cam.event)[1].at]), 0)[0])
        depth = np.geomspace(1e-8, 1e-4, 400)
        there = [width * line_load(x, limit, give, rest, reference)[0] for x in depth.tolist()]
        stiffness = force / float(np.interp(force, there, depth))
    held = replace(part, unilateral=False, stiffness=stiffness, restitution=None)
    model = replace(ready.model, contacts={**ready.model.contacts, contact: held})
    system = build_system(model, ready.case.speed)
    start = equilibrium(system, ready.problem.drive)
    return replace(ready, model=model, problem=replace(ready.problem, system=system, start=start))
