"""Reactions of supports, from the equations of motion with the held components of a node released."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache, lru_cache, partial

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics import Channel, Observable, Observation
from flexcam.fem.assembly import rayleigh_damping
from flexcam.fem.dofs import COMPONENTS
from flexcam.valvetrain.camshaft import rotation_supports
from flexcam.valvetrain.coupling import Coupling
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import PublishedLoad
from flexcam.valvetrain.structure import Structure, build_structure_in

Terms = Sequence[tuple[Coupling, Callable[[Observation], Observation]]]
"""Couplings of a system with their parts of its observation."""


def support_channels(
    structure: Structure, terms: Terms, couple: Callable[[Structure], Sequence[Coupling]]
) -> Iterator[Channel]:
    """Yield the torques of supports that hold the rotation of a shaft, and the reactions of the requested supports.

    `terms` begin with the contacts of the model; `couple` returns the couplings of another structure in their order.
    """
    for name, node, axis in rotation_supports(structure.model):
        held = np.flatnonzero((axis != 0.0) & ~structure.dofs.moving[node, 3:])
        torque = _Reaction(partial(_balance, structure, terms, couple, node, 3 + held))
        yield Channel(f"supports.{name}.torque", "N m", _combine(torque, axis[held]))
    for node, (name, held) in _requested_nodes(structure.model).items():
        reaction = _Reaction(partial(_balance, structure, terms, couple, node, held))
        if (forces := np.flatnonzero(held < 3)).size:
            yield Channel(f"supports.{name}.force", "N", _magnitude(reaction, forces))
        for i, component in enumerate(held.tolist()):
            kind, si_unit = ("force", "N") if component < 3 else ("moment", "N m")
            yield Channel(
                f"supports.{name}.{kind}_{'xyz'[component % 3]}", si_unit, _combine(reaction, np.eye(len(held))[i])
            )


def _requested_nodes(model: Model) -> dict[int, tuple[str, IntArray]]:
    """Return the nodes of the requested supports with their names and held components; a node has one name."""
    requested = dict[int, tuple[str, IntArray]]()
    for point in model.reactions:
        nodes = model.mesh.select(point).tolist()
        for node in nodes:
            name, held = requested.get(node, (point if len(nodes) == 1 else model.mesh.node_name(node), ()))
            held = {*held, *(COMPONENTS.index(component) for component in model.supports[point])}
            requested[node] = name, np.array(sorted(held))
    return requested


class _Reaction:
    """Force of a support on a node along k components, shape (m, k), built at its first use, for several channels."""

    def __init__(self, build: Callable[[], Observable]) -> None:
        self._build = cache(build)  # it takes a second structure
        self._last: tuple[Observation, FloatArray] | None = None

    def __call__(self, obs: Observation) -> FloatArray:
        if self._last is None or self._last[0] is not obs:
            self._last = obs, self._build()(obs)
        return self._last[1]


def _combine(reaction: _Reaction, factors: FloatArray) -> Observable:
    return lambda obs: reaction(obs) @ factors


def _magnitude(reaction: _Reaction, columns: IntArray) -> Observable:
    return lambda obs: np.linalg.norm(reaction(obs)[:, columns], axis=1)


@lru_cache(maxsize=4)
def _release(structure: Structure, node: int) -> tuple[Structure, IntArray]:
    """Return the structure with the held components of a node released, and the indices of the others in it."""
    held = np.flatnonzero(~structure.dofs.moving[node])
    dofs = structure.dofs.release(node, held, structure.model.mesh.node_name(node))
    return build_structure_in(structure.model, dofs), np.delete(np.arange(dofs.size), dofs.numbers[node, held])


def _balance(
    structure: Structure, terms: Terms, couple: Callable[[Structure], Sequence[Coupling]], node: int, held: IntArray
) -> Observable:
    """Return the force of the support of a node along some held components.

    It balances inertia, damping without modal damping, stiffness, loads and local forces of the released structure.
    """
    released, kept = _release(structure, node)
    rows = np.array([released.dofs.vector(node, motion) for motion in np.eye(6)[held]])
    damping = released.model.damping
    damped = released.dampers + rayleigh_damping(released.mass, released.stiffness, damping.alpha, damping.beta)
    matrices = released.stiffness, damped, released.mass
    passive = [np.array([matrix.times(row)[kept] for row in rows]) for matrix in matrices]
    applied = [
        (part, _applied_force(coupling, rows))
        for (_, part), coupling in zip(terms, couple(released), strict=True)
        if coupling.loads or coupling.forces
    ]
    for (coupling, part), (name, contact) in zip(terms, released.model.contacts.items(), strict=False):
        if isinstance(contact, PublishedLoad):
            twist = -contact.cam_torque * released.row(released.model.cams[contact.cam].at, contact.rotation)
            applied.append((part, _published_force(coupling, rows @ np.array([released.push(name), twist]).T)))

    def force(obs: Observation) -> FloatArray:
        total: FloatArray = np.sum([obs.moved.extract(row, order) for order, row in enumerate(passive)], axis=0)
        return total - np.sum([along(part(obs)) for part, along in applied], axis=0)

    return force


def _applied_force(coupling: Coupling, rows: FloatArray) -> Observable:
    """Return the force of loads and local forces of a coupling along k motions, shape (m, k), without its vectors."""
    by_load = np.array([load.vector @ rows.T for load in coupling.loads]).reshape(-1, len(rows))
    acts = enumerate(act for force in coupling.forces for act in force.act)
    acting = [(i, act.functions, arms) for i, act in acts if (arms := act.vectors @ rows.T).any()]

    def force(obs: Observation) -> FloatArray:
        total = obs.histories @ by_load
        for i, functions, arms in acting:
            weights = [obs.cam(function, 0) for function in functions] or [np.ones(len(total))]
            total += obs.forces[:, i, None] * (np.array(weights).T @ arms)
        return total

    return force


def _published_force(coupling: Coupling, arms: FloatArray) -> Observable:
    """Return the force of a published load along k motions from the arms of its force and its torque, shape (k, 2)."""
    return lambda obs: np.column_stack([channel.value(obs) for channel in coupling.channels]) @ arms.T
