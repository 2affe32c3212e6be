"""Rigid model of a mechanism: contact forces by virtual work, with loads, nonlinear springs and friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from flexcam.cams import Event, event_extremes
from flexcam.core import FloatArray, Triplets
from flexcam.core.errors import refuse
from flexcam.dynamics import (
    AngleFunction,
    AngleVector,
    CamFunctionCache,
    CamMotion,
    Channel,
    DerivedCamFunction,
    ForceLaw,
    Load,
    Observation,
    PrescribedMotion,
    Probe,
    System,
    constant,
    derivative,
    load_sum,
    modes,
    observable_sum,
)
from flexcam.dynamics.force_laws import STOP
from flexcam.dynamics.local_forces import LocalForces
from flexcam.fem.assembly import modal_damping
from flexcam.valvetrain.cam_contact import lubrication_channels, sliding_path
from flexcam.valvetrain.cam_functions import cam_sliding, normal_force_ratio, sliding_distance
from flexcam.valvetrain.contacts import check_lever_rotation, couple_friction
from flexcam.valvetrain.coupling import opposed_force
from flexcam.valvetrain.loads import given_loads, preload, steady_load
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import CamContact, PublishedLoad, Spring
from flexcam.valvetrain.rigid_kinematics import Body, Coordinate, divide_train, find_rest
from flexcam.valvetrain.spring_properties import condense_spring, spring_curve
from flexcam.valvetrain.springs import couple_springs, force_unit, has_channels
from flexcam.valvetrain.structure import Structure, build_structure, probe_of, spring_parts, spring_row
from flexcam.valvetrain.train_topology import follower_train


@dataclass(frozen=True, eq=False)
class TrainLaw:
    """Law of a spring's parts or of friction along the motions of a train."""

    name: str  #: such as ``springs.valve.clash``
    law: LocalForces  #: forces of the parts, stacked, as in the flexible train
    rows: FloatArray  #: path of each part per motion, shape (c, b)
    offset: AngleFunction  #: prescribed part of the compression
    stops: bool  #: whether the law is coil clash

    def force(self, moved: FloatArray, rate: FloatArray, cam: CamFunctionCache) -> FloatArray:
        """Return the forces against some motions with their rates, shape (m, b) each, by virtual work."""
        pressed = self.compression(moved, cam)
        if self.stops and float(pressed.max(initial=0.0)) <= 0.0:  # no coils touch
            return np.zeros_like(moved)
        rates = rate @ self.rows.T
        functions = self.law.function_values(cam)
        return self.law.evaluate(pressed, np.zeros((len(pressed), 0)), functions, rate=rates)[1] @ self.rows

    def compression(self, moved: FloatArray, cam: CamFunctionCache) -> FloatArray:
        """Return the compression of each part, m, shape (m, c), for the arguments of `force`."""
        return moved @ self.rows.T + cam(self.offset, 0)[:, None]


def train_laws(structure: Structure, motions: FloatArray) -> tuple[TrainLaw, ...]:
    """Return the nonlinear laws of the springs and the friction in a train."""
    found: list[TrainLaw] = []
    for force in (*couple_springs(structure).forces, *couple_friction(structure).forces):
        rows = np.array([sensed.vectors[0] for sensed in force.sense]) @ motions.T
        if rows.any() and isinstance(force.law, ForceLaw):
            offset, stops = force.offset[0], force.law.kind == STOP
            found.append(TrainLaw(force.name, _identity_law(force.name, force.law, len(rows)), rows, offset, stops))
    return tuple(found)


def _identity_law(name: str, law: ForceLaw, count: int) -> LocalForces:
    """Return the law for scalars that are unknowns themselves."""
    none = Triplets.zeros(count)
    force = opposed_force(name, np.eye(count), law)
    return LocalForces(System(none, none, none, ("",) * count, local_forces=(force,)))


History = Callable[[CamMotion], FloatArray]

_JAM_ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)  # cam angles at which jamming is checked


