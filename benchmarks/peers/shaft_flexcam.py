"""B1 and B5 by the public interface of flexcam, as for a case: without degrees of freedom that cannot move."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from benchmarks.engines import run_engine
from benchmarks.peers.shaft import Shaft, ShaftResult
from flexcam.dynamics import ConstantSpeed, Load, Probe, Problem, SaveAt, System
from flexcam.fem.assembly import Member, build_beams, stiffness
from flexcam.fem.assembly import mass as fem_mass
from flexcam.fem.dofs import direction, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.rigid_bodies import PointMass, mass_at
from flexcam.fem.sections import Material, Section


def run(shaft: Shaft, engine: str = "auto") -> ShaftResult:
    """Integrate at all speeds with a solver engine of flexcam."""
    start, loop, displacements = time.perf_counter(), 0.0, []
    system, runs = shaft_system(shaft), len(shaft.frequencies)
    if engine == "kernel":  # load compiled code; only the time of the process includes this
        run_engine(Problem(system, ConstantSpeed(1.0), step=shaft.step(1.0), steps=1), engine)
    for frequency in shaft.frequencies:
        drive = ConstantSpeed(2.0 * math.pi * frequency)
        problem = Problem(system, drive, step=shaft.step(frequency), steps=shaft.steps, runs=runs, prune=True)
        loop_start = time.perf_counter()
        response = run_engine(problem, engine, SaveAt(field_every=shaft.steps, channels=False))
        loop += time.perf_counter() - loop_start
        displacements.append(response["middle"].displacement)
    return ShaftResult(np.array(displacements), loop, time.perf_counter() - start)


def shaft_system(shaft: Shaft) -> System:
    """Return the equations of the shaft."""
    line = chain((0.0, 0.0, 0.0), (shaft.spans * shaft.length, 0.0, 0.0), shaft.last)
    bearings = np.arange(shaft.elements, shaft.last + 1, shaft.elements)
    mesh = replace(line, points={"start": np.array([0]), "bearings": bearings})
    steel = Material(E=shaft.E, nu=shaft.E / (2.0 * shaft.G) - 1.0, density=shaft.density)
    beams = build_beams(mesh, {"shaft": Member(steel, Section.circle(shaft.diameter), rotary_inertia=False)})
    dofs = dof_map(mesh, [("start", ("ux", "uy", "uz", "rx")), ("bearings", ("uy", "uz"))])
    mass = fem_mass(beams, dofs) + mass_at(shaft.middle, PointMass(shaft.mass), dofs)
    force, torque = (dofs.vector(shaft.middle, direction(name)) for name in ("uy", "rx"))
    loads = (
        Load("force", force, lambda motion: shaft.force * (1.0 - np.cos(motion.angle))),
        Load("torque", torque, lambda motion: shaft.torque * np.sin(motion.angle)),
    )
    probe = Probe("middle", ("uy", "rx"), np.array([force, torque]), (None, None))
    return System(mass, mass.scale(0.0), stiffness(beams, dofs), dofs.names, loads, probes=(probe,))
