"""Condensation of a train to a chain of masses by static condensation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexcam.core import DENSE_LIMIT, FloatArray, Triplets
from flexcam.core.errors import refuse
from flexcam.dynamics import ModeBasis, System, project_system
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import CamContact, PublishedLoad
from flexcam.valvetrain.rigid_kinematics import follower_train, moved_nodes
from flexcam.valvetrain.rigid_train import is_independent
from flexcam.valvetrain.springs import condense_spring
from flexcam.valvetrain.strength import Bars, compressed_members, elements_of
from flexcam.valvetrain.structure import Structure, build_structure
from flexcam.valvetrain.system_builder import build_system

_RANK_TOL = 1e-9  # singular value below which a strain-free motion is independent of the kept motions
_ELONGATION_TOLERANCE = 1e-6  # elongation of an element per unit motion below which it is rounding


def static_shapes(system: System, rows: FloatArray) -> FloatArray:
    """Return the static shapes of given motions without other loads."""
    n, m = system.size, len(rows)
    if n > 2 * DENSE_LIMIT:
        given, allowed = f"a model of {n} unknowns", f"up to {2 * DENSE_LIMIT}"
        raise refuse("chain", given, allowed, "mode shapes are dense", "use fewer elements")
    basis = np.linalg.qr(np.zeros((n, 0)) if system.free is None else system.free)[0]
    _, values, vectors = np.linalg.svd(rows @ basis)
    # Motions without strain that no row senses.
    unsensed = basis @ vectors[int(np.count_nonzero(values > _RANK_TOL)) :].T
    constraints = np.concatenate([rows, unsensed.T])
    K = system.stiffness.dense()
    scale = float(np.abs(np.diagonal(K)).max(initial=0.0)) or 1.0
    matrix = np.block([[K / scale, constraints.T], [constraints, np.zeros((len(constraints), len(constraints)))]])
    rhs = np.zeros((n + len(constraints), m))
    rhs[n : n + m] = np.eye(m)
    return np.asarray(np.linalg.solve(matrix, rhs)[:n], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Chain:
    """Train as a chain of masses."""

    system: System  #: its equations: contacts, loads, probes and channels are those of the beam model
    points: tuple[str, ...]  #: name of every mass of the chain, from the follower on
    masses: FloatArray  #: masses of the chain reduced to the follower (with squared rocker ratios), kg, shape (k,)
    stiffnesses: FloatArray  #: stiffnesses between neighbours reduced to the follower, N/m, shape (k - 1,)
    shapes: FloatArray  #: motion of the beam model's unknowns per unknown of the chain, shape (n, m)
    unstrained: tuple[str, ...]  #: members beyond the last kept point, with spring forces but no inertia forces


def build_chain(model: Model, speed: float, count: int, *, lumped: bool = False) -> Chain:
    """Return the train of a model as a chain of masses."""
    model = straighten(model)
    structure, system = build_structure(model), build_system(model, speed)
    if len(model.cam_contacts) != 1:
        given, why = f"{len(model.cam_contacts)} contacts of a cam", "the few masses represent the train of one cam"
        raise refuse("contact", given, "one", why, "choose another model")
    (contact,) = model.cam_contacts.values()
    points = _train(structure, contact)
    if not 1 <= count <= len(points):
        given, why = f"{count} masses", "a mass sits at a node of the train"
        allowed = f"1 to {len(points)}" if len(points) > 1 else "1"
        raise refuse("count", given, allowed, why, "set fidelity.masses, or use more elements in the members")
    step = (len(points) - 1) / max(count - 1, 1)
    chain_points = [points[round(i * step)] for i in range(count)]
    names, rows = _kept_rows(system, chain_points)
    shapes = static_shapes(system, rows)
    reduced = project_system(system, ModeBasis(shapes, tuple(names)))
    motions = rows @ follower_train(structure, contact, "chain").motion
    k = len(chain_points)
    ratios, mass = motions[:k], reduced.mass.dense().copy()
    mass[:k, :k] = np.diag(mass[:k, :k] @ ratios / ratios)  # the same momentum in a rigid motion
    if lumped:
        reduced = replace(reduced, mass=Triplets.from_dense(mass))
    stiffnesses = -np.diagonal(reduced.stiffness.dense()[:k, :k], 1) * ratios[:-1] * ratios[1:]
    bars = {name: Bars(structure, elements_of(structure, name)) for name in compressed_members(structure.model)}
    elongations = {name: np.abs(bar.tension(shapes[:, 1:].T)) / bar.stiffness for name, bar in bars.items()}
    unstrained = tuple(name for name, size in elongations.items() if size.max(initial=0.0) < _ELONGATION_TOLERANCE)
    reduced = without_compression(reduced, unstrained)
    return Chain(reduced, tuple(names[:k]), np.diagonal(mass)[:k] * ratios**2, stiffnesses, shapes, unstrained)


def without_compression(system: System, members: Sequence[str]) -> System:
    """Return a system without the compression channels of some members."""
    names = tuple(f"members.{name}." for name in members)
    return replace(system, channels=tuple(channel for channel in system.channels if not channel.name.startswith(names)))


def straighten(model: Model) -> Model:
    """Return a model without bowing members and with springs of one part."""
    members = {n: replace(member, geometric_stiffness=False, bow=0.0) for n, member in model.members.items()}
    return replace(model, members=members, springs={n: condense_spring(spring) for n, spring in model.springs.items()})


def _kept_rows(system: System, chain_points: Sequence[tuple[str, FloatArray]]) -> tuple[list[str], FloatArray]:
    """Return names and rows of the kept motions: points of the chain, then those of local forces."""
    names, rows = [name for name, _ in chain_points], [row for _, row in chain_points]
    for force in system.local_forces:
        for vector in (*force.sense, *force.act):
            for row in vector.vectors:
                if is_independent(row, rows):
                    names.append(f"{force.name}.{len(rows) - len(chain_points) + 1}")
                    rows.append(row / np.linalg.norm(row))
    return names, np.array(rows)


def _train(structure: Structure, contact: PublishedLoad | CamContact) -> list[tuple[str, FloatArray]]:
    """Return name and row of every point along a train: nodes, rocker points and points after lash."""
    model, direction = structure.model, contact.direction
    if not structure.is_node(contact.follower):
        return [(contact.follower, structure.row(contact.follower, direction))]
    nodes = moved_nodes(model, contact)
    rows = {model.mesh.node_name(node): structure.dofs.vector(node, direction) for node in nodes}
    for rocker in model.rockers.values():
        if rocker.finger or model.mesh.node(rocker.start) not in nodes:
            continue
        point = structure.row(rocker.point, np.zeros(6))
        if not is_independent(point, [row for row in rows.values() if row.any()]):
            del rows[rocker.start]  # the point moves in proportion to it
        rows[rocker.point] = point
    return [(name, row) for name, row in rows.items() if row.any()]
