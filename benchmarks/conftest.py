"""Cases of the benchmarks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flexcam import fem
from flexcam.fem.generate import chain
from flexcam.integrate import Problem
from flexcam.system import ConstantSpeed, Load, Probe, System


@pytest.fixture
def driven_shaft() -> Problem:
    """Ten-element steel shaft, 0.2 kg at its middle, a rotating force and torque there, 7200 steps over two turns."""
    mesh = chain((0, 0, 0), (0.5, 0, 0), 10)
    nu = 2.06e11 / (2.0 * 7.9e10) - 1.0
    steel = fem.Material(E=2.06e11, nu=nu, density=7850.0)
    beams = fem.beams(mesh, {"shaft": fem.Member(steel, fem.Section.circle(0.025), rotary_inertia=False)})
    dofs = fem.dof_map(mesh, [("start", ("ux", "uy", "uz", "rx")), ("end", ("uy", "uz"))])
    mass = fem.mass(beams, dofs) + fem.mass_at(5, fem.PointMass(0.2), dofs)
    push, twist = (dofs.vector(5, fem.direction(name)) for name in ("uy", "rx"))
    loads = (
        Load("force", push, lambda motion: 500.0 * (1.0 - np.cos(motion.angle))),
        Load("torque", twist, lambda motion: 3.0 * np.sin(motion.angle)),
    )
    probe = Probe("middle", ("uy", "rx"), np.array([push, twist]), (None, None))
    nothing = mass.scaled(0.0)
    system = System(mass, nothing, fem.stiffness(beams, dofs), dofs.names, loads, probes=(probe,))
    return Problem(system, ConstantSpeed(2.0 * math.pi * 25.0), step=1.0 / (25.0 * 3600.0), steps=7200)