@dataclass(frozen=True, eq=False)
class RigidFriction:
    """Friction mu f tanh(v/v0) at a contact force f and sliding velocity v.

    The train needs a force along its lift. If the face moves along itself during lift (a swinging face offset from its
    pivot), by a per lift, friction carries a part of it: ``f - a T = needed`` with ``T = mu f tanh(v/v0)``, so that ``f
    = needed/(1 - a mu tanh(v/v0))``: virtual work of what `flexcam.valvetrain.cam_contact` senses.
    """

    event: Event  #: lift of the cam
    #: `coefficient`, `speed`: mu, and v0 in m/s
    coefficient: float
    speed: float
    shares: FloatArray  #: factors of the follower's motion for each of `along`, shape (k,)
    along: tuple[AngleFunction, ...]  #: functions of the path along the face
    slid: AngleFunction  #: sliding path with the follower fixed, m; its derivative is used

    def force(self, needed: History) -> History:
        """Return the contact force, N, from the force required along the lift."""
        return lambda motion: needed(motion) / (1.0 - self._per_lift(motion.cam) * self._share(motion))

    def jams(self) -> bool:
        """Return whether the follower jams: friction carries the required force at some angle."""
        cam = CamFunctionCache(_JAM_ANGLES)
        return bool((self.coefficient * self._per_lift(cam) * np.sign(self._path(cam)) >= 1.0).any())

    def friction(self, needed: History) -> History:
        """Return friction divided by the reach, N, as in the contact laws."""
        force = self.force(needed)
        return lambda motion: self._share(motion) * force(motion)

    def _per_lift(self, cam: CamFunctionCache) -> FloatArray:
        parts = (share * cam(one, 0) for share, one in zip(self.shares, self.along, strict=True) if share)
        return sum(parts, np.zeros_like(cam.angle))

    def _path(self, cam: CamFunctionCache) -> FloatArray:
        """Return the sliding path per cam angle, m."""
        return self._per_lift(cam) * cam(self.event, 1) + cam(self.slid, 1)

    def _share(self, motion: CamMotion) -> FloatArray:
        return self.coefficient * np.tanh(self._path(motion.cam) * motion.speed / self.speed)


def rigid_friction(structure: Structure, name: str, contact: CamContact, moved: FloatArray) -> RigidFriction:
    """Return the friction of a contact in the rigid train."""
    cam = structure.model.cams[contact.cam]
    path = sliding_path(structure, name, contact, cam)
    speed, slid = contact.friction_speed, sliding_distance(cam)
    found = RigidFriction(cam.event, contact.friction, speed, path.vectors @ moved, path.functions, slid)
    if found.jams():
        allowed, why = "a friction at which the face slides", "friction alone would hold the rigid follower: it jams"
        remedy = "lower it, or place the pivot nearer to the line of the face"
        raise refuse(f"contacts.{name}.friction", contact.friction, allowed, why, remedy)
    return found


@dataclass(frozen=True, eq=False)
class RigidTrain:
    """Train of a follower as motions times coordinates that are functions of the lift."""

    #: shape (b, n): the first is everything that moves in proportion to the lift, then the ends of levers
    motions: FloatArray
    coordinates: tuple[Coordinate, ...]  #: one per motion
    #: `mass`, `damping`, `stiffness`: of these motions, shape (b, b); springs, dampers, Rayleigh and modal damping
    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    force: FloatArray  #: of the installed springs, the weight and the constant loads along them, N, shape (b,)
    bodies: FloatArray  #: bodies between lash: relative motions as installed, shape (g, b)
    #: force of each body at the follower on the base circle, N, shape (g,), if a seat supports it; else NaN
    standing: FloatArray
    laws: tuple[TrainLaw, ...]  #: nonlinear laws of springs and friction
    #: loads from tables: what each acts with along the motions per unit, shape (b,), and its history
    loads: tuple[tuple[FloatArray, History], ...] = ()
    #: force at the follower shared by cam and seat on the base circle, N; it is assigned to the seat
    shared: float = 0.0

    def contact_force(self, event: Event) -> Callable[[CamMotion], FloatArray]:
        """Return the force at the follower by virtual work, N: ``h'.(M (h' s.. + h'' s.^2) + C h' s. + K h + f)``.

        On the base circle a seat carries the load of its body except for the plunger force of an adjuster: a valve
        closed by its spring has ``seat = spring - plunger``, and a seat force is compressive only.
        """

        def history(motion: CamMotion) -> FloatArray:
            s, slope, bend = (motion.cam(event, order) for order in range(3))
            speed, rate = slope * motion.speed, bend * motion.speed**2 + slope * motion.rate
            h, h1, h2 = (np.stack(one, axis=-1) for one in zip(*(c(s) for c in self.coordinates), strict=True))
            v = h1 * speed[..., None]
            inertia = (h1 * rate[..., None] + h2 * speed[..., None] ** 2) @ self.mass
            damped = v @ self.damping
            held = sum((one.force(h, v, motion.cam) for one in self.laws), h @ self.stiffness + self.force)
            held = held - sum(load(motion)[..., None] * share for share, load in self.loads)
            felt = (h1 * (inertia + damped + held)) @ (self.bodies != 0.0).T
            shut = np.asarray(s <= _BASE_CIRCLE_FRACTION * event.height)[..., None]
            return np.sum(np.where(shut & ~np.isnan(self.standing), self.standing, felt), axis=-1)

        return history


