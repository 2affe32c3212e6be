"""What no law at all can beat."""

from __future__ import annotations

import math
from collections.abc import Mapping


def bound_over_all(weights: Mapping[str, float], limits: Mapping[str, float], *, free_ends: bool) -> float | None:
    """Return a lower bound of the objective over all laws from rest to rest.

    C_v >= 1 (the mean velocity), C_a >= 4 (the parabola), C_j >= 32 (three stretches of constant jerk; 12, the 2-3
    polynomial's, where the acceleration may step at the ends), rms of s'' at least sqrt(12) (the 2-3 polynomial),
    C_m >= 9/4 (s'^2 rises and falls linearly). With a bound J on the jerk, C_a is at least that of the law whose
    acceleration is a trapezoid of slopes J, as bang-bang control has it; with one on C_a, C_j is. Bounds on C_v and C_a
    raise each other: no law goes farther than one whose velocity is a trapezoid, V - V^2/A = 1.
    """
    least = {"Cv": 1.0, "Ca": 4.0, "Cj": 12.0 if free_ends else 32.0, "rms": math.sqrt(12.0), "Cm": 2.25}
    if "Cj" in limits:
        least["Ca"] = least_acceleration(limits["Cj"], free_ends=free_ends)
    if 1.0 < limits.get("Cv", 2.0) < 2.0:
        least["Ca"] = max(least["Ca"], limits["Cv"] ** 2 / (limits["Cv"] - 1.0))
    if "Ca" in limits:
        least["Cv"] = 2.0 / (1.0 + math.sqrt(max(1.0 - 4.0 / limits["Ca"], 0.0)))
        least["Cj"] = max(least["Cj"], least_jerk(limits["Ca"], free_ends=free_ends))
    if any(name not in least for name in weights):
        return None
    return sum(weight * least[name] for name, weight in weights.items())


def least_jerk(acceleration: float, *, free_ends: bool) -> float:
    """Return the least C_j under a bound on C_a."""
    if not 4.0 < acceleration < (6.0 if free_ends else 8.0):
        return 0.0
    above = acceleration - 4.0
    return math.sqrt(4.0 * acceleration**3 / (3.0 * above)) if free_ends else 2.0 * acceleration**2 / above


def least_acceleration(jerk: float, *, free_ends: bool) -> float:
    """Return the least C_a under a bound on the jerk."""
    if not free_ends:
        return 4.0 if jerk < 32.0 else 8.0 / (1.0 + math.sqrt(1.0 - 32.0 / jerk))
    acceleration = 4.0
    for _ in range(100):
        acceleration = 4.0 + 4.0 * acceleration**3 / (3.0 * jerk**2)
        if acceleration > 0.5 * jerk:  # the slope fills the whole half: no trapezoid
            return 4.0
    return acceleration
