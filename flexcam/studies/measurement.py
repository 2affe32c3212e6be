"""Measured curves: read from a file, and the same curves of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.analysis.model_choice import select_case
from flexcam.analysis.preparation import build_problem, prepare
from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, positive, refuse, suggest_name
from flexcam.core.units import conversion_factor
from flexcam.dynamics import SERIES, RunFailedError, SaveAt, Status, component_unit, outline, reraise_interrupt, solve
from flexcam.io.exports import scalar_probes
from flexcam.io.files import ABSCISSAS, find_abscissa, read_columns, read_mdf
from flexcam.studies.evaluation import Row, rejected_row
from flexcam.studies.executors import Variants
from flexcam.studies.plan import Bundle, open_case


@dataclass(frozen=True, eq=False)
class Curve:
    """Measured history of a channel or of a component of a probe."""

    label: str  #: name as in the heading of a file
    name: str  #: name of the channel or the component
    series: str  #: ``displacement``, ``velocity`` or ``acceleration``; empty for a channel
    unit: str  #: SI unit
    values: FloatArray  #: measured values, SI, shape (m,); NaN where missing
    noise: float | None = None  #: standard deviation of the noise, SI; estimated from the residuals if None


@dataclass(frozen=True, eq=False)
class Measurement:
    """Measured curves over time, or over the cam angle of one revolution."""

    over: Literal["angle", "time"]  #: abscissa
    instants: FloatArray  #: cam angles, rad, or times, s, shape (m,)
    curves: tuple[Curve, ...]  #: curves to be fitted

    def simulate(self, case: Case) -> FloatArray:
        """Return the curves of a run at the measured instants, shape (curves, m); angles are of the last revolution."""
        ready = prepare(select_case(case)[0])
        save = SaveAt(field_every=ready.problem.steps + 1, channels=any(not curve.series for curve in self.curves))
        response = solve(ready.problem, ready.scheme, save=save)
        if not response.status.ok:
            raise RunFailedError(response.status)
        times: FloatArray = self.instants
        if self.over == "angle":
            end = float(response.angle[-1])
            if end - response.angle[0] < 2.0 * math.pi * (1.0 - 1e-9):
                raise refuse(
                    "run.revolutions", case.record.run.revolutions, "1 or more", "an angle needs a full revolution"
                )
            turn = np.mod(self.instants - end + 1e-9, 2.0 * math.pi) - 1e-9
            turn[(turn < 1e-9) & (self.instants > self.instants.min() + math.pi)] = 2.0 * math.pi  # the end of it
            times = np.asarray(np.interp(end - 2.0 * math.pi + turn, response.angle, response.time), dtype=float)
        elif times.min() < response.time[0] or times.max() > response.time[-1]:
            given = f"times from {times.min():g} to {times.max():g} s"
            raise refuse("--to", given, f"times of the run, up to {response.time[-1]:g} s", "", "run more revolutions")
        order = np.argsort(times)
        seen = response.at(times[order])
        found = [getattr(seen[one.name], one.series) if one.series else seen.channels[one.name] for one in self.curves]
        return np.array(found)[:, np.argsort(order)]


def read_measurement(path: Path, case: Case, only: Sequence[str] = (), noises: Sequence[str] = ()) -> Measurement:
    """Read columns of a CSV or MDF file, all or those named; noises are ``NAME=VALUE`` in the unit of the column."""
    is_mdf = path.suffix.lower() in (".mf4", ".mdf")
    columns = read_mdf(path, "--to", only) if is_mdf else read_columns(path, "--to")
    over, instants = find_abscissa(columns, "--to")
    wanted = list(only) or [name for name in columns if name not in ABSCISSAS]
    if not wanted:
        raise refuse("--to", ", ".join(columns), f"{over} and a measured column")
    given = dict(_parse_noise(text) for text in noises)
    for option, names, known in (("--column", wanted, columns), ("--noise", given, wanted)):
        if unknown := [name for name in names if name not in known]:
            near = suggest_name(unknown[0], known)
            raise refuse(option, repr(unknown[0]), ", ".join(known), "there is no such column", near)
    curves: list[Curve] = []
    for name in wanted:
        curve, (unit, values) = _find_curve(case, name), columns[name]
        factor = conversion_factor(unit, curve.unit, f"--to, {name}")
        noise = positive("--noise", given[name] * factor, curve.unit) if name in given else None
        curves.append(replace(curve, values=values * factor, noise=noise))
    return Measurement("time" if over == "time" else "angle", instants, tuple(curves))


def _parse_noise(text: str) -> tuple[str, float]:
    name, _, size = text.partition("=")
    try:
        return name.strip(), float(size)
    except ValueError:
        allowed = "NAME=VALUE, a standard deviation in the unit of the column"
        raise refuse("--noise", repr(text), allowed, "", "write it as in 'valve displacement=0.005'") from None


def _find_curve(case: Case, name: str) -> Curve:
    """Return a curve without values by its name: a channel, or a component of a probe with its series."""
    named = outline(build_problem(case)[1])
    units = dict(named.channels)
    if name in units:
        return Curve(name, name, "", units[name], np.zeros(0))
    probes = scalar_probes(named)
    probe, _, series = name.rpartition(" ") if name.rpartition(" ")[2] in SERIES else (name, "", "displacement")
    if probe not in probes:
        known = [*(f"{one} {series}" for one in probes), *units]
        near = suggest_name(name, [*probes, *known])
        raise refuse("--to", repr(name), ", ".join(known), "the case has no other result", near)
    return Curve(f"{probe} {series}", probe, series, component_unit(probes[probe], SERIES[series]), np.zeros(0))


def evaluate_curves(
    source: Bundle | Path, variants: Variants, *, fixed: tuple[str, ...], measured: Measurement
) -> list[Row]:
    """Return rows with the curves of variants, in a worker."""
    file, rows = open_case(source), list[Row]()
    for overrides in variants:
        try:
            values = measured.simulate(file.read((*fixed, *overrides)))
            rows.append(Row(Status(), history=("curves", values.tobytes())))
        except InputError as refusal:
            rows.append(rejected_row(refusal))
        except RunFailedError as failure:
            reraise_interrupt(failure.status)
            rows.append(Row(failure.status))
    return rows
