"""Speed limits of a train (loss of contact, valve bounce, coil clash, buckling).

A limit is a condition on a run at one speed. The lowest speed of a series that meets it is bisected; the next ones show
in which bands it is met. The series consists of the ends of the range and of speeds that are the same for every range.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flexcam.analysis.preparation import PreparedRun, build_problem, prepare
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse
from flexcam.core.units import RPM, format_quantity, shaft_speed
from flexcam.dynamics import ProgressCallback, Response, SaveAt, reraise_interrupt, solve, track_progress
from flexcam.valvetrain import (
    BOUNCE_HEIGHT,
    OPEN,
    Model,
    Seat,
    main_lift,
    separation_by_flank,
    spring_held_contacts,
    valve_loft,
    valve_ratio,
    valve_seating,
)

# revolutions of a run: the first is a transient, and just above a limit contact is lost in some of them only
_REVOLUTIONS = 6.0
_ROUNDING = 1e-6  # relative tolerance of a time at the end of a revolution

LIMITS = ("loss_of_contact", "float", "bounce", "coil_clash", "buckling")
"""Names of the limits."""

SPACING = 0.05
"""Relative distance of the examined speeds; narrower ranges of speed that meet a condition may be missed."""

_SPEEDS_ABOVE = 3  # number of speeds above a limit at which its condition is examined again

_NEARBY = -0.007, -0.003, 0.003, 0.007
"""Relative distances from a limit of further speeds: hopping contacts are chaotic, and a limit then is a range."""


@dataclass(frozen=True)
class Search:
    """Range and tolerance of a search for limits."""

    #: `lowest`, `highest`: camshaft speeds of the range, rad/s
    lowest: float
    highest: float
    tolerance: float = RPM  #: width of the bracket, rad/s
    #: minimum height of a bounce above the seat, m; None for the smaller of 0.1 mm and 2 % of the lift
    bounce_height: float | None = None
    #: loft of the valve over the nose, m: its lift above that of the rigid train; None for no such limit
    lift_deviation: float | None = None
    #: cut-off frequency, Hz, of the contact force for a second verdict on contact loss; None for no such limit
    low_pass: float | None = None
    spacing: float = SPACING  #: relative distance of the speeds evaluated before the bracket is bisected
    nearby: bool = False  #: whether further speeds near a limit show its uncertainty

    def __post_init__(self) -> None:
        positive("lowest", self.lowest, "rad/s")
        positive("tolerance", self.tolerance, "rad/s")
        for name, unit in (("lift_deviation", "m"), ("low_pass", "Hz")):
            if (value := getattr(self, name)) is not None:
                positive(name, value, unit)
        if not self.highest > self.lowest:
            raise refuse("highest", f"{self.highest / RPM:g} rpm", f"a speed above {self.lowest / RPM:g} rpm")

    def speeds(self) -> list[float]:
        """Return the ends of the range and the powers of ``1 + spacing`` between them, rad/s."""
        step = math.log1p(self.spacing)
        first, last = math.floor(math.log(self.lowest) / step), math.ceil(math.log(self.highest) / step)
        return [self.lowest, *((1.0 + self.spacing) ** k for k in range(first + 1, last)), self.highest]


@dataclass(frozen=True)
class Limit:
    """Speed limit."""

    #: camshaft speed, rpm; None if the condition is not met up to the highest speed of the range, or is not known
    rpm: float | None
    tolerance_rpm: float  #: width of the bracket, rpm
    words: str  #: description of the event, and in brackets the contact, seat, spring or member
    #: lowest and highest speed, rpm, of each band of examined speeds that meet the condition, from `rpm` on; None for
    #: the highest speed of a band that includes the last examined one
    bands_rpm: tuple[tuple[float, float | None], ...] = ()
    examined_rpm: float | None = None  #: last of these speeds, rpm, about 20 % above the limit
    known: bool = True  #: false if a run failed before the condition was met within the range
    #: lowest examined speed near the limit that meets the condition, and the highest one that does not, at least `rpm`;
    #: rpm, None if the condition does not come and go
    scatter_rpm: tuple[float, float] | None = None


@dataclass(frozen=True)
class Limits:
    """Speed limits of a train."""

    #: limits by name: ``loss_of_contact``, ``float``, ``bounce``, ``coil_clash``, ``buckling``
    limits: Mapping[str, Limit]
    #: `lowest_rpm`, `highest_rpm`: camshaft speeds of the search range
    lowest_rpm: float
    highest_rpm: float

    @property
    def first(self) -> str | None:
        """Name of the lowest limit; None if no limit is met."""
        speeds = {name: limit.rpm for name, limit in self.limits.items() if limit.rpm is not None}
        return min(speeds, key=lambda name: speeds[name]) if speeds else None


Condition = Callable[[Response, PreparedRun], list[str]]
"""Function that returns the names of the parts that meet a condition."""
ConditionResults = dict[str, list[str]] | str
"""Affected parts by condition, or the reason why there are none."""
SpeedRuns = Callable[[Sequence[float]], list[Callable[[], ConditionResults]]]
"""Function that begins runs at some camshaft speeds, rad/s, and returns functions that wait for their results."""


def find_limits(
    case: Case, search: Search, among: Collection[str] | None = None,
    *, runs: int = 1, start: SpeedRuns | None = None, ahead: int = 1, advance: ProgressCallback | None = None,
) -> Limits:  # fmt: skip
    """Find the speeds of loss of contact, float, valve bounce, coil clash and pushrod buckling, or some of them.

    `start` begins runs at several speeds at a time, up to `ahead`; by default they follow each other. Runs
    that a limit needs begin first; free processes run the later speeds of the limit that names the most.
    """
    conditions = _conditions(_checked_model(case), search).items()
    described = {name: words for name, (_, words) in conditions if among is None or name in among}
    start = start or (lambda speeds: [partial(evaluate_speed, case, search, speed, runs=runs) for speed in speeds])
    pending: dict[float, Callable[[], ConditionResults]] = {}
    done: dict[float, ConditionResults] = {}
    limits: dict[str, Limit] = {}
    searches = {name: _bisect_limit(name, words, search) for name, words in described.items()}
    queues = {name: next(generator) for name, generator in searches.items()}
    while queues:
        needed = [speed for speed in dict.fromkeys(speeds[0] for speeds in queues.values()) if speed not in done]
        begun = [speed for speed in needed if speed not in pending]
        later = [speed for speed in max(queues.values(), key=len)[1:] if speed not in pending and speed not in begun]
        begun += later[: max(ahead - len(begun) - len(pending.keys() - done.keys()), 0)]
        pending.update(zip(begun, start(begun), strict=True))
        for speed in track_progress([speed for speed in pending if speed in needed][:1], advance):
            done[speed] = pending[speed]()
        for name, speeds in list(queues.items()):
            if speeds[0] not in done:
                continue
            try:
                queues[name] = searches[name].send(done[speeds[0]])
            except StopIteration as end:
                limits[name] = end.value
                del queues[name]
    return Limits({name: limits[name] for name in described}, search.lowest / RPM, search.highest / RPM)


def evaluate_speed(case: Case, search: Search, speed: float, *, runs: int = 1) -> ConditionResults:
    """Run a case at a camshaft speed, rad/s, and return which parts meet the conditions of the limits."""
    variant = case.at_speed(speed, _REVOLUTIONS)
    if case.record.run.start == "periodic":  # the first revolution does not count, and above a limit none may exist
        variant = variant.with_run({"start": "equilibrium"})
    ready = prepare(variant)
    system = ready.problem.system
    names = {f"contacts.{name}.force" for name in ready.model.cam_contacts} | {
        f"contacts.{name}.{quantity}" for name, part in ready.model.contacts.items() if isinstance(part, Seat)
        for quantity in ("gap", "velocity")
    }  # fmt: skip
    used = tuple(c for c in system.channels if c.name in names or c.name.endswith((".clash", ".buckling_use")))
    problem = replace(ready.problem, system=replace(system, channels=used, probes=()), runs=runs * len(search.speeds()))
    response = solve(problem, ready.scheme, save=SaveAt(field_every=problem.steps, energies=False))
    reraise_interrupt(response.status)
    if not response.status.ok:
        return f"the run at {shaft_speed(speed, case.turns)} ended: {response.status.text}"
    return {name: condition(response, ready) for name, (condition, _) in _conditions(ready.model, search).items()}


def applicable_limits(case: Case) -> tuple[str, ...]:
    """Return the names of the limits that apply to a case."""
    return tuple(_conditions(_checked_model(case)))


def _checked_model(case: Case) -> Model:
    """Return the model of a case; raise an error if no limit applies to it."""
    model = build_problem(case)[0]
    if not _conditions(model):
        allowed = "a unilateral contact, a seat, a member, or a spring with clash_travel or coils"
        raise refuse("contacts", "no part that has a limit", allowed)
    return model


Speeds = Sequence[float]
"""Speed at which a search needs a run, followed by those at which it probably needs one later, rad/s."""


def _bisect_limit(name: str, words: str, search: Search) -> Generator[Speeds, ConditionResults, Limit]:
    """Return the lowest speed of the search that meets a condition, bisected toward the speed below it.

    The generator receives the result of the run at the first of the speeds that it yields.
    """
    width = search.tolerance / RPM
    low, parts, speeds = 0.0, list[str](), search.speeds()
    for number, high in enumerate(speeds):
        answers = yield speeds[number:]
        if isinstance(answers, str):
            return Limit(None, width, f"{words}: not known above this speed; {answers}", known=False)
        if parts := answers[name]:
            break
        low = high
    else:
        return Limit(None, width, f"not reached up to the highest speed of the search; criterion: {words}")
    above, examined, failed_above = yield from _bands(name, high, search)
    low, failure = low or high, ""
    while high - low > search.tolerance:
        middle = 0.5 * (low + high)
        answers = yield middle, 0.5 * (low + middle), 0.5 * (middle + high)
        if isinstance(answers, str):
            failure = f"; {answers}"
            break
        if answers[name]:
            high, parts = middle, answers[name]
        else:
            low = middle
    (_, end), *others = above
    bands = ((high / RPM, end), *others)
    if low == high:
        words = f"{words} ({', '.join(parts)}): already at the lowest speed of the search"
        return Limit(high / RPM, math.inf, f"{words}{failed_above}", bands, examined)
    limit = Limit(
        high / RPM, (high - low) / RPM, f"{words} ({', '.join(parts)}){failure or failed_above}", bands, examined
    )
    return replace(limit, scatter_rpm=(yield from _scatter(name, low, high))) if search.nearby else limit


def _scatter(name: str, low: float, high: float) -> Generator[Speeds, ConditionResults, tuple[float, float] | None]:
    """Return the speeds, rpm, between which a condition comes and goes near a limit; None if it only begins there."""
    met, unmet = [high], [low]
    speeds = [(1.0 + part) * high for part in _NEARBY]
    for number, speed in enumerate(speeds):
        answers = yield speeds[number:]
        if not isinstance(answers, str):
            (met if answers[name] else unmet).append(speed)
    return (min(met) / RPM, max(*unmet, high) / RPM) if min(met) < max(unmet) else None


def _bands(
    name: str, first: float, search: Search
) -> Generator[Speeds, ConditionResults, tuple[list[tuple[float, float | None]], float, str]]:
    """Examine some speeds above the first one that meets a condition.

    Return the bands in which it is met and the last examined speed, rpm, and the reason if a run failed.
    """
    bands: list[tuple[float, float | None]] = [(first / RPM, None)]
    previous, number = first / RPM, math.floor(math.log(first) / math.log1p(search.spacing) + _ROUNDING)
    speeds = [(1.0 + search.spacing) ** k for k in range(number + 1, number + 1 + _SPEEDS_ABOVE)]
    for k, speed in enumerate(speeds):
        answers = yield speeds[k:]
        if isinstance(answers, str):
            return bands, previous, f"; {answers}"
        begin, end = bands[-1]
        if answers[name] and end is not None:
            bands.append((speed / RPM, None))
        elif not answers[name] and end is None:
            bands[-1] = begin, previous
        previous = speed / RPM
    return bands, previous, ""


_ANY_SEARCH = Search(1.0, 2.0)
_RELATIVE_BOUNCE_HEIGHT = 0.02  # bounce height relative to the lift, which is the smaller limit for lifts up to 5 mm


def _conditions(model: Model, search: Search = _ANY_SEARCH) -> dict[str, tuple[Condition, str]]:
    conditions: dict[str, tuple[Condition, str]] = {}
    lifts = [format_quantity("m", main_lift(model, name), digits=3) for name in model.cams]
    loss = f"the follower leaves its cam for over {math.degrees(OPEN):g} deg"
    if spring_held_contacts(model):
        lifted = f"above {' or '.join(dict.fromkeys(lifts))} of lift"
        conditions["loss_of_contact"] = (_open_contacts, f"{loss} {lifted}")
        conditions["float"] = (_floating_contacts, f"{loss} over the nose")
        if (cutoff := search.low_pass) is not None:
            zero = f"is zero for over {math.degrees(OPEN):g} deg {lifted}"
            words = f"the cam force, low-pass filtered at {cutoff:g} Hz, {zero}"
            conditions["filtered_loss"] = (lambda response, ready: _filtered_contacts(response, ready, cutoff), words)
    if any(isinstance(part, Seat) for part in model.contacts.values()):
        heights = [valve_ratio(model, name) * cam.event.height for name, cam in model.cams.items()]
        default = min(BOUNCE_HEIGHT, _RELATIVE_BOUNCE_HEIGHT * max(heights, default=math.inf))
        height = default if search.bounce_height is None else search.bounce_height
        words = f"the valve leaves its seat again by more than {format_quantity('m', height)}"
        conditions["bounce"] = (lambda response, ready: _bouncing_seats(response, ready, height), words)
        if (deviation := search.lift_deviation) is not None:
            words = f"over the nose the valve lifts more than {format_quantity('m', deviation)} above the rigid train"
            conditions["lift_deviation"] = (lambda response, ready: _lofted_valves(response, ready, deviation), words)
    if any(spring.clash_travel is not None for spring in model.springs.values()):
        conditions["coil_clash"] = (partial(_parts_above, ".clash", 0.0), "coils of a spring touch")
    if model.members:
        words = "the compression of a member exceeds its buckling load"
        conditions["buckling"] = (partial(_parts_above, ".buckling_use", 1.0), words)
    return conditions


def _open_contacts(response: Response, ready: PreparedRun) -> list[str]:
    """Return the contacts that are open on the main lift, with the parts of the lift."""
    contacts: dict[str, list[str]] = {}
    for name, angles in _separations(response, ready):
        if sum(angles.values()) > OPEN:
            contacts.setdefault(name, []).extend(flank for flank, angle in angles.items() if angle > 0.0)
    return [f"{name}, {' and '.join(dict.fromkeys(flanks))}" for name, flanks in contacts.items()]


def _floating_contacts(response: Response, ready: PreparedRun) -> list[str]:
    return list(dict.fromkeys(name for name, angles in _separations(response, ready) if angles["nose"] > OPEN))


def _separations(response: Response, ready: PreparedRun) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the contacts that springs hold with the cam angle of contact loss by flank, in every revolution."""
    for revolution in _revolutions(response, ready):
        for name in spring_held_contacts(ready.model):
            yield name, separation_by_flank(ready.model, response, name, revolution)