_BASE_CIRCLE_FRACTION = 1e-9  # fraction of the lift below which a cam counts as on the base circle


def rigid_train(structure: Structure, contact: PublishedLoad | CamContact, where: str, speed: float) -> RigidTrain:
    """Return the rigid train of a follower."""
    train = follower_train(structure, contact, where)
    parted = divide_train(structure, train.motion)
    motions, bodies = parted.motions, parted.installed
    mass = motions @ structure.mass.multiply(motions.T)
    at_rest = _with_static_springs(structure)
    damping, stiffness = _spring_matrices(at_rest, motions)
    given = structure.model.damping
    force = -motions @ steady_load(structure)
    if isinstance(contact, PublishedLoad):
        force[0] += preload(structure, contact, train, structure.model.cams[contact.cam], speed)
    damping += given.alpha * mass + given.beta * stiffness + _modal(mass, stiffness, bodies, given.modal)
    held, pushed, laws = bodies @ stiffness @ bodies.T, bodies @ force, train_laws(at_rest, motions)
    loads = tuple((motions @ one.vector, one.history) for one in given_loads(structure) if not one.steady)
    if isinstance(contact, PublishedLoad):  # parts driven by it are in the installed position
        paths = parted.coordinates(0.0 * pushed)
        return RigidTrain(motions, paths, mass, damping, stiffness, force, bodies, np.nan * pushed, laws, loads)
    places, seats = find_rest(parted.bodies, held, pushed)
    needed, seated = held @ places + pushed, np.array([one.seated for one in parted.bodies])
    standing, between = _rest_forces(parted.bodies, needed - seats), seated & parted.rests_on_cam(places)
    return RigidTrain(
        motions, parted.coordinates(places), mass, damping, stiffness, force, bodies, standing, laws, loads,
        float(np.maximum(needed, 0.0)[between].sum()),
    )  # fmt: skip


def _rest_forces(bodies: Sequence[Body], left: FloatArray) -> FloatArray:
    """Return the contributions of bodies to the follower force on the base circle, from their seat loads.

    A seat of the first body carries the remainder of all bodies, which other seats may reduce below zero.
    """
    found, borne = left.copy(), [bodies[0].seated]
    for body in bodies[1:]:
        borne.append(body.seated or borne[body.before])
    found[0] -= max(float(left.sum()), 0.0) if bodies[0].seated else 0.0
    return np.where(borne, found, np.nan)


