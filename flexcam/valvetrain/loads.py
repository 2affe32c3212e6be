"""Loads of a model, and the published load of a cam on its follower."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from flexcam.cams import event_extremes
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.dynamics import (
    AngleFunction,
    AngleVector,
    CamMotion,
    Cause,
    Channel,
    ConstantSpeed,
    Load,
    LocalForce,
    Observable,
    RunFailedError,
    constant,
    derivative,
    force_sum,
    load_sum,
    observable_sum,
    spring_damper,
    static_displacement,
)
from flexcam.fem.assembly import assemble_loads, element_weight, thermal_load
from flexcam.valvetrain.cam_contact import fixed_follower_error
from flexcam.valvetrain.coupling import Coupling, constant_history, installed_load
from flexcam.valvetrain.parts import Cam, LoadTable, PublishedLoad
from flexcam.valvetrain.rigid_kinematics import FollowerTrain, follower_train
from flexcam.valvetrain.structure import (
    Structure,
    distribute_load,
    find_node,
    spring_parts,
    spring_row,
    superelement_dofs,
)


def series_stiffness(structure: Structure, contact: PublishedLoad, where: str) -> float:
    """Return K_KE of (22): the static stiffness at the follower along the lift, N/m."""
    push = structure.dofs.vector(find_node(structure.model, contact.follower, where), contact.direction)
    if not push.any():
        raise fixed_follower_error(structure, contact, where)
    try:
        compliance = float(push @ static_displacement(structure.stiffness, push, structure.dofs.names, structure.free))
    except RunFailedError as failure:
        if failure.status.cause is not Cause.SINGULAR:
            raise
        given, why = "a follower without a spring against the lift", str(failure.status.text)
        raise refuse(where, given, "a spring on the follower's train", why, "add it under [springs]") from None
    return 1.0 / compliance


def preload(structure: Structure, contact: PublishedLoad, train: FollowerTrain, cam: Cam, speed: float) -> float:
    """Return the preload at the follower, N."""
    if springs := given_forces(structure, train):
        force = sum(float(train.motion @ row) * size for size, row in springs)
        if force <= 0.0:
            given, why = f"springs that pull the follower with {-force:g} N", "contact needs a force against the lift"
            raise refuse("springs", given, "installed forces that close the contact", why, "reverse a spring")
        return force
    deceleration = -event_extremes(cam.event, 2)[0].value * speed**2
    return contact.preload_factor * train.mass * deceleration


def given_forces(structure: Structure, train: FollowerTrain) -> list[tuple[float, FloatArray]]:
    """Return installed force and row of the springs on a follower's train with a given installed force."""
    rows = [(s.installed_force, spring_row(structure, n, s)) for n, s in structure.model.springs.items()]
    return [(size, row) for size, row in rows if size and train.moves(row)]


@lru_cache(maxsize=16)
def _at_any_speed(structure: Structure, name: str, contact: PublishedLoad) -> tuple[FollowerTrain, float]:
    """Return the quantities independent of speed: the follower's train and the stiffness K_KE."""
    where = f"contacts.{name}.follower"
    return follower_train(structure, contact, where), series_stiffness(structure, contact, where)


def couple_published_load(structure: Structure, name: str, contact: PublishedLoad, speed: float) -> Coupling:
    """Return the coupling of the published load of one cam and its follower."""
    cam = structure.model.cams[contact.cam]
    train, K = _at_any_speed(structure, name, contact)
    force = preload(structure, contact, train, cam, speed)
    push, twist = structure.push(name), -structure.row(cam.at, contact.rotation)
    arm = derivative(cam.event)

    def torque(motion: CamMotion) -> FloatArray:
        return (force + K * motion.cam(cam.event, 0)) * motion.cam(cam.event, 1)

    loads = [Load(f"contacts.{name}.lift", push, lambda motion: K * motion.cam(cam.event, 0))]
    preloaded = push - spring_share(structure, train)
    loads.append(installed_load(f"contacts.{name}.preload", preloaded, force))
    if contact.cam_torque:
        loads.append(Load(f"contacts.{name}.torque", twist, torque))
    local: tuple[LocalForce, ...] = ()
    if contact.cam_deflection:
        act = AngleVector.constant(push)
        if contact.cam_torque:
            act = AngleVector(np.array([push, twist]), (constant(1.0), arm))
        sense = AngleVector.constant(structure.row(cam.at, contact.direction))
        local = (LocalForce(f"contacts.{name}", (sense,), (act,), spring_damper(K), (constant(0.0),)),)

    def total(factor: AngleFunction | None = None) -> Observable:
        return observable_sum(load_sum(0, 1, factor=factor), *[force_sum(0, factor=factor)] if local else [])

    return Coupling(tuple(loads), local, (
        Channel(f"contacts.{name}.force", "N", total()),
        Channel(f"contacts.{name}.torque", "N m", total(arm)),
    ))  # fmt: skip


