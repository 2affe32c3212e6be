"""Perturbation of problems by rounding."""

from dataclasses import replace


def stronger(problem, share):
    """Return a problem with stiffness and loads scaled by 1 + share."""
    system = problem.system
    loads = tuple(replace(load, vector=(1.0 + share) * load.vector) for load in system.loads)
    return replace(problem, system=replace(system, stiffness=system.stiffness.scale(1.0 + share), loads=loads))
