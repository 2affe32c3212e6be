"""Rigid model: the flexible model in the motion of its rigid trains, with contact forces by inverse dynamics.

Mass, springs, loads, force laws, probes and channels are those of the flexible model. The forces of cams, seats, lash
and adjusters balance inertia, damping, springs, friction and loads in virtual motions of the train.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from flexcam.cams import event_extremes
from flexcam.core import FloatArray, IntArray, Triplets
from flexcam.core.errors import refuse
from flexcam.dynamics import (
    AngleVector,
    CamMotion,
    Channel,
    ConstantSpeed,
    ForceLaw,
    System,
    derivative,
    force_sum,
    modes,
    spring_damper,
)
from flexcam.dynamics.engine import reactions
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.system import VirtualWork
from flexcam.fem.assembly import modal_damping, rayleigh_damping
from flexcam.fem.rigid_bodies import scalar_matrix
from flexcam.valvetrain.cam_contact import couple_cam
from flexcam.valvetrain.camshaft import shaft_axes
from flexcam.valvetrain.contacts import check_lever_rotation, couple_friction
from flexcam.valvetrain.coupling import Coupling, conservative_force, installed_load, shift_coupling
from flexcam.valvetrain.loads import given_loads, preload, spring_share, steady_load
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import CamContact, Lash, PublishedLoad
from flexcam.valvetrain.rigid_kinematics import RigidTrain, follower_train, load_trains, soft_stiffness
from flexcam.valvetrain.rigid_train import PULL, Drive
from flexcam.valvetrain.springs import condense_spring, couple_springs
from flexcam.valvetrain.structure import Structure, build_structure, spring_stretches
from flexcam.valvetrain.system_builder import assemble_system, couple_contact, couple_contacts


@dataclass(frozen=True, eq=False)
class ConstraintForce:
    """Force of a cam, seat, lash or adjuster by inverse dynamics."""

    #: `scalar`, `sliding`: among the local forces, of its normal force and of its friction; None without friction
    scalar: int
    sliding: int | None
    friction: tuple[float, float]  #: coefficient and velocity of Coulomb friction

    def friction_ratio(self, rate: FloatArray) -> FloatArray:
        """Return the friction per normal force, ``mu tanh(v/v0)``, by the rates of all scalars, shape (m, c)."""
        coefficient, speed = self.friction
        return coefficient * np.tanh(rate[:, self.scalar + 1] / speed)


@dataclass(frozen=True, eq=False)
class RigidTrains:
    """Prescribed motion of all unknowns by the rigid trains."""

    size: int
    trains: tuple[RigidTrain, ...]
    contacts: Mapping[str, ConstraintForce]  #: by the name of the contact

    @property
    def constraints(self) -> IntArray:
        """Scalars whose forces are those of constraints, see `flexcam.dynamics.PrescribedMotion`."""
        names = {part.name for train in self.trains for part in (*train.drives, *train.stops)}
        forces = [self.contacts[name] for name in sorted(names)]
        return np.array([i for force in forces for i in (force.scalar, force.sliding) if i is not None], dtype=np.intp)

    def at(self, motion: CamMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return displacement, velocity and acceleration at some instants, shape (m, n) each."""
        result = np.zeros((3, len(motion.angle), self.size))
        for train in self.trains:
            for values, scalars in zip(result, _scalar_motion(train, motion), strict=True):
                values[:, train.dofs] = scalars @ train.motions
        return result[0], result[1], result[2]

    def along(self, rows: FloatArray, motion: CamMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the motion along k rows of the unknowns, shape (m, k) each, see `PrescribedMotion`."""
        result = np.zeros((3, len(motion.angle), len(rows)))
        for train in self.trains:
            motions = train.motions @ rows[:, train.dofs].T
            if motions.any():
                result += [scalars @ motions for scalars in _scalar_motion(train, motion)]
        return result[0], result[1], result[2]

    def complete_forces(
        self, motion: CamMotion, residual: FloatArray, work: VirtualWork, rate: FloatArray, local: FloatArray
    ) -> FloatArray:
        """Return the local forces with those of the constraints, see `flexcam.dynamics.PrescribedMotion`."""
        result = local.copy()
        for train in self.trains:
            contacts = [part.name for part in (*train.drives, *train.stops)]
            unit_forces = {name: self._unit_forces(train, name, work, rate) for name in contacts}
            solution = train.solve(motion.cam)
            for branch, rows in solution.branches:
                remaining = residual[rows][:, train.dofs] @ train.motions.T
                for stop, closed in zip(train.stops, branch.closed, strict=True):
                    if not closed and stop.push:
                        result[rows, self.contacts[stop.name].scalar] = stop.push
                        remaining -= stop.push * unit_forces[stop.name][rows]
                names = [train.stops[i].name for i in branch.stops] + [train.drives[i].name for i in branch.drives]
                if not names:
                    continue
                A = np.stack([unit_forces[name][rows] for name in names], axis=-1)
                forces = _balance(branch.virtual_motions(solution.z[0, rows]), A, remaining)
                for contact, force in zip([self.contacts[name] for name in names], forces.T, strict=True):
                    result[rows, contact.scalar] = force
                    if contact.sliding is not None:
                        result[rows, contact.sliding] = contact.friction_ratio(rate[rows]) * force
        return result

    def _unit_forces(self, train: RigidTrain, name: str, work: VirtualWork, rate: FloatArray) -> FloatArray:
        """Return the forces on the scalars of a train per contact force, with its friction, shape (m, d)."""
        contact = self.contacts[name]
        forces = work(contact.scalar, train.dofs, train.motions)
        if contact.sliding is not None:
            sliding = work(contact.sliding, train.dofs, train.motions)
            forces = forces + contact.friction_ratio(rate)[:, None] * sliding
        return forces

    def jamming_drive(self, motion: CamMotion, work: VirtualWork, rate: FloatArray) -> Drive | None:
        """Return a cam whose friction carries all of its force at some instant; None without one."""
        for train in self.trains:
            for drive in (drive for drive in train.drives if self.contacts[drive.name].sliding is not None):
                acting, solution = self._unit_forces(train, drive.name, work, rate), train.solve(motion.cam)
                for branch, rows in solution.branches:
                    if branch.drive_effect(drive, solution.z[0, rows], acting[rows]).min(initial=1.0) <= 0.0:
                        return drive
        return None


def _balance(virtual: FloatArray, vectors: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the forces f with ``P^T A f = P^T r``, the smallest where several fit, shape (m, forces).

    The virtual motions P have the shape (m, d, c) or (1, d, c), the vectors A of the forces (m, d, forces), the
    residual r (m, d).
    """
    P = np.broadcast_to(virtual, (len(residual), *virtual.shape[1:])).transpose(0, 2, 1)
    matrix, right = P @ vectors, P @ residual[..., None]
    if matrix.shape[1] == matrix.shape[2]:
        return np.linalg.solve(matrix, right)[..., 0].astype(np.float64)
    return (np.linalg.pinv(matrix) @ right)[..., 0].astype(np.float64)


@lru_cache(maxsize=4)
def rigid_motion(model: Model) -> RigidTrains:
    """Return the motion of all unknowns of a model with rigid trains; contact forces need `build_rigid`."""
    structure = build_structure(model)
    size = structure.dofs.size
    return RigidTrains(size, load_trains(structure, steady_load(given_loads(structure), size)), {})


def _scalar_motion(train: RigidTrain, motion: CamMotion) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the scalars of a train and their time derivatives at some instants, shape (m, d) each."""
    (z, slope, bend), speed, rate = train.solve(motion.cam).z, motion.speed[:, None], motion.rate[:, None]
    return z, slope * speed, bend * speed**2 + slope * rate


def build_rigid(model: Model, speed: float) -> System:
    """Return the system of the mechanism with rigid trains, in their prescribed motion."""
    return _build(model, speed)[0]


@lru_cache(maxsize=2)
def _build(model: Model, speed: float) -> tuple[System, RigidTrains]:
    structure = build_structure(_condense_coils(model))
    dampers = [scalar_matrix(spring.row, spring.damping) for spring in spring_stretches(structure) if not spring.rigid]
    dampers.append(Triplets.zeros(structure.dofs.size))
    structure = replace(structure, stiffness=soft_stiffness(structure), dampers=Triplets.sum(dampers))
    check_lever_rotation(structure)
    contacts = couple_contacts(structure, lambda name: _couple_contact(structure, name, speed))
    couplings = [*contacts, couple_springs(structure), couple_friction(structure)]
    couplings.append(Coupling(given_loads(structure), (), ()))
    loads = (load for coupling in couplings for load in coupling.loads)
    trains = load_trains(structure, steady_load(loads, structure.dofs.size))
    system = assemble_system(structure, _damping(structure, trains), couplings)
    motion = RigidTrains(structure.dofs.size, trains, _constraint_forces(model, system))
    _check_friction(system, motion)
    return replace(system, prescribed_motion=motion), motion


def omit_coil_stops(model: Model) -> Model:
    """Return a rigid train's model in which the coils of springs do not touch."""
    springs = _condense_coils(model).springs
    return replace(model, springs={name: replace(spring, clash_stiffness=0.0) for name, spring in springs.items()})


def _condense_coils(model: Model) -> Model:
    """Return a model in which springs with unequal coils have one part: their coils close statically."""
    springs = {name: condense_spring(spring) if spring.coils else spring for name, spring in model.springs.items()}
    return replace(model, springs=springs) if any(spring.coils for spring in model.springs.values()) else model


def _couple_contact(structure: Structure, name: str, speed: float) -> Coupling:
    contact, model = structure.model.contacts[name], structure.model
    ends = contact.ends if isinstance(contact, Lash) and contact.turns else None
    if ends and model.mesh.node(ends[0], f"contacts.{name}.from") in shaft_axes(model):
        return Coupling((), (), ())  # the rotation of a shaft is prescribed
    if isinstance(contact, CamContact):
        return shift_coupling(couple_cam(structure, name, contact, twists=False), model.cams[contact.cam].phaser)
    if not isinstance(contact, PublishedLoad):
        return couple_contact(structure, name, contact, speed)
    # The cam moves the follower; the springs press with the published preload.
    where, cam = f"contacts.{name}", model.cams[contact.cam]
    train = follower_train(structure, contact, f"{where}.follower")
    force = preload(structure, contact, train, cam, speed)
    follower = structure.row(contact.follower, contact.direction)
    load = installed_load(f"{where}.preload", -spring_share(structure, train), force)
    local = conservative_force(where, AngleVector.constant(-follower), spring_damper(1.0), cam.event)
    coupling = Coupling((load,), (local,), (
        Channel(f"{where}.force", "N", force_sum(0)),
        Channel(f"{where}.torque", "N m", force_sum(0, factor=derivative(cam.event))),
    ))  # fmt: skip
    return shift_coupling(coupling, cam.phaser)


def _constraint_forces(model: Model, system: System) -> dict[str, ConstraintForce]:
    forces: dict[str, ConstraintForce] = {}
    scalar = 0
    for force in system.local_forces:
        name = force.name.removeprefix("contacts.")
        if name != force.name and name in model.contacts:
            friction = force.law.friction if isinstance(force.law, ForceLaw) and len(force.sense) > 1 else None
            forces[name] = ConstraintForce(scalar, scalar + 1 if friction else None, friction or (0.0, 1.0))
        scalar += len(force.sense)
    return forces


def _damping(structure: Structure, trains: Sequence[RigidTrain]) -> Triplets:
    """Return dampers, Rayleigh damping, and modal damping of the rigid bodies on their springs without contacts."""
    damping, matrix = structure.model.damping, structure.dampers
    matrix += rayleigh_damping(structure.mass, structure.stiffness, damping.alpha, damping.beta)
    if damping.modal == 0.0:
        return matrix
    for train in trains:
        shapes = np.zeros((structure.dofs.size, len(train.motions)))
        shapes[train.dofs] = train.motions.T
        bodies = train.bodies(shapes.T @ structure.mass.multiply(shapes))
        mass = Triplets.from_dense(bodies @ shapes.T @ structure.mass.multiply(shapes @ bodies.T))
        body_modes = modes(mass, Triplets.from_dense(bodies @ train.stiffness @ bodies.T))
        matrix += modal_damping(structure.mass, shapes @ bodies.T @ body_modes.shapes, body_modes.omegas, damping.modal)
    return matrix


_ANGLES = np.linspace(0.0, 2.0 * np.pi, 721)
_REST = 1e-6  # rad/s, where nothing has inertia
_FAST = 1e9  # rad/s, where friction has its full size
_TOUCHING = 1e-12  # compression of coils beyond their touch that is more than rounding, m


def _check_friction(system: System, motion: RigidTrains) -> None:
    """Refuse a friction that carries all of the force of its follower at some angle: it jams."""
    cam, forces = ConstantSpeed(_FAST).at(_ANGLES / _FAST), LocalForces(system)
    inputs = forces.prescribed_inputs(cam)
    rate = forces.sense_motion(*motion.at(cam)[:2], inputs)[1]
    drive = motion.jamming_drive(cam, forces.virtual_work(inputs), rate)
    if drive is not None and isinstance(drive.contact, CamContact):
        allowed, why = "a friction at which the face slides", "friction alone would hold the rigid follower: it jams"
        remedy = "lower it, or place the pivot nearer to the line of the face"
        raise refuse(f"contacts.{drive.name}.friction", drive.contact.friction, allowed, why, remedy)


def shared_forces(model: Model) -> dict[str, float]:
    """Return forces shared by cam and seat on the base circle, which the rigid model cannot distribute, N."""
    return {name: force for train in rigid_motion(model).trains for name, force in train.shared_forces().items()}


def pulling_contacts(model: Model) -> dict[str, float]:
    """Return the largest pull of seats and lash of the rigid model at rest, N, which nonlinear springs cause.

    Equilibrium of the motion takes the stiffness as installed, the forces of a contact the whole law.
    """
    system, trains = _build(model, _REST)
    motion, forces = ConstantSpeed(_REST).at(_ANGLES / _REST), LocalForces(system)
    local = reactions(system, trains, forces, motion, trains.at(motion))
    limit = -PULL * float(np.abs(local).max(initial=0.0))
    stops = [stop.name for train in trains.trains for stop in train.stops]
    pulls = {name: float(local[:, trains.contacts[name].scalar].min()) for name in stops}
    return {name: -force for name, force in pulls.items() if force < limit}


def cam_forces(model: Model, speed: float, motions: Iterable[CamMotion]) -> list[dict[str, FloatArray]]:
    """Return the forces of the cams on the rigid trains of a speed in some motions, N, by the name of the contact."""
    system, trains = _build(model, speed)
    forces, names = LocalForces(system), [drive.name for train in trains.trains for drive in train.drives]
    local = [reactions(system, trains, forces, motion, trains.at(motion)) for motion in motions]
    return [{name: values[:, trains.contacts[name].scalar] for name in names} for values in local]


def touching_coils(model: Model, speed: float) -> dict[str, float]:
    """Return the compression of springs beyond coil clash at full lift of the rigid trains, m."""
    system, trains = _build(model, speed)
    cams = [model.cams[contact.cam] for contact in model.cam_contacts.values()]
    tops = [cam.drive_angle(event_extremes(cam.event)[1].at) for cam in cams]
    motion, forces = ConstantSpeed(speed).at(np.array(tops) / speed), LocalForces(system)
    penetrations = forces.sense_motion(*trains.at(motion)[:2], forces.prescribed_inputs(motion))[0]
    clashes = [
        (force.name.split(".")[1], scalars) for force, scalars, _ in forces.parts if force.name.endswith(".clash")
    ]
    pairs = ((name, (s.stop - s.start) * float(penetrations[:, s].max(initial=0.0))) for name, s in clashes)
    return {name: compression for name, compression in pairs if compression > _TOUCHING}
