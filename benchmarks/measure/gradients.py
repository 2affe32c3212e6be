"""Gradients of runs with contacts: one run with its tangent against central differences."""

from __future__ import annotations

from functools import partial

from benchmarks.processes import ROOT
from benchmarks.timing import minimum_cpu_times
from flexcam.case.reader import CaseFile
from flexcam.studies.evaluation import evaluate
from flexcam.studies.gradients import compute_gradient, make_neighbours
from flexcam.studies.sensitivity import get_numbers

NUMBERS = {
    "pushrod-engine/intake": ("springs.valve.stiffness", "run.crank_speed", "springs.valve.installed_force",
                              "masses.valve.mass", "masses.follower.mass", "contacts.lash.gap", "cams.intake.lift",
                              "rockers.rocker.inertia"),
    "direct-acting/bucket": ("run.crank_speed", "masses.bucket.mass", "contacts.lash.gap", "cams.intake.lift",
                             "masses.head.mass", "masses.retainer.mass", "contacts.seat.stiffness",
                             "springs.outer.installed_force"),
    "direct-acting/finger": ("contacts.adjuster.leak", "run.crank_speed", "cams.intake.lift",
                             "contacts.adjuster.stiffness", "masses.valve.mass", "springs.valve.stiffness",
                             "springs.valve.installed_force", "contacts.seat.stiffness"),
}  # fmt: skip
"""Parameters by case; a gradient has the first 1, 3 and 8 of them."""
COUNTS = (1, 3, 8)
SCALARS = ("contacts.intake.force.largest", "contacts.seat.seating_velocity")
FIXED = ("run.revolutions=1", "run.engine=kernel", "run.integrator.method=newmark")
REPEATS = 5


def measure_table() -> list[dict[str, object]]:
    """Return the time of a gradient and of central differences, in runs, by case and number of parameters."""
    return [row for name in NUMBERS for row in _rows(name)]


def _rows(name: str) -> list[dict[str, object]]:
    file = CaseFile.open(ROOT / f"cases/{name}.toml")
    case = file.read(FIXED)
    numbers = get_numbers(case, NUMBERS[name])

    def differences(count: int) -> None:
        for number in numbers[:count]:
            for overrides in make_neighbours(case, number, (-1e-3 * number.value, 1e-3 * number.value)):
                evaluate(file.read((*FIXED, *overrides)), names=SCALARS)

    calls = [partial(differences, count) for count in COUNTS]
    calls += [partial(compute_gradient, case, SCALARS, numbers[:count]) for count in COUNTS]
    run, *times = minimum_cpu_times([lambda: evaluate(file.read(FIXED), names=SCALARS), *calls], REPEATS)
    return [
        {
            "case": name,
            "parameters": count,
            "run_ms": 1e3 * run,
            "exact_runs": exact / run,
            "differences_runs": other / run,
        }
        for count, other, exact in zip(COUNTS, times[: len(COUNTS)], times[len(COUNTS) :], strict=True)
    ]
