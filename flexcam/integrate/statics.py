"""Static displacement, also where the stiffness leaves motions free that nothing loads."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexcam.integrate.local import Compliance, LocalForces, NoConvergenceError, settle
from flexcam.integrate.problem import State
from flexcam.linalg import FloatArray, Triplets, diagonal_scale, factorize, null_space
from flexcam.response import Cause, RunFailedError, Status
from flexcam.system import Drive, Load, System

_UNLOADED = 1e-9
"""Share of the load along a free motion that counts as none: loads are sums of given numbers with 15 digits."""


def static_displacement(stiffness: Triplets, load: FloatArray, names: Sequence[str]) -> FloatArray:
    """Return the displacement under a static load.

    A stiffness that leaves rigid motions or mechanisms free is no fault as long as the load does no work on them
    (the axial drift of a shaft between radial bearings): the answer is then the one without any part along them.
    No spring is added anywhere.

    Parameters
    ----------
    stiffness
        Symmetric, n unknowns.
    load
        Shape (n,), N and N m.
    names
        A name per unknown, for the message.

    Returns
    -------
    ndarray
        Shape (n,), m and rad.

    Raises
    ------
    RunFailedError
        If the load drives a motion that nothing resists; the message names the components that move.

    Examples
    --------
    >>> pair = Triplets.from_dense([[1.0, -1.0], [-1.0, 1.0]])
    >>> static_displacement(pair, np.array([-1.0, 1.0]), ("a", "b"))
    array([-0.5,  0.5])
    """
    free = null_space(stiffness)
    if not free.shape[1]:
        return factorize(stiffness).solve(load)
    scale = diagonal_scale(stiffness)
    _refuse_mechanism(free, load, scale, names)
    # As the load does no work on the free motions, holding one unknown of each changes nothing but their share.
    kept = np.setdiff1d(np.arange(stiffness.size), _pins(free / scale[:, None]))
    x = np.zeros(stiffness.size)
    x[kept] = factorize(stiffness.part(kept)).solve(load[kept])
    return x - free @ (free.T @ (x / scale**2))


def _pins(motions: FloatArray) -> list[int]:
    """Return one unknown per motion that together hold them all: Gaussian elimination with row pivots."""
    pins: list[int] = []
    rest = motions.copy()
    for _ in range(motions.shape[1]):
        pins.append(int(np.argmax(np.linalg.norm(rest, axis=1))))
        held = rest[pins[-1]] / np.linalg.norm(rest[pins[-1]])
        rest -= np.outer(rest @ held, held)
    return pins


def _refuse_mechanism(free: FloatArray, load: FloatArray, scale: FloatArray, names: Sequence[str]) -> None:
    push = free.T @ load
    if np.abs(push).max() <= _UNLOADED * np.linalg.norm(scale * load):
        return
    motion = np.abs(free @ push) / scale
    order: list[int] = np.argsort(-motion).tolist()
    moving = [names[i] for i in order if motion[i] > 0.1 * motion.max()]
    shown = ", ".join(moving[:8]) + (f" and {len(moving) - 8} more" if len(moving) > 8 else "")
    text = f"the load drives a motion that nothing resists: {shown}"
    raise RunFailedError(Status(Cause.SINGULAR, text, "support one of these components or attach a spring to it"))


def rest(system: System, drive: Drive, time: float = 0.0) -> State:
    """Return the state of a mechanism that stands still as installed: its preloads in balance, nothing else acting.

    Parameters
    ----------
    system
        The system.
    drive
        How the cam will turn.
    time
        s.

    Returns
    -------
    State
        Displacement under the installed loads, zero velocity.

    Raises
    ------
    RunFailedError
        If the preloads drive a motion that nothing resists.
    """
    return _balanced(system, drive, time, lambda load: load.installed)


def equilibrium(system: System, drive: Drive, time: float = 0.0) -> State:
    """Return the static equilibrium under all loads and local forces at the cam angle of an instant.

    Parameters
    ----------
    system
        The system.
    drive
        How the cam will turn; only its angle counts.
    time
        s.

    Returns
    -------
    State
        Displacement in balance, zero velocity.

    Raises
    ------
    RunFailedError
        If the loads drive a motion that nothing resists, or the local forces do not settle.
    """
    return _balanced(system, drive, time, lambda load: True)


def _balanced(system: System, drive: Drive, time: float, acts: Callable[[Load], bool]) -> State:
    motion = drive.at(np.array([time]))
    counted = np.array([acts(load) for load in system.loads], dtype=float)
    load = (counted * system.load_histories(motion)[0]) @ system.load_vectors()
    d = static_displacement(system.stiffness, load, system.names)
    forces = LocalForces(system)
    if forces.count:
        schedule = forces.schedule(motion)
        sense, act = schedule.sense[0] @ forces.sense.vectors, schedule.act[0] @ forces.act.vectors
        by_force = np.column_stack([static_displacement(system.stiffness, a, system.names) for a in act])
        still = np.zeros(forces.count)
        within = Compliance(sense @ d + schedule.offset[0], still, sense @ by_force, 0.0 * (sense @ by_force))
        rates = [0.0 * z for z in forces.start_states]
        try:
            local = settle(forces, within, still, forces.start_states, rates, 0.0, float(motion.angle[0]))[0]
        except NoConvergenceError:
            text = "the local forces found no static balance"
            raise RunFailedError(Status(Cause.NO_CONVERGENCE, text, "raise the preload or start from rest")) from None
        d = d + by_force @ local
    return State(d, np.zeros(system.size), time)
