"""The scalars of a run: what a sweep keeps of a variant, each by a stable name, in SI.

``probes.POINT.SERIES.largest`` (of a component: ``probes.POINT.COMPONENT.SERIES.largest``) is the largest absolute
displacement, velocity or acceleration in the last revolution, of the dense output; ``deviation.peak`` and
``deviation.rms`` are those of the whole run from the rigid train at the default probe, as parts of the lift;
``energy.residual.largest`` is what does not add up. All others are the figures of `flexcam.train.operation`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flexcam.case import Case
from flexcam.checks import InputError
from flexcam.fidelity import compare
from flexcam.integrate import carried_by_cam, outline
from flexcam.io.csv import component_unit
from flexcam.io.vtkhdf import SERIES
from flexcam.response import SLOPES, Response, peak
from flexcam.runner import Prepared, described, figures_of, scalar_probe
from flexcam.train import ANY_SPEED, Figure, build_rigid, operation_names
from flexcam.units import RPM


def scalars_of(ready: Prepared, response: Response) -> list[Figure]:
    """Return the scalars of a run."""
    figures = [
        *(figures_of(ready, response) if response.outline.channels else ()),
        *_motions(response, ready.revolution),
        *_deviations(ready, response),
        *_residual(response),
    ]
    return [figure for figure in figures if np.isfinite(figure.value)]


def of_motion(names: Sequence[str]) -> bool:
    """Tell whether scalars are all of the probes' motion, for which nothing else of a run is needed."""
    return bool(names) and all(name.partition(".")[0] in ("probes", "deviation") for name in names)


def scalar_names(case: Case) -> list[str]:
    """Return the names of all scalars that a run of a case may have, without running it."""
    model, system = described(case)
    named = outline(system)
    names = operation_names(model, [name for name, _ in named.channels])
    probes = [component for name, components in named.probes for component in _components(name, components)]
    names += [f"probes.{probe}.{series}.largest" for probe in probes for series in SERIES]
    compared = case.record.fidelity.model != "rigid" and bool(case.record.output.probes) and bool(model.driven)
    return [*names, *(_DEVIATIONS if compared else ()), *(() if system.carried else (_RESIDUAL,))]


_DEVIATIONS = ("deviation.peak", "deviation.rms")
_RESIDUAL = "energy.residual.largest"


def _components(probe: str, components: Sequence[str]) -> list[str]:
    """Return what the components of a probe are called; a probe of one has its own name."""
    return [probe] if len(components) == 1 else [f"{probe}.{component}" for component in components]


def _motions(response: Response, period: float) -> Iterator[Figure]:
    """Yield the largest motions of every probe's components in the last revolution."""
    last = response.latest(period)
    for probe, components in response.outline.probes:
        for component, name in zip(components, _components(probe, components), strict=True):
            history = response[name]
            for series, unit in SERIES.items():
                slopes = getattr(history, SLOPES[series])[last] if series in SLOPES else None
                largest, _ = peak(response.time[last], getattr(history, series)[last], slopes)
                yield Figure(f"probes.{name}.{series}.largest", largest, component_unit(component, unit))


def _deviations(ready: Prepared, response: Response) -> Iterator[Figure]:
    """Yield how far the default probe strays from the rigid train, where there is one that moves it."""
    if ready.case.record.fidelity.model == "rigid" or not ready.case.record.output.probes:
        return
    try:
        found = compare(response, _rigid(ready, response), scalar_probe(ready), ready.case.speed / RPM)
    except InputError:
        return
    for name, part in zip(_DEVIATIONS, (found.peak_deviation, found.rms_deviation), strict=True):
        yield Figure(name, part, "1")


def _rigid(ready: Prepared, response: Response) -> Response:
    """Return the rigid train's motion at the instants of a response."""
    rigid, motion = build_rigid(ready.model, ANY_SPEED), ready.problem.drive.at(response.time)
    return replace(response, outline=outline(rigid), probes=carried_by_cam(rigid, motion))


def _residual(response: Response) -> Iterator[Figure]:
    if "energy.residual" in response.channels:
        residual = response.channels["energy.residual"]
        yield Figure(_RESIDUAL, float(np.abs(residual).max(initial=0.0)), "J")
