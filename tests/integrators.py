"""Table of integrators for tests; a new integrator needs a row here.

`verification/test_newmark_properties.py` has the closed forms and parameters of publications.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexcam.dynamics import Method, Scheme, bathe, central_difference, generalized_alpha, hht, newmark


@dataclass(frozen=True)
class IntegratorCase:
    """An integrator and its properties in tests."""

    method: Method
    title: str  #: in recorded rows
    order: int = 2  #: of the error in the step
    contacts: bool = True  #: supports local forces
    setting: bool = False  #: another setting of an integrator above


INTEGRATORS = {
    "newmark": IntegratorCase(newmark(), "Newmark"),
    "newmark damped": IntegratorCase(newmark(beta=0.3025, gamma=0.6), "Newmark 0.3025, 0.6", order=1, setting=True),
    "linear acceleration": IntegratorCase(newmark(beta=1 / 6), "linear acceleration", setting=True),
    "hht": IntegratorCase(hht(alpha=-0.1), "HHT -0.1"),
    "hht -1/3": IntegratorCase(hht(alpha=-1 / 3), "HHT -1/3", setting=True),
    "generalized-alpha": IntegratorCase(generalized_alpha(rho_inf=0.8), "generalized-alpha 0.8"),
    "generalized-alpha 0": IntegratorCase(generalized_alpha(rho_inf=0.0), "generalized-alpha 0", setting=True),
    "bathe": IntegratorCase(bathe(), "Bathe"),
    "central-difference": IntegratorCase(central_difference(), "central difference", contacts=False),
}

METHODS = {name: case.method for name, case in INTEGRATORS.items() if not case.setting}
"""Integrators in one setting each, by name."""

WITH_CONTACTS = {case.title: case.method for case in INTEGRATORS.values() if case.contacts and not case.setting}
"""Integrators with local forces and steps of any length, in one setting each, by title."""

SCHEMES = {
    name: case.method
    for name, case in INTEGRATORS.items()
    if isinstance(case.method, Scheme) and case.method.stability_limit() == math.inf
}
"""Integrators for all solver engines, in all settings."""
