"""The front of two goals: variants of which no other is better in both. Owns pymoo (extra ``design``)."""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# pymoo has no stubs, and leaves the types of its keyword arguments open.

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np

from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.study.objective import feasible
from flexcam.study.optimize import Design, Evaluations, Judge, generation_size
from flexcam.sweep import checked_seed


def pareto(design: Design, *, evaluations: int = 400, seed: int = 0) -> Evaluations:
    """Look for the front of two goals.

    NSGA-II: K. Deb et al., IEEE Trans. Evol. Comput. 6 (2002) 182, as pymoo has it.
    """
    if len(design.goals) != 2:
        raise refuse("goals", len(design.goals), "two", "a front is between two")
    if find_spec("pymoo") is None:
        raise refuse("optimize", "two goals", "one goal", "pymoo is not installed", "pip install 'flexcam[design]'")
    size = 2 * generation_size(len(design.points.variables))
    if evaluations < 2 * size:
        raise refuse("--evaluations", evaluations, f"{2 * size} or more", "two generations")
    checked_seed(seed)
    judge = Judge(design)

    def search() -> None:
        if design.stands is not None:
            judge.judged(design.stands[None])  # the front is no worse than the case as it stands
        _evolve(judge, design, size, evaluations // size, seed)

    return judge.after(search)


def _evolve(judge: Judge, design: Design, size: int, generations: int, seed: int) -> None:
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.evaluator import Evaluator
    from pymoo.core.problem import Problem
    from pymoo.problems.static import StaticProblem

    variables, bounds = len(design.points.variables), len(design.bounds) + 1
    problem = Problem(n_var=variables, n_obj=2, n_ieq_constr=bounds, xl=0.0, xu=1.0)
    algorithm = NSGA2(pop_size=size)
    algorithm.setup(problem, termination=("n_gen", generations), seed=seed, verbose=False)
    while algorithm.has_next():
        asked: Any = algorithm.ask()
        cost, passed = judge.judged(np.asarray(asked.get("X"), dtype=float))
        Evaluator().eval(StaticProblem(problem, F=np.minimum(cost, 1e30), G=passed), asked)
        algorithm.tell(infills=asked)


def front(found: Evaluations) -> list[int]:
    """Return which variants within all bounds no other beats in both goals."""
    inside = np.flatnonzero(feasible(found.violations) & np.isfinite(found.costs).all(axis=1)).tolist()
    kept = [i for i in inside if not any(_beats(found.costs[j], found.costs[i]) for j in inside)]
    first: dict[tuple[float, ...], int] = {}
    for i in kept:
        first.setdefault(tuple(found.costs[i].tolist()), i)
    return sorted(first.values(), key=lambda i: float(found.costs[i, 0]))


def _beats(one: FloatArray, other: FloatArray) -> bool:
    return bool((one <= other).all() and (one < other).any())
