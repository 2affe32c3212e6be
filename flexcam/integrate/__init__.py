"""Time integration and static equilibrium of any `System`, results in blocks.

Knows no beam and no cam; may import `system`, `response`, `linalg` and `checks`.
A new scheme of the family is a constructor in `scheme`; another kind of integrator is a file beside `step`.
"""

from flexcam.integrate.floquet import Floquet, floquet
from flexcam.integrate.periodic import periodic
from flexcam.integrate.problem import Problem, State
from flexcam.integrate.scheme import Bathe, Method, Scheme, bathe, generalized_alpha, hht, newmark
from flexcam.integrate.solve import outline, solve
from flexcam.integrate.statics import equilibrium, rest, static_displacement
from flexcam.response import SaveAt

__all__ = [
    "Bathe",
    "Floquet",
    "Method",
    "Problem",
    "SaveAt",
    "Scheme",
    "State",
    "bathe",
    "equilibrium",
    "floquet",
    "generalized_alpha",
    "hht",
    "newmark",
    "outline",
    "periodic",
    "rest",
    "solve",
    "static_displacement",
]
