"""Problems that differ from another one by rounding."""

from __future__ import annotations

from dataclasses import replace


def stronger(problem, share):
    """Return a problem whose stiffness and loads are larger by a share."""
    system = problem.system
    loads = tuple(replace(load, vector=(1.0 + share) * load.vector) for load in system.loads)
    return replace(problem, system=replace(system, stiffness=system.stiffness.scale(1.0 + share), loads=loads))
