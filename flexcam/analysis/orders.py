"""Orders of a response: harmonics of the camshaft rotation in the last revolution of a run, over speed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.preparation import PreparedRun, prepare
from flexcam.cams import OrderSpectrum, order_spectrum
from flexcam.case.case import Case
from flexcam.case.problem_builder import DEFAULT_STEPS_PER_REVOLUTION
from flexcam.core import FloatArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.core.units import RPM
from flexcam.dynamics import (
    ProgressCallback,
    Response,
    RunFailedError,
    Status,
    component_unit,
    reraise_interrupt,
    scalar_history,
    solve,
    track_progress,
)

_REVOLUTION = 2.0 * math.pi
_SAME_ANGLE = 1e-9  # tolerance of the start of a revolution, relative to a revolution (rounding)


@dataclass(frozen=True)
class Signal:
    """History of a run."""

    #: name of a channel, such as ``contacts.intake.force``, or of a scalar probe, such as ``valve`` or ``cam.uy``
    name: str
    probe: bool = False  #: whether it is a probe, whose acceleration is used

    def of(self, response: Response) -> FloatArray:
        """Return the history, SI, shape (steps + 1,)."""
        if not self.probe:
            known = response.channels
            if self.name not in known:
                near = suggest_name(self.name, known)
                raise refuse("--channel", repr(self.name), f"one of {', '.join(known)}", "", near)
            return known[self.name]
        return scalar_history(response, self.name).acceleration

    def unit(self, response: Response) -> str:
        """Return the unit of the history."""
        if not self.probe:
            return dict(response.outline.channels)[self.name]
        return component_unit(response[self.name].components[0], "m/s^2")


@dataclass(frozen=True, eq=False)
class Waterfall:
    """Orders of one history over speed."""

    signal: Signal  #: history
    unit: str  #: its unit; empty if no run reached its end
    rpm: FloatArray  #: camshaft speeds, shape (m,)
    #: amplitudes from order 0 (absolute mean), in the unit, shape (m, count + 1); NaN if a run did not reach its end
    amplitudes: FloatArray
    gaps: FloatArray  #: difference between start and end of the revolution, in the unit, shape (m,); NaN as above
    statuses: tuple[Status, ...]  #: status of every run


def last_revolution_orders(response: Response, values: FloatArray, count: int) -> OrderSpectrum:
    """Return the orders of a history in the last revolution of a run."""
    begin = _revolution_start(response)
    steps, highest = len(response.angle) - begin - 1, highest_order(response)
    if count > highest:
        given, allowed = f"{count} of a last revolution of {steps} steps", f"up to {highest}" if highest else "none"
        remedy = f"use {2 * count + 1} steps per revolution or more"
        raise refuse("orders", given, allowed, _MIN_STEPS_REASON, remedy)
    return order_spectrum(response.angle[begin:], values[begin:], count)


_MIN_STEPS_REASON = "each order needs two steps"  # and the mean one more


def has_revolution(response: Response) -> bool:
    """Return whether a run lasts at least one camshaft revolution."""
    angle = response.angle
    return len(angle) > 1 and float(angle[-1] - angle[0]) >= _REVOLUTION * (1.0 - _SAME_ANGLE)


def highest_order(response: Response) -> int:
    """Return the highest order resolved by the steps of the last revolution."""
    return max((len(response.angle) - _revolution_start(response)) // 2 - 1, 0) if has_revolution(response) else 0


def _revolution_start(response: Response) -> int:
    if not has_revolution(response):
        turned = math.degrees(float(np.ptp(response.angle))) if len(response.angle) else 0.0
        allowed, why = "one revolution or more", "orders are those of a whole revolution"
        raise refuse("run.revolutions", f"a run over {turned:.4g} deg", allowed, why)
    begins = float(response.angle[-1]) - _REVOLUTION * (1.0 + _SAME_ANGLE)
    return int(np.searchsorted(response.angle, begins))


def waterfall(
    case: Case, speeds: Sequence[float], signals: Sequence[Signal], count: int,
    *, advance: ProgressCallback | None = None,
) -> list[Waterfall]:  # fmt: skip
    """Return the orders of histories over speed."""
    _check_steps(case, max(speeds), count)
    rpm = np.array(speeds) / RPM
    missing = OrderSpectrum(np.full(count + 1, complex(math.nan)), math.nan)
    orders: dict[Signal, list[OrderSpectrum]] = {signal: [] for signal in signals}
    statuses: list[Status] = []
    units: dict[Signal, str] = {}
    for run in run_over_speeds(case, speeds, advance):
        statuses.append(run if isinstance(run, Status) else run[1].status)
        for signal, spectra in orders.items():
            if isinstance(run, Status) or not run[1].status.ok:
                spectra.append(missing)
                continue
            spectra.append(last_revolution_orders(run[1], signal.of(run[1]), count))
            units[signal] = signal.unit(run[1])
    return [
        Waterfall(
            signal, units.get(signal, ""), rpm, np.array([spectrum.amplitudes for spectrum in spectra]),
            np.array([spectrum.gap for spectrum in spectra]), tuple(statuses),
        )
        for signal, spectra in orders.items()
    ]  # fmt: skip


def _check_steps(case: Case, fastest: float, count: int) -> None:
    """Raise an error before the first run if fixed steps are too few for the orders; adaptive ones are checked then."""
    run, needed = case.record.run, 2 * count + 1
    turn = _REVOLUTION / fastest
    steps = math.floor(turn / run.step) if run.step else run.steps_per_revolution or DEFAULT_STEPS_PER_REVOLUTION
    if run.adaptive is not None or steps >= needed:
        return
    fewer = f"or ask for {(steps - 1) // 2} orders at most (--orders)" if steps >= 3 else ""
    if run.step:
        at = f"{fastest / RPM:.6g} camshaft rpm"
        allowed = f"{0.995 * turn / needed:.3g} s or less for {count} orders"  # rounded down to three digits
        given, key, remedy = f"{run.step:.6g} s, {steps} steps per revolution at {at}", "step", "use shorter steps"
    else:
        given, key, remedy = str(steps), "steps_per_revolution", "use more steps"
        allowed = f"{needed} or more for {count} orders"
    raise refuse(case.place(("run", key)), given, allowed, _MIN_STEPS_REASON, ", ".join(filter(None, (remedy, fewer))))


def run_over_speeds(
    case: Case, speeds: Sequence[float], advance: ProgressCallback | None = None
) -> Iterator[tuple[PreparedRun, Response] | Status]:
    """Yield the prepared case and its response at every speed, or the status of a run that cannot start."""
    for speed in track_progress(speeds, advance):
        try:
            ready = prepare(case.at_speed(speed))
        except RunFailedError as failure:
            reraise_interrupt(failure.status)
            yield failure.status
            continue
        response = solve(replace(ready.problem, runs=len(speeds)), ready.scheme, save=ready.save)
        reraise_interrupt(response.status)
        yield ready, response


def largest_orders(found: Waterfall, count: int = 3) -> Mapping[int, tuple[float, float]]:
    """Return the orders with the largest amplitudes over all speeds, without the mean."""
    if np.isnan(found.amplitudes).all():
        return {}
    peaks = np.nanmax(found.amplitudes[:, 1:], axis=0)
    largest: list[int] = (np.argsort(-peaks, kind="stable")[:count] + 1).tolist()
    index = {n: int(np.nanargmax(found.amplitudes[:, n])) for n in largest}
    return {n: (float(found.rpm[i]), float(found.amplitudes[i, n])) for n, i in index.items()}
