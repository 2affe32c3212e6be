"""What a follower moves as rigid bodies: masses, springs and dampers along their motions, and the force at the cam."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.fem.damping import modal_damping
from flexcam.linalg import FloatArray, Triplets
from flexcam.modal import modes
from flexcam.motion import Event
from flexcam.system import CamMotion
from flexcam.train.divided import divided
from flexcam.train.loads import steady_load
from flexcam.train.model import CamContact, PublishedLoad
from flexcam.train.paths import Coordinate
from flexcam.train.published import follower_train, preload
from flexcam.train.rigid_springs import SpringLaw, spring_laws
from flexcam.train.settled import Body, settled
from flexcam.train.springs import spring_parts
from flexcam.train.structure import Structure


@dataclass(frozen=True, eq=False)
class RigidTrain:
    """What a follower moves, as a sum of motions times coordinates that follow from the lift.

    Parameters
    ----------
    motions
        Shape (b, n): the first is everything that moves in proportion to the lift, then the ends of levers.
    coordinates
        One per motion.
    mass, damping, stiffness
        Of these motions, shape (b, b): springs, dampers, Rayleigh's damping and that of the modes left to rigid trains.
    force
        Of the installed springs, the weight and the given loads along them, N, shape (b,).
    bodies
        What no play divides: how its motions go with each other as installed, shape (g, b).
    standing
        Share of a body in the force at the follower while the cam does not lift, N, shape (g,), where it or what it
        rests on is on its seat; else NaN.
    springs
        What springs do beside their mean stiffness.
    shared
        Force at the follower that a cam on its base circle and a seat share by their stiffness, N: it is left to the
        seat.
    """

    motions: FloatArray
    coordinates: tuple[Coordinate, ...]
    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    force: FloatArray
    bodies: FloatArray
    standing: FloatArray
    springs: tuple[SpringLaw, ...]
    shared: float = 0.0

    def contact_force(self, event: Event) -> Callable[[CamMotion], FloatArray]:
        """Return the force at the follower by virtual work, N: ``h'.(M (h' s.. + h'' s.^2) + C h' s. + K h + f)``.

        While the cam does not lift, a body on its seat leaves its share to it, but for what an adjuster pushes: the
        balance of a valve that its spring holds shut is ``seat = spring - plunger``, and a seat only pushes.
        """

        def history(motion: CamMotion) -> FloatArray:
            s, slope, bend = (motion.cam(event, order) for order in range(3))
            speed, rate = slope * motion.speed, bend * motion.speed**2 + slope * motion.rate
            h, h1, h2 = (np.stack(one, axis=-1) for one in zip(*(c(s) for c in self.coordinates), strict=True))
            inertia = (h1 * rate[..., None] + h2 * speed[..., None] ** 2) @ self.mass
            damped = (h1 * speed[..., None]) @ self.damping
            held = sum((one.force(h, motion.cam) for one in self.springs), h @ self.stiffness + self.force)
            felt = (h1 * (inertia + damped + held)) @ (self.bodies != 0.0).T
            shut = np.asarray(s <= _SHUT * event.height)[..., None]
            return np.sum(np.where(shut & ~np.isnan(self.standing), self.standing, felt), axis=-1)

        return history


_SHUT = 1e-9
"""Part of its lift up to which a cam counts as not lifting."""


def rigid_train(structure: Structure, contact: PublishedLoad | CamContact, where: str, speed: float) -> RigidTrain:
    """Return the rigid train of a follower."""
    train = follower_train(structure, contact, where)
    parted = divided(structure, train.motion)
    motions, bodies = parted.motions, parted.installed
    mass = motions @ structure.mass.times_all(motions.T)
    damping, stiffness = _stretched(structure, motions)
    given = structure.model.damping
    force = -motions @ steady_load(structure)
    if isinstance(contact, PublishedLoad):
        force[0] += preload(structure, contact, train, structure.model.cams[contact.cam], speed)
    damping += given.alpha * mass + given.beta * stiffness + _modal(mass, stiffness, bodies, given.modal)
    held, pushed, springs = bodies @ stiffness @ bodies.T, bodies @ force, spring_laws(structure, motions)
    if isinstance(contact, PublishedLoad):  # what it pushes stands as installed
        paths = parted.coordinates(0.0 * pushed)
        return RigidTrain(motions, paths, mass, damping, stiffness, force, bodies, np.nan * pushed, springs)
    begun = settled(parted.bodies, held, pushed)
    needed, seated = held @ begun.places + pushed, np.array([one.seated for one in parted.bodies])
    standing = _standing(parted.bodies, needed - begun.seats)
    between = seated & parted.joined(begun.places)
    return RigidTrain(
        motions, parted.coordinates(begun.places), mass, damping, stiffness, force, bodies, standing, springs,
        float(np.maximum(needed, 0.0)[between].sum()),
    )  # fmt: skip


def _standing(bodies: Sequence[Body], left: FloatArray) -> FloatArray:
    """Return the shares of bodies in the force of a cam that does not lift, from what their own seats leave of them.

    A seat on the first takes what all leave; where others bear on a seat, this has less to leave than nothing.
    """
    found, borne = left.copy(), [bodies[0].seated]
    for body in bodies[1:]:
        borne.append(body.seated or borne[body.before])
    found[0] -= max(float(left.sum()), 0.0) if bodies[0].seated else 0.0
    return np.where(borne, found, np.nan)


def _modal(mass: FloatArray, stiffness: FloatArray, bodies: FloatArray, ratio: float) -> FloatArray:
    """Return the modal damping along motions, shape (b, b), in the limit of members without give.

    Their own modes go, as a share of (w/w_e)^3 in the damping of a motion; what stays are the modes of the bodies on
    their springs (contacts are no part of them, as in the flexible model), and ``C = M Phi diag(2 zeta w) Phi^T M`` of
    these: for a train in proportion to the lift ``2 zeta sqrt(k m)``. R. W. Clough and J. Penzien, Dynamics of
    Structures, 3rd ed. (2003), eq. 12-56.
    """
    if ratio == 0.0:
        return np.zeros_like(mass)
    moved = bodies[np.einsum("gb,bc,gc->g", bodies, mass, bodies) > 0.0]
    own, held = (Triplets.from_dense(moved @ one @ moved.T) for one in (mass, stiffness))
    found = modes(own, held)
    damping = modal_damping(Triplets.from_dense(mass), moved.T @ found.shapes, found.omegas, ratio)
    return damping.dense()


def _stretched(structure: Structure, motions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return damping and stiffness of the springs' parts along motions, shape (b, b) each."""
    damping, stiffness = np.zeros((2, len(motions), len(motions)))
    for name, spring in structure.model.springs.items():
        for low, high in spring_parts(structure, name, spring):
            row = motions @ (high - low)
            damping += spring.damping * spring.elements * np.outer(row, row)
            stiffness += spring.stiffness * spring.elements * np.outer(row, row)
    return damping, stiffness
