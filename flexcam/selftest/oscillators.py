"""One mass in time, against the closed forms of the time integration and of impacts; motion laws."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from flexcam.integrate import Problem, State, equilibrium, newmark, solve
from flexcam.linalg import Triplets
from flexcam.motion import LAWS, criteria
from flexcam.selftest.check import Check
from flexcam.system import AngleVector, ConstantSpeed, Load, LocalForce, Probe, System, constant, elastic_stop

_G, _V0, _STIFFNESS = 9.81, 1.2, 4e6
"""Gravity, speed at the first touch, stiffness of the stop; the mass is 1 kg."""

_STILL = ConstantSpeed(1.0)
_PROBE = Probe("x", ("x",), np.eye(1), (None,))


def oscillators() -> Iterator[Check]:
    """Yield what one mass must do, and the peaks of motion laws."""
    yield _late()
    yield from _bounced()
    yield from _laws()


def _late() -> Check:
    """Return where a free oscillation is after 1000 steps of a tenth of its period, by the average acceleration."""
    turned, step = 2.0 * math.pi / 10.0, 0.01
    stiffness = Triplets.from_dense([[(turned / step) ** 2]])
    system = System(Triplets.from_dense([[1.0]]), Triplets.zeros(1), stiffness, ("x",), probes=(_PROBE,))
    problem = Problem(system, _STILL, step, 1000, State(np.ones(1), np.zeros(1)), engine="direct")
    end = solve(problem, newmark())["x"].displacement[-1]
    source = "Hughes, The Finite Element Method, ch. 9"
    return Check("Newmark after 100 periods", source, math.cos(2000.0 * math.atan(0.5 * turned)), float(end), 1e-9, "m")


def _bouncing() -> System:
    """Return a mass under gravity over an elastic stop."""
    down, up = AngleVector.constant(np.array([-1.0])), AngleVector.constant(np.array([1.0]))
    stop = LocalForce("stop", (down,), (up,), elastic_stop(_STIFFNESS), (constant(0.0),), switching=(0,))
    weight = Load("weight", np.array([-_G]), lambda motion: np.ones_like(motion.angle))
    nothing = Triplets.zeros(1)
    return System(Triplets.from_dense([[1.0]]), nothing, nothing, ("x",), (weight,), (stop,), probes=(_PROBE,))


def _bounced() -> Iterator[Check]:
    source = "Goldsmith, Impact, ch. 4"
    w, sunk = math.sqrt(_STIFFNESS), _G / _STIFFNESS
    contact = 2.0 / w * (math.pi - math.atan(_V0 * w / _G))
    steps, whole = 1000, 1.5 * contact
    start = State(np.zeros(1), np.array([-_V0]))
    found = solve(Problem(_bouncing(), _STILL, whole / steps, steps, start, engine="direct"), newmark())["x"]
    deepest = sunk + math.hypot(sunk, _V0 / w)
    # Steps of w dt = 0.005: the period is wrong by its square over 12, the speed at an event by as much.
    yield Check("depth of an impact", source, deepest, -float(found.displacement.min()), 1e-5, "m")
    yield Check("speed after an impact", source, _V0 - _G * (whole - contact), float(found.velocity[-1]), 1e-5, "m/s")
    rest = equilibrium(_bouncing(), _STILL).displacement
    yield Check("mass at rest on a stop", "m g/k", -sunk, float(rest[0]), 1e-9, "m")


def _laws() -> Iterator[Check]:
    source = "derivatives of the law, by hand"
    for name, velocity, acceleration in (
        ("cycloidal", 2.0, 2.0 * math.pi),
        ("shm", 0.5 * math.pi, 0.5 * math.pi**2),
        ("3-4-5", 1.875, 10.0 / math.sqrt(3.0)),
    ):  # fmt: skip
        found = criteria(LAWS[name])
        yield Check(f"largest velocity of the law {name}", source, velocity, found.velocity[1].value, 1e-9)
        yield Check(f"largest acceleration of the law {name}", source, acceleration, found.acceleration[1].value, 1e-9)
