"""Camshaft: twist and deflection at the cams, rotary inertia, drive and free running."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from flexcam.cams import Event
from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.dynamics import (
    AngleFunction,
    CamMotion,
    Channel,
    Load,
    Observation,
    Phaser,
    SpeedByAngle,
    row_of,
)
from flexcam.fem.assembly import to_global
from flexcam.fem.dofs import ROTATIONS
from flexcam.fem.elements import beam
from flexcam.valvetrain.coupling import Coupling
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Cam, CamPair, Lash
from flexcam.valvetrain.structure import Structure


def shaft_channels(structure: Structure) -> Coupling:
    """Return the channels of the camshafts."""
    model = structure.model
    channels: list[Channel] = []
    inertias: dict[int, Load] = {}
    for contact in model.cam_contacts.values():
        point, nodes = model.cams[contact.cam].at, _shaft_nodes(model, contact.cam)
        if int(nodes[0]) not in inertias:
            inertias[int(nodes[0])] = _inertia(structure, nodes, contact.rotation, model.cams[contact.cam].phaser)
        if model.mesh.on_members()[model.mesh.node(point)]:
            channels += [
                Channel(f"cams.{contact.cam}.twist", "rad", row_of(structure.row(point, contact.rotation))),
                Channel(f"cams.{contact.cam}.deflection", "m", row_of(structure.row(point, contact.direction))),
            ]
    channels += [channel for name in model.springs for channel in _drive_torque(structure, name)]
    return Coupling(tuple(inertias.values()), (), tuple(channels))


def _drive_torque(structure: Structure, name: str) -> Iterator[Channel]:
    """Yield the torque of a spring that drives a shaft, such as a chain: its other end turns at the camshaft speed."""
    spring, mesh = structure.model.springs[name], structure.model.mesh
    if not spring.turns or spring.to is not None or spring.at not in mesh.points:
        return
    axis = shaft_axes(structure.model).get(mesh.node(spring.at))
    if axis is None or abs(float(axis @ spring.direction[3:])) < PARALLEL:
        return
    row = structure.row(spring.at, np.concatenate([np.zeros(3), axis]))[None]
    installed = math.copysign(spring.installed_force or 0.0, float(axis @ spring.direction[3:]))

    def torque(obs: Observation) -> FloatArray:
        twist, rate = (obs.moved.extract(row, order)[:, 0] for order in range(2))
        return -installed - spring.stiffness * twist - spring.damping * rate

    yield Channel(f"springs.{name}.torque", "N m", torque)


def _inertia(structure: Structure, nodes: IntArray, rotation: FloatArray, phaser: Phaser | None) -> Load:
    """Return the load of a shaft's rotary inertia at variable speed: unknowns are relative to the rotation."""
    dofs, mesh = structure.dofs, structure.model.mesh
    beams = structure.beams.part(np.flatnonzero(np.isin(structure.beams.nodes[:, 0], nodes)))
    motion = np.tile(rotation, (len(mesh.nodes), 1))
    if dofs.ties is not None:  # a node beside the axis that follows the shaft moves on a circle
        motion = np.where(dofs.ties.tied, dofs.ties.matrices @ rotation, motion)
    forces = np.einsum("eij,ej->ei", to_global(beams, beam.mass(beams)), motion[beams.nodes].reshape(-1, 12))
    vector = dofs.gather(beams.nodes, forces.reshape(-1, 2, 6))
    for mass in structure.model.masses.values():
        if structure.is_node(mass.at) and (node := mesh.node(mass.at)) in nodes:
            vector += dofs.vector(node, mass.body.matrix() @ motion[node])

    def rate(motion: CamMotion) -> FloatArray:
        return motion.rate if phaser is None else phaser.motion(motion).rate

    return Load(f"shaft of {mesh.node_name(int(nodes[0]))}", -vector, rate)


PARALLEL = 0.9
"""Cosine above which an axis is that of the shaft."""


@lru_cache(maxsize=4)
def rotation_supports(model: Model) -> tuple[tuple[str, int, FloatArray], ...]:
    """Return name, node and axis of the supports that hold the rotation of a shaft."""
    supports, axes = list[tuple[str, int, FloatArray]](), shaft_axes(model)
    for point, components in model.supports.items():
        nodes = model.mesh.select(point).tolist()
        for node in nodes:
            direction = axes.get(node, np.zeros(3))
            axis = int(np.argmax(np.abs(direction)))
            if abs(float(direction[axis])) > PARALLEL and ROTATIONS[axis] in components:
                name = point if len(nodes) == 1 else model.mesh.node_name(node)
                supports.append((name, node, direction))
    return tuple(supports)