def _revolutions(response: Response, ready: PreparedRun) -> Iterator[NDArray[np.bool_]]:
    """Yield the instants of every revolution but the first."""
    numbers = np.ceil((response.time - response.time[0]) / ready.revolution - _ROUNDING)
    return (numbers == k for k in range(2, int(numbers[-1]) + 1))


def _bouncing_seats(response: Response, ready: PreparedRun, height: float) -> list[str]:
    """Return the seats whose valve rises again after closing and before the next lift."""
    seats: list[str] = []
    for revolution, (name, contact) in product(_revolutions(response, ready), ready.model.contacts.items()):
        if isinstance(contact, Seat) and name not in seats:
            closing = valve_seating(ready.model, response, name, revolution)
            gap = float(response.channels[f"contacts.{name}.gap"][revolution].max())
            if closing.height > height if closing else gap > height:  # or the valve never closes
                seats.append(name)
    return seats


def _lofted_valves(response: Response, ready: PreparedRun, limit: float) -> list[str]:
    """Return the seats whose valve rises above the lift of the rigid train over the nose."""
    seats = {name: part for name, part in ready.model.contacts.items() if isinstance(part, Seat)}
    lofts = (
        (name, valve_loft(ready.model, response, name, seat, revolution))
        for revolution in _revolutions(response, ready)
        for name, seat in seats.items()
    )
    return list(dict.fromkeys(name for name, loft in lofts if loft is not None and loft > limit))