def _modal(mass: FloatArray, stiffness: FloatArray, bodies: FloatArray, ratio: float) -> FloatArray:
    """Return the modal damping along motions, shape (b, b), in the limit of rigid members.

    Member modes vanish as (w/w_e)^3 in the damping of a motion. The remaining modes are those of the bodies on their
    springs (without contacts, as in the flexible model), and ``C = M Phi diag(2 zeta w) Phi^T M`` of these: for a train
    in proportion to the lift ``2 zeta sqrt(k m)``. R. W. Clough and J. Penzien, Dynamics of Structures, 3rd ed. (2003),
    eq. 12-56.
    """
    if ratio == 0.0:
        return np.zeros_like(mass)
    moved = bodies[np.einsum("gb,bc,gc->g", bodies, mass, bodies) > 0.0]
    own, held = (Triplets.from_dense(moved @ one @ moved.T) for one in (mass, stiffness))
    found = modes(own, held)
    damping = modal_damping(Triplets.from_dense(mass), moved.T @ found.shapes, found.omegas, ratio)
    return damping.dense()


def _with_static_springs(structure: Structure) -> Structure:
    """Return a structure in which springs with unequal parts have one: no unknown inside them moves on its own."""
    springs = structure.model.springs
    if not any(spring.coils for spring in springs.values()):
        return structure
    condensed = {name: condense_spring(one) if one.coils else one for name, one in springs.items()}
    return replace(structure, model=replace(structure.model, springs=condensed))


