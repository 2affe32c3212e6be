"""Reduced problem: integration in active unknowns or in a basis, and expansion of the results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexcam.core import FloatArray, Triplets
from flexcam.core.errors import InputError
from flexcam.dynamics.active_dofs import ActiveDofs, find_active_dofs
from flexcam.dynamics.basis import Basis, DofSubset, project_system
from flexcam.dynamics.blocks import Block, Series
from flexcam.dynamics.initial_acceleration import massless_impact_error
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.massless import MasslessMotions
from flexcam.dynamics.problem import Problem, State
from flexcam.dynamics.system import System


def active_dofs_of(problem: Problem) -> ActiveDofs:
    """Return the active unknowns of a problem."""
    start = problem.start or State.rest(problem.system.size)
    return find_active_dofs(problem.system, start.displacement, start.velocity, start.inner)


def basis_of(problem: Problem) -> Basis | None:
    """Return the basis of the integration; None for the system's unknowns."""
    if problem.basis is not None or not problem.prune:
        return problem.basis
    found = active_dofs_of(problem)
    return None if found.moving.all() else DofSubset(np.flatnonzero(found.moving), found.held)


def reduce_problem(problem: Problem, basis: Basis) -> Problem:
    """Return a problem in the coordinates of a basis."""
    system = problem.system
    start = problem.start or State.rest(system.size)
    weight = _weight(system)
    moved, moving = (basis.within(one, weight) for one in (start.displacement - basis.held, start.velocity))
    pushed = None if start.acceleration is None else basis.within(start.acceleration, weight)
    inside = replace(start, displacement=moved, velocity=moving, acceleration=pushed)
    return replace(problem, system=project_system(system, basis), start=inside, basis=None, prune=False)


def integrated_size(problem: Problem) -> int:
    """Return the number of integrated unknowns of a problem."""
    basis = basis_of(problem)
    return problem.system.size if basis is None else basis.size


def method_refusal(problem: Problem, method: Method) -> InputError | None:
    """Return why a method cannot integrate the reduced problem; None if it can."""
    struck = any(force.restitution is not None for force in problem.system.local_forces)
    if type(method).refusal is Method.refusal and not struck:
        return None  # it integrates any system in any unknowns
    basis = basis_of(problem)
    system = problem.system if basis is None else project_system(problem.system, basis)
    light = massless_impact_error(LocalForces(system), MasslessMotions(system)) if struck else None
    return light or method.refusal(system, problem.step)


def _weight(system: System) -> Triplets:
    """Return the mass plus a small part of the stiffness that determines massless unknowns."""
    mass, stiff = system.mass.diagonal(), system.stiffness.diagonal()
    heavy = mass > 0.0
    highest = float((stiff[heavy] / mass[heavy]).max(initial=0.0))
    return system.mass + system.stiffness.scale(1.0 / highest if highest > 0.0 else 1.0)


def expand_block(block: Block, basis: Basis) -> Block:
    """Return a block with fields expanded to all unknowns."""
    fields = block.fields
    moved = basis.expand_saved(fields.displacement)
    if basis.held.any():
        moved = moved + basis.held
    spread: list[FloatArray] = [basis.expand_saved(one) for one in (fields.velocity, fields.acceleration)]
    return replace(block, fields=Series(moved, *spread))