def has_elastic_drive(structure: Structure, contact: CamPair) -> bool:
    """Return whether springs or lash, not a support, hold the rotation of a cam: it may then twist by degrees."""
    model, point = structure.model, structure.model.cams[contact.cam].at
    nodes = set(model.mesh.connected_nodes(model.mesh.node(point), turning=True).tolist())
    supported = any(node in nodes for _, node, _ in rotation_supports(model))
    return not supported and bool(structure.row(point, contact.rotation).any())


_ROUNDING = 1e-9
"""Rotation by a free motion of size 1 that is rounding, rad."""


def undriven_shafts(structure: Structure) -> list[tuple[list[str], str, bool]]:
    """Return cams and rotation (``rx``) of every shaft that can turn or move away, and whether it can move away."""
    model, shafts = structure.model, dict[tuple[int, ...], tuple[list[str], str, bool]]()
    for contact in model.cam_contacts.values():
        point = model.cams[contact.cam].at
        shaft = tuple(model.mesh.connected_nodes(model.mesh.node(point), turning=True).tolist())
        turns, away = (
            float(np.abs(structure.row(point, axis) @ structure.free).max(initial=0.0)) > _ROUNDING
            for axis in (contact.rotation, contact.direction)
        )
        away = away and not model.bearings
        if away or (turns and len(_shaft_nodes(model, contact.cam)) == len(shaft)):
            rotation = ROTATIONS[int(np.argmax(np.abs(contact.shaft_axis)))]
            cams, *_ = shafts.setdefault(shaft, ([], rotation, away))
            cams += [contact.cam] if contact.cam not in cams else []
    return list(shafts.values())


def shaft_axes(model: Model) -> dict[int, FloatArray]:
    """Return the axis of rotation at every node of a camshaft."""
    axes: dict[int, FloatArray] = {}
    for contact in model.cam_contacts.values():
        nodes = _shaft_nodes(model, contact.cam)
        axes |= dict.fromkeys(nodes.tolist(), contact.shaft_axis)
    return axes


def driven_cam(model: Model, torque: str) -> Cam | None:
    """Return a cam of the shaft on which a torque acts, such as ``supports.drive`` or ``springs.chain``."""
    kind, _, name = torque.partition(".")
    if kind == "contacts":
        return model.cams[model.cam_contacts[name].cam]
    point = model.springs[name].at if kind == "springs" else name
    nodes = set(model.mesh.select(point).tolist()) if point in model.mesh.points else set[int]()
    cams = (contact.cam for contact in model.cam_contacts.values())
    return next((model.cams[cam] for cam in cams if nodes & set(_shaft_nodes(model, cam).tolist())), None)


def _shaft_nodes(model: Model, cam: str) -> IntArray:
    """Return the nodes that turn with a cam: those of its shaft, and those of its drive behind lash about an axis."""
    mesh = model.mesh
    nodes = set(mesh.connected_nodes(mesh.node(model.cams[cam].at), turning=True).tolist())
    lashes = (lash.ends for lash in model.contacts.values() if isinstance(lash, Lash) and lash.turns and lash.ends)
    pairs = [{mesh.node(end) for end in ends} for ends in lashes]
    while added := {node for pair in pairs if pair & nodes for node in pair} - nodes:
        nodes.update(*(mesh.connected_nodes(node, turning=True).tolist() for node in added))
    return np.array(sorted(nodes), dtype=np.intp)


def free_running(
    model: Model, speed: float, cam: str, cam_mass: float, follower_mass: float, start: float = 0.0, time: float = 0.0
) -> SpeedByAngle:
    """Return the drive of a freely running cam."""
    if cam not in model.cams:
        allowed = f"one of {', '.join(model.cams)}"
        raise refuse("run.free_running.cam", repr(cam), allowed, remedy=suggest_name(cam, model.cams))
    part = model.cams[cam]
    if part.follower is None:
        why = "the inertia of the cam follows from its base circle"
        remedy = f"add {' and '.join(part.missing)}"
        raise refuse(f"cams.{cam}", "no base circle", "base_radius and follower", why, remedy)
    omega = free_speed(part.event, part.follower.base_radius, speed, cam_mass, follower_mass)
    return SpeedByAngle(omega, start, time)


def free_speed(event: Event, base_radius: float, speed: float, cam_mass: float, follower_mass: float) -> AngleFunction:
    """Return the speed of a freely running cam over its angle."""
    r0, mean = base_radius, 0.5 * cam_mass * (base_radius + event.height) ** 2

    def inertia(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        s, slope, bend = (event(angle, order) for order in range(3))
        disc = 0.5 * cam_mass * (r0**2 + 4.0 * r0 * s + 2.0 * s**2)
        return disc + follower_mass * slope**2, 2.0 * slope * (cam_mass * (r0 + s) + follower_mass * bend)

    def omega(angle: FloatArray, order: int) -> FloatArray:
        J, change = inertia(angle)
        value = speed * np.sqrt(mean / J)
        return value if order == 0 else -0.5 * value * change / J

    return omega
