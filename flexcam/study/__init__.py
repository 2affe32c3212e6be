"""Design studies: derivatives, shares of variance, scatter of parts, best variants, fronts.

May import `sweep` and everything below it; owns pymoo. A new kind of study is a file; what it can ask of a case is in
`quantities`, what it can vary in `keys` and `points`.
"""

from flexcam.study.evaluators import evaluators
from flexcam.study.kept import Kept
from flexcam.study.keys import Number, number_of, overrides_of
from flexcam.study.limit_map import LimitMap, grid_plan, limit_map
from flexcam.study.objective import Constraint, Goal, active, constraint, constraints_of, feasible, value_of
from flexcam.study.optimize import Design, Evaluations, optimize
from flexcam.study.pareto import front, pareto
from flexcam.study.points import Points, Runs, Variable, column, serial, variables_of
from flexcam.study.quantities import Quantity, check_names, complete, frequency_number, measured, quantities
from flexcam.study.scatter import QUANTILES, Scatter, Spread, sampled, scatters_of, spread
from flexcam.study.sensitivity import Sensitivity, numbers_of, sensitivities
from flexcam.study.sobol import SobolIndices, checked_count, sobol_indices
from flexcam.study.written import case_text

__all__ = [
    "QUANTILES",
    "Constraint",
    "Design",
    "Evaluations",
    "Goal",
    "Kept",
    "LimitMap",
    "Number",
    "Points",
    "Quantity",
    "Runs",
    "Scatter",
    "Sensitivity",
    "SobolIndices",
    "Spread",
    "Variable",
    "active",
    "case_text",
    "check_names",
    "checked_count",
    "column",
    "complete",
    "constraint",
    "constraints_of",
    "evaluators",
    "feasible",
    "frequency_number",
    "front",
    "grid_plan",
    "limit_map",
    "measured",
    "number_of",
    "numbers_of",
    "optimize",
    "overrides_of",
    "pareto",
    "quantities",
    "sampled",
    "scatters_of",
    "sensitivities",
    "serial",
    "sobol_indices",
    "spread",
    "value_of",
    "variables_of",
]