def _spring_matrices(structure: Structure, motions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return damping and stiffness of the springs' parts along motions, shape (b, b) each."""
    damping, stiffness = np.zeros((2, len(motions), len(motions)))
    for name, spring in structure.model.springs.items():
        for part, (low, high) in zip(spring.parts, spring_parts(structure, name, spring), strict=True):
            row = motions @ (high - low)
            damping += part.damping * np.outer(row, row)
            stiffness += part.stiffness * np.outer(row, row)
    return damping, stiffness


ANY_SPEED = 1.0
"""Speed, rad/s, at which the rigid train is built: its motion over the cam angle is the same at any speed."""


@lru_cache(maxsize=2)
def build_rigid(model: Model, speed: float) -> System:
    """Return the mechanism with rigid members: no unknowns, the train follows the lift."""
    structure = build_structure(model)
    check_lever_rotation(structure)
    trains = {
        name: rigid_train(structure, contact, f"contacts.{name}.follower", speed)
        for name, contact in model.cam_contacts.items()
    }
    loads: list[Load] = []
    channels: list[Channel] = []
    for name, train in trains.items():
        own = _contact_histories(structure, name, train, len(loads))
        loads += own[0]
        channels += own[1]
    nothing = Triplets.zeros(0)
    moved = _prescribed_motion(structure, trains)
    channels += _spring_channels(structure, moved)
    probes = tuple(_rigid_probe(probe_of(structure, point), moved) for point in model.probes)
    shown = PrescribedMotion(structure.dofs.names, moved)
    return System(nothing, nothing, nothing, (), tuple(loads), (), probes, tuple(channels), prescribed_motion=shown)


def _contact_histories(structure: Structure, name: str, train: RigidTrain, at: int) -> tuple[list[Load], list[Channel]]:
    """Return contact forces as histories from an index on, and the channels computed from them."""
    where, contact = f"contacts.{name}", structure.model.cam_contacts[name]
    cam = structure.model.cams[contact.cam]
    needed, arm = train.contact_force(cam.event), derivative(cam.event)
    force, torque = load_sum(at), load_sum(at, factor=arm)
    loads, more = [Load(where, np.zeros(0), needed)], list[Channel]()
    if isinstance(contact, CamContact):
        if contact.friction:
            law = rigid_friction(structure, name, contact, train.motions[0])
            loads = [Load(where, np.zeros(0), law.force(needed)),
                     Load(f"{where}.friction", np.zeros(0), law.friction(needed))]  # fmt: skip
            torque = observable_sum(torque, load_sum(at + 1, factor=cam_sliding(cam)))
            more.append(Channel(f"{where}.friction", "N", load_sum(at + 1, factor=normal_force_ratio(cam))))
        more += lubrication_channels(structure, name, contact, force, load_sum(at + 1))
    return loads, [Channel(f"{where}.force", "N", force), Channel(f"{where}.torque", "N m", torque), *more]


def _spring_channels(structure: Structure, moved: AngleVector) -> list[Channel]:
    """Return the static forces of the springs at their travel."""
    found: list[Channel] = []
    for name, spring in structure.model.springs.items():
        if has_channels(spring):
            share = moved.vectors @ spring_row(structure, name, spring)
            travel = _Combination(share, moved.functions) if share.any() else constant(0.0)
            found.append(Channel(f"springs.{name}.force", force_unit(spring), partial(_static_force, spring, travel)))
    return found


def _static_force(spring: Spring, travel: AngleFunction, seen: Observation) -> FloatArray:
    """Return the static force of a spring at its travel, N, shape (m,)."""
    curve, moved = spring_curve(spring), seen.cam(travel, 0)
    pulsating = 0.0 if spring.pulsation is None else spring.stiffness * spring.pulsation.part(seen.motion.angle)
    return np.interp(moved, curve.travel, curve.force) + pulsating * moved


def _prescribed_motion(structure: Structure, trains: Mapping[str, RigidTrain]) -> AngleVector:
    """Return the motion of all components: those of the trains by their coordinates."""
    vectors, functions = [np.zeros((1, structure.dofs.size))], [constant(0.0)]
    for name, train in trains.items():
        event = structure.model.cams[structure.model.cam_contacts[name].cam].event
        vectors.append(train.motions)
        functions += [_CoordinateByAngle(coordinate, event) for coordinate in train.coordinates]
    return AngleVector(np.concatenate(vectors), tuple(functions))


def _rigid_probe(probe: Probe, moved: AngleVector) -> Probe:
    """Return the probe with the motion of the rigid trains."""
    shares = probe.rows @ moved.vectors.T
    offsets = tuple(_Combination(row, moved.functions) if row.any() else None for row in shares)
    return Probe(probe.name, probe.components, np.zeros((len(shares), 0)), offsets)


@dataclass(frozen=True, eq=False)
class _CoordinateByAngle(DerivedCamFunction):
    """Coordinate as a function of the cam angle."""

    coordinate: Coordinate
    event: Event

    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return a derivative, see `DerivedCamFunction`."""
        key = id(self.coordinate), id(self.event)  # trains of several cams may share a coordinate
        h, h1, h2 = cam.lookup(key, lambda: self.coordinate(cam(self.event, 0)))
        if order == 0:
            return h
        slope = cam(self.event, 1)
        return h1 * slope if order == 1 else h1 * cam(self.event, 2) + h2 * slope**2


@dataclass(frozen=True, eq=False)
class _Combination(DerivedCamFunction):
    """Linear combination of functions of the cam angle."""

    shares: FloatArray
    functions: tuple[AngleFunction, ...]

    def of(self, cam: CamFunctionCache, order: int) -> FloatArray:
        """Return a derivative, see `DerivedCamFunction`."""
        parts = [share * cam(one, order) for share, one in zip(self.shares, self.functions, strict=True) if share]
        return np.sum(parts, axis=0)


def shared_forces(model: Model, speed: float) -> dict[str, float]:
    """Return forces shared by cam and seat on the base circle, which the rigid model cannot distribute."""
    structure = build_structure(model)
    free = {name: one for name, one in model.cam_contacts.items() if isinstance(one, CamContact)}
    found = {n: rigid_train(structure, one, f"contacts.{n}.follower", speed).shared for n, one in free.items()}
    return {name: force for name, force in found.items() if force > 0.0}


def touching_coils(model: Model, speed: float) -> dict[str, float]:
    """Return the springs with coil clash at full lift of the rigid trains."""
    structure, found = build_structure(model), dict[str, float]()
    for name, contact in model.cam_contacts.items():
        train = rigid_train(structure, contact, f"contacts.{name}.follower", speed)
        top = event_extremes(model.cams[contact.cam].event)[1]
        moved = np.stack([one(np.array([top.value]))[0] for one in train.coordinates], axis=-1)
        for one in train.laws:
            beyond = len(one.rows) * float(one.compression(moved, CamFunctionCache(np.array([top.at]))).max())
            if one.stops and beyond > 0.0:
                found[one.name.split(".")[1]] = beyond
    return found