def spring_share(structure: Structure, train: FollowerTrain) -> FloatArray:
    """Return the vector of the springs' installed forces that balances a unit force at the follower.

    The force is distributed like the given installed forces, or like the stiffnesses without any.
    """
    shares = given_forces(structure, train)
    if not shares:
        rows = [(s.stiffness, spring_row(structure, n, s)) for n, s in structure.model.springs.items()]
        shares = [(k * float(train.motion @ row), row) for k, row in rows]
    total = sum(size * float(train.motion @ row) for size, row in shares)
    share = sum((size * row for size, row in shares), np.zeros(structure.dofs.size))
    return share / total if total > 0.0 else share


@lru_cache(maxsize=4)
def given_loads(structure: Structure) -> tuple[Load, ...]:
    """Return weight, thermal loads, installed forces and given loads; given loads act only from the start of a run."""
    model = structure.model
    loads: list[Load] = []
    for name, load in model.loads.items():
        table, size = (load.size, 1.0) if isinstance(load.size, LoadTable) else (None, load.size)
        if load.member is not None:
            vector = assemble_loads(structure.beams, distribute_load(structure, name), structure.dofs)
        else:
            vector = size * structure.row(load.at or "", load.direction, f"loads.{name}.at")
        loads.append(Load(f"loads.{name}", vector, table or constant_history(1.0), steady=table is None))
    published = [  # their preload includes the installed forces of the springs on their trains
        follower_train(structure, contact, f"contacts.{name}.follower")
        for name, contact in model.cam_contacts.items()
        if isinstance(contact, PublishedLoad)
    ]
    for name, spring in model.springs.items():
        row = spring_row(structure, name, spring)
        if spring.installed_force and not any(train.moves(row) for train in published):
            loads.append(installed_load(f"springs.{name}", -row, spring.installed_force))
    if any(model.gravity):
        loads.append(installed_load("gravity", _weight(structure)))
    if structure.beams.thermal.any():
        expanded = assemble_loads(structure.beams, thermal_load(structure.beams), structure.dofs)
        loads.append(installed_load("thermal", expanded))
    return tuple(loads)


def steady_load(loads: Iterable[Load], size: int) -> FloatArray:
    """Return the sum of the constant ones of some loads, shape (size,)."""
    instant = ConstantSpeed(1.0).at(np.zeros(1))
    return sum((float(load.history(instant)[0]) * load.vector for load in loads if load.steady), np.zeros(size))


def _weight(structure: Structure) -> FloatArray:
    """Return the weight of members, superelements, bodies at nodes and springs.

    Masses at a rocker's point are excluded because a lumped rocker does not define the direction of its valve.
    """
    model, gravity = structure.model, np.array(structure.model.gravity)
    load = assemble_loads(structure.beams, element_weight(structure.beams, gravity), structure.dofs)
    for name, mass in model.masses.items():
        if mass.at not in model.rocker_points:
            weight = mass.body.matrix() @ np.concatenate([gravity, np.zeros(3)])
            load = load + structure.dofs.vector(find_node(model, mass.at, f"masses.{name}.at"), weight)
    for name, body in model.superelements.items():
        acceleration = np.zeros(len(body.mass))
        acceleration[: 6 * len(body.nodes)] = np.tile([*gravity, 0.0, 0.0, 0.0], len(body.nodes))
        numbers = superelement_dofs(structure, name)
        np.add.at(load, numbers[numbers >= 0], (body.mass @ acceleration)[numbers >= 0])
    for name, spring in model.springs.items():
        if spring.mass > 0.0 and spring.at not in model.rocker_points:
            component = float(gravity @ spring.direction[:3])
            parts = zip(spring.parts, spring_parts(structure, name, spring), strict=True)
            load = load + sum(0.5 * (part.mass * component) * (low + high) for part, (low, high) in parts)
    return load
