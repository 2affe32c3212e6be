"""The scalars of a run: what a sweep keeps of a variant, each by a stable name, in SI.

``probes.POINT.SERIES.largest`` (of a component: ``probes.POINT.COMPONENT.SERIES.largest``) is the largest absolute
displacement, velocity or acceleration in the last revolution; ``deviation.peak`` and ``deviation.rms`` are those of the
whole run from the rigid train at the default probe, as parts of the lift; ``energy.residual.largest`` is what does not
add up. All others are the figures of `flexcam.train.operation`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flexcam.checks import InputError
from flexcam.fidelity import compare
from flexcam.integrate import carried_by_cam, outline
from flexcam.io.csv import component_unit
from flexcam.io.vtkhdf import SERIES
from flexcam.response import Response
from flexcam.runner import Prepared, scalar_probe
from flexcam.train import Figure, build_rigid, operation
from flexcam.units import RPM


def scalars_of(ready: Prepared, response: Response) -> list[Figure]:
    """Return the scalars of a run.

    Parameters
    ----------
    ready
        A case made ready to run.
    response
        Of its run.

    Returns
    -------
    list
        Names, values and units; a number that is not finite is left out.

    Examples
    --------
    ``scalars_of(ready, solve(ready.problem, ready.scheme))[0].name``
    """
    figures = [
        *operation(ready.model, response, ready.revolution),
        *_motions(response, ready.revolution),
        *_deviations(ready, response),
        *_residual(response),
    ]
    return [figure for figure in figures if np.isfinite(figure.value)]


def _motions(response: Response, period: float) -> Iterator[Figure]:
    """Yield the largest motions of every probe's components in the last revolution."""
    last = response.latest(period)
    for probe, components in response.outline.probes:
        for component in components:
            name = probe if len(components) == 1 else f"{probe}.{component}"
            history = response[name]
            for series, unit in SERIES.items():
                largest = float(np.abs(getattr(history, series)[last]).max(initial=0.0))
                yield Figure(f"probes.{name}.{series}.largest", largest, component_unit(component, unit))


def _deviations(ready: Prepared, response: Response) -> Iterator[Figure]:
    """Yield how far the default probe strays from the rigid train, where there is one that moves it."""
    if ready.case.record.fidelity.model == "rigid" or not ready.case.record.output.probes:
        return
    try:
        found = compare(response, _rigid(ready, response), scalar_probe(ready), ready.case.speed / RPM)
    except InputError:
        return
    yield Figure("deviation.peak", found.peak_deviation, "1")
    yield Figure("deviation.rms", found.rms_deviation, "1")


def _rigid(ready: Prepared, response: Response) -> Response:
    """Return the rigid train's motion at the instants of a response."""
    rigid, motion = build_rigid(ready.model, ready.case.speed), ready.problem.drive.at(response.time)
    return replace(response, outline=outline(rigid), probes=carried_by_cam(rigid, motion))


def _residual(response: Response) -> Iterator[Figure]:
    if "energy.residual" in response.channels:
        residual = response.channels["energy.residual"]
        yield Figure("energy.residual.largest", float(np.abs(residual).max(initial=0.0)), "J")
