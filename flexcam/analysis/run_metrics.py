"""Metrics of the last revolution of a run, and its difference from the one before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.analysis.prepared_run import MASS_CHAINS, PreparedRun, scalar_probe
from flexcam.core import FloatArray
from flexcam.dynamics import Response
from flexcam.valvetrain import Metric, main_lift, train_metrics


@dataclass(frozen=True)
class RevolutionChange:
    """Difference of the last revolution of a run from the one before."""

    motion: float  #: maximum difference of the default probe, relative to its range
    #: root mean square of the difference of a contact force on the main lift of its cam, relative to the force's
    force: float
    contact: str = ""  #: contact of this force; empty without a cam


def revolution_change(ready: PreparedRun, response: Response) -> RevolutionChange | None:
    """Return the deviation of the last revolution of a run from periodic; None without two revolutions."""
    time, period = response.time, ready.revolution
    if not len(time) or time[-1] - time[0] < (2.0 - _ROUNDING) * period - ready.problem.step:
        return None
    last = response.latest(period)

    def difference(values: FloatArray) -> FloatArray:
        return values[last] - np.interp(time[last] - period, time, values)

    moved = response[scalar_probe(ready)].displacement if ready.model.probes else np.zeros(len(time))
    changes = dict[str, float]()
    for name, contact in ready.model.cam_contacts.items():
        if (force := response.channels.get(f"contacts.{name}.force")) is not None:
            lift = ready.model.cams[contact.cam].event(response.angle[last])
            lifted = lift > main_lift(ready.model, contact.cam)
            changes[name] = _relative(np.linalg.norm(difference(force)[lifted]), np.linalg.norm(force[last][lifted]))
    contact = max(changes, key=lambda name: changes[name], default="")
    motion = _relative(np.abs(difference(moved)).max(), np.ptp(moved[last]))
    return RevolutionChange(motion, changes.get(contact, 0.0), contact)


def _relative(part: float | np.floating, whole: float | np.floating) -> float:
    if part <= _ROUNDING * whole:
        return 0.0
    return float(part / whole) if whole > 0.0 else 1.0


_ROUNDING = 1e-9  # relative size of rounding errors


def compute_metrics(ready: PreparedRun, response: Response, names: Sequence[str] | None = None) -> list[Metric]:
    """Return the metrics of the last revolution of a run, without those that its model cannot compute.

    With names, costly metrics that are not among them are left out.
    """
    found = train_metrics(ready.model, response, ready.revolution, names)
    if ready.case.record.fidelity.model not in MASS_CHAINS:
        return found

    def changes(metric: Metric) -> bool:
        values = response.channels[metric.name.rpartition(".")[0].replace(".power", ".torque")]
        return bool(np.ptp(values) > _ROUNDING * np.abs(values).max())

    return [one for one in found if not one.name.startswith(("cams.", "supports.")) or changes(one)]
