"""Time integration and static equilibrium of any `System`, results in blocks.

Knows no beam and no cam; may import `system`, `response`, `checkpoint`, `memory`, `linalg` and `checks`.
A new scheme of the family is a constructor in `scheme`; another kind of integrator is a file beside `central`.
"""

from flexcam.integrate.central import CentralDifference, central_difference, highest_frequency
from flexcam.integrate.composite import Bathe, bathe
from flexcam.integrate.exact import Exact, exact
from flexcam.integrate.fingerprint import fingerprint
from flexcam.integrate.floquet import Floquet, floquet
from flexcam.integrate.generalized_alpha import Scheme, generalized_alpha, hht, newmark
from flexcam.integrate.method import Method
from flexcam.integrate.outside import Outside, dop853, radau
from flexcam.integrate.periodic import periodic
from flexcam.integrate.problem import Adaptive, Engine, Problem, State
from flexcam.integrate.reach import Reach, Still, reach
from flexcam.integrate.solve import carried_by_cam, outline, solve
from flexcam.integrate.statics import carried_equilibrium, equilibrium, rest, static_displacement
from flexcam.integrate.tangent import Tangents
from flexcam.integrate.within import basis_of, integrated, reached, refused
from flexcam.response import SaveAt

__all__ = [
    "Adaptive",
    "Bathe",
    "CentralDifference",
    "Engine",
    "Exact",
    "Floquet",
    "Method",
    "Outside",
    "Problem",
    "Reach",
    "SaveAt",
    "Scheme",
    "State",
    "Still",
    "Tangents",
    "basis_of",
    "bathe",
    "carried_by_cam",
    "carried_equilibrium",
    "central_difference",
    "dop853",
    "equilibrium",
    "exact",
    "fingerprint",
    "floquet",
    "generalized_alpha",
    "hht",
    "highest_frequency",
    "integrated",
    "newmark",
    "outline",
    "periodic",
    "radau",
    "reach",
    "reached",
    "refused",
    "rest",
    "solve",
    "static_displacement",
]
