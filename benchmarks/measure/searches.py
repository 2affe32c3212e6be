"""Variants and processor time of the gradient search and the global search for the same goal."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.processes import ROOT
from flexcam.case.reader import CaseFile
from flexcam.core import FloatArray
from flexcam.core.units import RPM
from flexcam.studies.gradients import gradient_evaluator, optimize_by_gradient
from flexcam.studies.optimization import (
    Evaluations,
    Goal,
    OptimizationProblem,
    is_feasible,
    optimize,
    parse_constraints,
)
from flexcam.studies.quantities import create_evaluator
from flexcam.studies.variables import PointEvaluator, variables_of

CASE = ROOT / "cases/pushrod-engine/intake.toml"
LAW = "{id='bspline',degree=11,coefficients=[0,0,0,0,0.106060606,0.348484848,0.651515152,0.893939394,1,1,1,1]}"
FIXED = ("run.revolutions=1", "run.steps_per_revolution=720", "run.engine=kernel", f"cams.intake.law={LAW}")
VARIED = (
    "run.crank_speed=4500:7000rpm", "springs.valve.stiffness=40:80kN/m", "springs.valve.installed_force=250:500N",
    "cams.intake.law.coefficients.4=0:0.4", "cams.intake.law.coefficients.5=0.2:0.6",
    "cams.intake.law.coefficients.6=0.4:0.9", "cams.intake.law.coefficients.7=0.7:1.05",
)  # fmt: skip
GOAL = Goal("run.crank_speed", most=True)
BOUNDS = ("contacts.intake.nose_force.least >= 50 N", "springs.valve.stress.largest <= 0.856 GPa")
GRADIENT_EVALUATIONS, GLOBAL_EVALUATIONS = 30, 500
SHARE = 0.99  # of the speed that the gradient search finds: the speed to which both are timed


def measure_table() -> list[dict[str, object]]:
    """Return variants and times of both searches, in total and to `SHARE` of the gradient search, and their results."""
    found = {method: _search(method) for method in ("gradient", "evolution")}
    target = SHARE * _best(found["gradient"][0])[-1]
    rows = list[dict[str, object]]()
    for method, (evaluations, seconds) in found.items():
        best = _best(evaluations)
        until = int(np.argmax(best >= target)) + 1 if best[-1] >= target else None
        rows.append({
            "method": method, "variants": len(best), "seconds": seconds, "best_rpm": float(best[-1]) / RPM,
            "reached_rpm": target / RPM, "until": until, "until_s": until and seconds * until / len(best),
        })  # fmt: skip
    return rows


def _best(found: Evaluations) -> FloatArray:
    """Return the highest feasible speed up to each evaluation, rad/s."""
    return np.maximum.accumulate(np.where(is_feasible(found.violations), -found.costs[:, 0], 0.0))


def _search(method: str) -> tuple[Evaluations, float]:
    file, bounds = CaseFile.open(CASE), parse_constraints(BOUNDS)
    case, names = file.read(FIXED), (GOAL.name, *(bound.name for bound in bounds))
    variables = variables_of(case, VARIED, "--vary")
    start = time.process_time()
    by_gradient = method == "gradient"
    with (
        gradient_evaluator(file, FIXED, names, variables)
        if by_gradient
        else create_evaluator(file, FIXED, names, runs=GLOBAL_EVALUATIONS)
    ) as runs:
        design = OptimizationProblem(PointEvaluator(case, variables, runs), (GOAL,), bounds)
        if by_gradient:
            found = optimize_by_gradient(design, evaluations=GRADIENT_EVALUATIONS)
        else:
            found = optimize(design, evaluations=GLOBAL_EVALUATIONS)
    return found, time.process_time() - start
