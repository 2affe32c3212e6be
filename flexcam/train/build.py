"""From a model to its equations: the flexible system and the rigid one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from flexcam import modal
from flexcam.checks import refuse
from flexcam.fem import COMPONENTS
from flexcam.fem.damping import modal_damping, rayleigh_damping
from flexcam.linalg import DENSE_LIMIT, FloatArray, Triplets
from flexcam.system import AngleFunction, CamMotion, Channel, Load, Observable, Probe, System, load_sum
from flexcam.train.bowing import bowings
from flexcam.train.cam_contact import couple_cam
from flexcam.train.contacts import clashes, couple_lash, couple_seat
from flexcam.train.coupling import Coupling
from flexcam.train.loads import constant_loads
from flexcam.train.model import CamContact, Contact, Lash, Model, PublishedLoad, Seat
from flexcam.train.published import couple, follower_train, preload, stated_force, steady
from flexcam.train.structure import Structure, build_structure, find_node, inner_name

_MODAL_LIMIT = 2 * DENSE_LIMIT
"""Unknowns up to which all modes are computed."""


def build_system(model: Model, speed: float) -> System:
    """Return the equations of the flexible mechanism.

    Parameters
    ----------
    model
        The model.
    speed
        Camshaft speed, rad/s: the preload of a published load depends on it.

    Returns
    -------
    System
        Everything the integrator needs.

    Raises
    ------
    InputError
        If a part is attached to something that does not exist, or nothing resists the lift.
    """
    structure = build_structure(model)
    couplings = [_coupled(structure, name, contact, speed) for name, contact in model.contacts.items()]
    couplings += [clashes(structure), bowings(structure)]
    return System(
        mass=structure.mass,
        damping=structure.dampers + _damping(structure),
        stiffness=structure.stiffness,
        names=structure.dofs.names,
        loads=(*(load for c in couplings for load in c.loads), *constant_loads(structure)),
        local_forces=tuple(force for c in couplings for force in c.forces),
        probes=(*(_probe(structure, point) for point in model.probes), *_inner_probes(structure)),
        channels=tuple(_numbered(couplings)),
        free=structure.free,
    )


def _coupled(structure: Structure, name: str, contact: Contact, speed: float) -> Coupling:
    match contact:
        case PublishedLoad():
            return couple(structure, name, contact, speed)
        case CamContact():
            return couple_cam(structure, name, contact)
        case Seat():
            return couple_seat(structure, name, contact)
        case Lash():
            return couple_lash(structure, name, contact)


def _damping(structure: Structure) -> Triplets:
    given = structure.model.damping
    matrix = rayleigh_damping(structure.mass, structure.stiffness, given.alpha, given.beta)
    if given.modal == 0.0:
        return matrix
    if structure.dofs.size > _MODAL_LIMIT:
        why = "every mode of the model takes part, and the matrix is full"
        given, remedy = f"modal damping of {structure.dofs.size} unknowns", "use damping = { alpha = ..., beta = ... }"
        raise refuse("run.damping.modal", given, f"up to {_MODAL_LIMIT} unknowns", why, remedy)
    modes = modal.modes(structure.mass, structure.stiffness, free=structure.free)
    return matrix + modal_damping(structure.mass, modes.shapes, modes.omegas, given.modal)


def _numbered(couplings: Iterable[Coupling]) -> Iterable[Channel]:
    """Yield the channels, each shown what concerns its own coupling."""
    loads = scalars = states = 0
    for coupling in couplings:
        sizes = [(len(f.sense), len(f.law.start_state)) for f in coupling.forces]
        ends = loads + len(coupling.loads), scalars + sum(c for c, _ in sizes), states + sum(s for _, s in sizes)
        own = slice(loads, ends[0]), slice(scalars, ends[1]), slice(states, ends[2])
        yield from (replace(channel, value=_within(channel.value, *own)) for channel in coupling.channels)
        loads, scalars, states = ends


def _within(value: Observable, loads: slice, scalars: slice, states: slice) -> Observable:
    return lambda seen: value(seen.part(loads, scalars, states))


def _probe(structure: Structure, point: str) -> Probe:
    if structure.model.rocker_at(point) is not None:
        return Probe(point, (point,), structure.row(point, np.zeros(6))[None, :], (None,))
    node = find_node(structure.model, point, "output.probes")
    rows = np.array([structure.dofs.vector(node, unit) for unit in np.eye(6)])
    return Probe(point, COMPONENTS, rows, (None,) * 6)


def _inner_probes(structure: Structure) -> list[Probe]:
    """Return probes of the unknowns that no node shows: loose points and the inner parts of springs.

    Results then hold every unknown, so that a run can go on from them.
    """
    model = structure.model
    loose = [_probe(structure, point) for point in model.loose_points if point not in model.probes]
    springs = [(name, spring) for name, spring in model.springs.items() if spring.elements > 1]
    inner = [
        Probe(
            f"springs.{name}", tuple(str(i) for i in range(1, spring.elements)),
            np.array([structure.dofs.unit(inner_name(name, i)) for i in range(1, spring.elements)]),
            (None,) * (spring.elements - 1),
        )
        for name, spring in springs
    ]  # fmt: skip
    return loose + inner


def build_rigid(model: Model, speed: float) -> System:
    """Return the same mechanism with rigid members: no unknowns, the follower's train follows the lift.

    Parameters
    ----------
    model
        The model.
    speed
        Camshaft speed, rad/s.

    Returns
    -------
    System
        Of size zero; its probes are prescribed, its channels hold the contact force
        ``P_pr + K s + M (s'' omega^2 + s' omega')`` and the torque of that force.

    Raises
    ------
    InputError
        As `build_system`.
    """
    structure = build_structure(model)
    loads: list[Load] = []
    channels: list[Channel] = []
    for name, contact in model.driven.items():
        event = model.cams[contact.cam].event
        train = follower_train(structure, contact, f"contacts.{name}.follower")
        if isinstance(contact, PublishedLoad):
            force = preload(structure, contact, train, model.cams[contact.cam], speed)
        else:
            force = stated_force(structure, train)
        parts = (_scaled(event, train.stiffness), steady(force), _inertia(train.mass, event))
        places = tuple(range(len(loads), len(loads) + len(parts)))
        loads += [Load(f"contacts.{name}", np.zeros(0), part) for part in parts]
        channels += [
            Channel(f"contacts.{name}.force", "N", load_sum(*places)),
            Channel(f"contacts.{name}.torque", "N m", load_sum(*places, factor=_slope(event))),
        ]
    nothing = Triplets.zeros(0)
    probes = tuple(_rigid_probe(structure, _probe(structure, point)) for point in model.probes)
    return System(nothing, nothing, nothing, (), tuple(loads), (), probes, tuple(channels))


def _scaled(event: AngleFunction, factor: float) -> Callable[[CamMotion], FloatArray]:
    return lambda motion: factor * event(motion.angle, 0)


def _inertia(mass: float, event: AngleFunction) -> Callable[[CamMotion], FloatArray]:
    return lambda motion: mass * (event(motion.angle, 2) * motion.speed**2 + event(motion.angle, 1) * motion.rate)


def _slope(event: AngleFunction) -> AngleFunction:
    return lambda angle, order: event(angle, order + 1)


def _rigid_probe(structure: Structure, probe: Probe) -> Probe:
    """Return the probe as the rigid train moves it: its share of every follower's motion times that cam's lift."""
    shares: list[tuple[np.ndarray, AngleFunction]] = []
    for name, contact in structure.model.driven.items():
        train = follower_train(structure, contact, f"contacts.{name}.follower")
        shares.append((probe.rows @ train.motion, structure.model.cams[contact.cam].event))
    rocker = structure.model.loose_points.get(probe.name)
    names = [name for name, one in structure.model.rockers.items() if one is rocker]
    play = structure.model.lash_of(names[0]) if names else None
    gap = play.gap if play else 0.0
    offsets = tuple(_combined([(float(s[i]), event) for s, event in shares], gap) for i in range(len(probe.components)))
    return Probe(probe.name, probe.components, np.zeros((len(probe.components), 0)), offsets)


def _combined(parts: list[tuple[float, AngleFunction]], gap: float) -> AngleFunction | None:
    """Return the sum of shares of lifts, or None where there are none; a play is taken up before anything moves."""
    moving = [(share, event) for share, event in parts if share != 0.0]
    if not moving:
        return None

    def lifted(angle: FloatArray, order: int) -> FloatArray:
        total = sum((share * event(angle, order) for share, event in moving), np.zeros_like(angle))
        if gap == 0.0:
            return total
        lift = total if order == 0 else sum((k * event(angle, 0) for k, event in moving), np.zeros_like(angle))
        return np.where(lift > gap, total - (gap if order == 0 else 0.0), 0.0)

    return lifted
