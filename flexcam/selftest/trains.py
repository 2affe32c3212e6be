"""A whole train: its loaded mode, its energy, the ways through time, and its result file written and read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flexcam.case import Case, read_case
from flexcam.case.starters import new_case
from flexcam.fidelity import loaded_mode
from flexcam.integrate import solve
from flexcam.integrate.jit import is_available
from flexcam.io import read_result, scratch
from flexcam.response import Response
from flexcam.runner import Prepared, prepare, result_file
from flexcam.selftest.check import Check

_PROBE = "valve"
_PAPER = "Tayeb and Sliman: unstable near 4000 rpm"


def trains() -> Iterator[Check]:
    """Yield what the published train must do: the starter case of that name."""
    with scratch() as folder:
        case = read_case(new_case("published-model", folder / "case.toml")[0])
        yield Check(
            "speed at which the loaded mode resonates", _PAPER, 4027.0, loaded_mode(case)[1], 0.5 / 4027.0, "rpm"
        )
        ready = prepare(case)
        sink = result_file(ready, folder)
        run = solve(replace(ready.problem, engine="direct"), ready.scheme, save=ready.save, sinks=[sink])
        yield _balanced(run)
        yield from _ways(ready, run)
        yield _written(run, read_result(sink.path).response)
        yield _followed(case)


def _balanced(run: Response) -> Check:
    residual = float(np.abs(run.channels["energy.residual"]).max() / np.ptp(run.channels["energy.work"]))
    source = "exact for the average acceleration"
    return Check("energy that does not add up, over the work", source, 0.0, residual, 1e-9)


def _ways(ready: Prepared, run: Response) -> Iterator[Check]:
    """Yield how far the faster ways through time are from the general one, as a part of the motion."""
    for path in ("modal", "kernel") if is_available() else ("modal",):
        other = solve(replace(ready.problem, engine=path), ready.scheme, save=ready.save)
        yield Check(
            f"way through time {path}, against the general one", "the same scheme", 0.0, _apart(run, other), 1e-8
        )


def _apart(one: Response, other: Response) -> float:
    moved = one[_PROBE].displacement
    return float(np.abs(moved - other[_PROBE].displacement).max() / np.abs(moved).max())


def _written(run: Response, read: Response) -> Check:
    """Return by how much a result file changes what is written into it."""
    pairs = [(getattr(run.probes, kind), getattr(read.probes, kind)) for kind in ("displacement", "velocity")]
    pairs += [(run.time, read.time), *((values, read.channels[name]) for name, values in run.channels.items())]
    apart = max(float(np.abs(a - b).max(initial=0.0)) for a, b in pairs)
    return Check("result file, read against what was written", "every digit", 0.0, apart, 0.0)


def _followed(case: Case) -> Check:
    """Return the largest lift of the rigid train: that of its cam times the rocker's ratio."""
    ready = prepare(case, rigid=True)
    top = float(solve(ready.problem, ready.scheme, save=ready.save)[_PROBE].displacement.max())
    rocker, cam = next(iter(ready.model.rockers.values())), next(iter(ready.model.cams.values()))
    return Check(
        "lift of the rigid train", "cam lift times rocker ratio", cam.event.height * rocker.ratio, top, 1e-6, "m"
    )
