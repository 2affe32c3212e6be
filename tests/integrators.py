"""The integrators that tests try, in one table: whoever adds one adds a row, and the tests take those that fit them.

What papers give in closed form stands in `verification/test_newmark_properties.py`, with their parameters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from flexcam.dynamics import Method, Scheme, bathe, central_difference, generalized_alpha, hht, newmark


@dataclass(frozen=True)
class Tried:
    """An integrator as tests try it.

    Parameters
    ----------
    method
        The integrator.
    title
        What recorded rows call it.
    order
        Of its error in the step.
    contacts
        Whether it takes local forces.
    setting
        Whether it is another setting of one that stands above.
    """

    method: Method
    title: str
    order: int = 2
    contacts: bool = True
    setting: bool = False


INTEGRATORS = {
    "newmark": Tried(newmark(), "Newmark"),
    "newmark damped": Tried(newmark(beta=0.3025, gamma=0.6), "Newmark 0.3025, 0.6", order=1, setting=True),
    "linear acceleration": Tried(newmark(beta=1 / 6), "linear acceleration", setting=True),
    "hht": Tried(hht(alpha=-0.1), "HHT -0.1"),
    "hht -1/3": Tried(hht(alpha=-1 / 3), "HHT -1/3", setting=True),
    "generalized-alpha": Tried(generalized_alpha(rho_inf=0.8), "generalized-alpha 0.8"),
    "generalized-alpha 0": Tried(generalized_alpha(rho_inf=0.0), "generalized-alpha 0", setting=True),
    "bathe": Tried(bathe(), "Bathe"),
    "central-difference": Tried(central_difference(), "central difference", contacts=False),
}

METHODS = {name: one.method for name, one in INTEGRATORS.items() if not one.setting}
"""One of each, by name."""

WITH_CONTACTS = {one.title: one.method for one in INTEGRATORS.values() if one.contacts and not one.setting}
"""One of each that takes local forces and steps of any length, by its title."""

SCHEMES = {
    name: one.method
    for name, one in INTEGRATORS.items()
    if isinstance(one.method, Scheme) and one.method.stability_limit() == math.inf
}
"""Those that go every way through time, in all settings."""
