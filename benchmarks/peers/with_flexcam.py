"""flexcam by its public interface, as a case is run: what nothing can move is left out, which changes no result."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from benchmarks.paths import solved
from benchmarks.peers.work import Result, Work
from flexcam.dynamics import ConstantSpeed, Load, Probe, Problem, SaveAt, System
from flexcam.fem.assembly import Member, stiffness
from flexcam.fem.assembly import beams as fem_beams
from flexcam.fem.assembly import mass as fem_mass
from flexcam.fem.dofs import direction, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.rigid_bodies import PointMass, mass_at
from flexcam.fem.sections import Material, Section


def run(work: Work, path: str = "auto") -> Result:
    """Integrate at all speeds."""
    started, loop, moved = time.perf_counter(), 0.0, []
    system, runs = shaft(work), len(work.frequencies)
    if path == "kernel":  # fetched once per process, which the whole process tells
        solved(Problem(system, ConstantSpeed(1.0), step=work.step(1.0), steps=1), path)
    for frequency in work.frequencies:
        drive = ConstantSpeed(2.0 * math.pi * frequency)
        problem = Problem(system, drive, step=work.step(frequency), steps=work.steps, runs=runs, prune=True)
        begun = time.perf_counter()
        response = solved(problem, path, SaveAt(field_every=work.steps, channels=False))
        loop += time.perf_counter() - begun
        moved.append(response["middle"].displacement)
    return Result(np.array(moved), loop, time.perf_counter() - started)


def shaft(work: Work) -> System:
    """Return the equations of the shaft."""
    line = chain((0.0, 0.0, 0.0), (work.spans * work.length, 0.0, 0.0), work.last)
    bearings = np.arange(work.elements, work.last + 1, work.elements)
    mesh = replace(line, points={"start": np.array([0]), "bearings": bearings})
    steel = Material(E=work.E, nu=work.E / (2.0 * work.G) - 1.0, density=work.density)
    beams = fem_beams(mesh, {"shaft": Member(steel, Section.circle(work.diameter), rotary_inertia=False)})
    dofs = dof_map(mesh, [("start", ("ux", "uy", "uz", "rx")), ("bearings", ("uy", "uz"))])
    mass = fem_mass(beams, dofs) + mass_at(work.middle, PointMass(work.mass), dofs)
    push, twist = (dofs.vector(work.middle, direction(name)) for name in ("uy", "rx"))
    loads = (
        Load("force", push, lambda motion: work.force * (1.0 - np.cos(motion.angle))),
        Load("torque", twist, lambda motion: work.torque * np.sin(motion.angle)),
    )
    probe = Probe("middle", ("uy", "rx"), np.array([push, twist]), (None, None))
    return System(mass, mass.scale(0.0), stiffness(beams, dofs), dofs.names, loads, probes=(probe,))