_FILTER_ORDER = 4
_VANISHED = 0.01  # fraction of its maximum below which a filtered force counts as zero: the filter rings


def _filtered_contacts(response: Response, ready: PreparedRun, cutoff: float) -> list[str]:
    """Return the contacts that are open on the main lift by their force after a Butterworth low pass without phase."""
    from scipy.signal import butter, sosfiltfilt

    begin, end = float(response.time[0]), float(response.time[-1])
    time: FloatArray = np.linspace(begin, end, len(response.time))
    rate = (len(time) - 1) / (end - begin)
    channels: dict[str, FloatArray] = dict(response.channels)
    if 2.0 * cutoff >= rate:
        speed = shaft_speed(ready.case.speed, ready.case.turns)
        given, allowed = f"{cutoff:g} Hz", f"a frequency below {0.5 * rate:g} Hz, half the steps per second at {speed}"
        raise refuse("low_pass", given, allowed, "", "raise run.steps_per_revolution")
    low_pass = butter(_FILTER_ORDER, cutoff, fs=rate, output="sos")
    for name in ready.model.cam_contacts:
        key = f"contacts.{name}.force"
        filtered: FloatArray = sosfiltfilt(low_pass, np.interp(time, response.time, channels[key]))
        force = np.interp(response.time, time, filtered)
        channels[key] = np.where(force < _VANISHED * force.max(), 0.0, force)
    return _open_contacts(replace(response, channels=channels), ready)


def _parts_above(end: str, threshold: float, response: Response, ready: PreparedRun) -> list[str]:
    """Return the parts with a channel of a given name above a threshold after the first revolution."""
    later = response.time - response.time[0] > ready.revolution
    channels = {name: values[later] for name, values in response.channels.items() if name.endswith(end)}
    return [name.split(".")[1] for name, values in channels.items() if float(values.max()) > threshold]
