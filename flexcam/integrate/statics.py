"""Static displacement, also where the stiffness leaves motions free that nothing loads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from flexcam.integrate.balance import balanced
from flexcam.integrate.local import LocalForces
from flexcam.integrate.problem import State
from flexcam.linalg import (
    TOO_MUCH,
    FloatArray,
    SingularMatrixError,
    Triplets,
    diagonal_scale,
    energy_rounding,
    factorize,
    null_space,
    pins,
)
from flexcam.response import TOO_FINE, Cause, RunFailedError, Status
from flexcam.system import CamMotion, Drive, Load, System

_UNLOADED = 1e-9
"""Share of the load along a free motion that counts as none: loads are sums of given numbers with 15 digits."""


def static_displacement(
    stiffness: Triplets, load: FloatArray, names: Sequence[str], free: FloatArray | None = None
) -> FloatArray:
    """Return the displacement under a static load.

    A stiffness that leaves rigid motions or mechanisms free is no fault as long as the load does no work on them
    (the axial drift of a shaft between radial bearings): the answer is then the one without any part along them.
    No spring is added anywhere.
    """
    free = null_space(stiffness) if free is None else free
    if not free.shape[1]:
        return _trusted(stiffness, load, _solved(stiffness, load))
    # Weighed with the diagonal of the stiffness, translations and rotations compare whatever their units.
    scale = diagonal_scale(stiffness)
    motions = np.linalg.qr(free / scale[:, None])[0]
    _refuse_mechanism(motions, scale * load, names)
    # As the load does no work on the free motions, holding one unknown of each changes nothing but their share.
    kept = np.setdiff1d(np.arange(stiffness.size), pins(motions))
    x = np.zeros(stiffness.size)
    x[kept] = _solved(stiffness.part(kept), load[kept])
    # Plain least squares of the components: no axis of space is favoured.
    drift = np.linalg.qr(free)[0]
    return _trusted(stiffness, load, x) - drift @ (drift.T @ x)


def _solved(stiffness: Triplets, load: FloatArray) -> FloatArray:
    """Return the displacement of a structure that is held: what is singular then is so by rounding."""
    try:
        return factorize(stiffness).solve(load)
    except SingularMatrixError:
        raise RunFailedError(TOO_FINE) from None


def _trusted(stiffness: Triplets, load: FloatArray, x: FloatArray) -> FloatArray:
    """Return the answer if rounding in the stiffness has left it standing."""
    lost = float(energy_rounding(stiffness, x[:, None])[0])
    if lost > TOO_MUCH * abs(float(x @ load)):
        raise RunFailedError(TOO_FINE)
    return x


def _refuse_mechanism(motions: FloatArray, load: FloatArray, names: Sequence[str]) -> None:
    push = motions.T @ load
    if np.abs(push).max() <= _UNLOADED * np.linalg.norm(load):
        return
    motion = np.abs(motions @ push)
    order: list[int] = np.argsort(-motion).tolist()
    moving = [names[i] for i in order if motion[i] > 0.1 * motion.max()]
    shown = ", ".join(moving[:8]) + (f" and {len(moving) - 8} more" if len(moving) > 8 else "")
    text = f"the load drives a motion that nothing resists: {shown}"
    raise RunFailedError(Status(Cause.SINGULAR, text, "support one of these components or attach a spring to it"))


def rest(system: System, drive: Drive, time: float = 0.0) -> State:
    """Return the state of a mechanism that stands still as installed: its preloads in balance, nothing else acting."""
    return _balanced(LocalForces(system), system, drive, time, lambda load: load.installed)


def equilibrium(system: System, drive: Drive, time: float = 0.0) -> State:
    """Return the static equilibrium under all loads and local forces at the cam angle of an instant."""
    return _balanced(LocalForces(system), system, drive, time, _all)


def carried_equilibrium(system: System, drive: Drive, time: float = 0.0) -> State:
    """Return the static equilibrium of an instant with the velocity at which the cam carries it on.

    A cam that lifts at the start would strike a train at rest: the velocities are those of the equilibria before and
    after, ``omega du/dtheta``, by a central difference over a thousandth of a radian.
    """
    forces = LocalForces(system)
    still = _balanced(forces, system, drive, time, _all)
    step = _CARRIED / float(drive.at(np.array([time])).speed[0])
    near = still.displacement
    before, after = (_balanced(forces, system, drive, time + side, _all, near).displacement for side in (-step, step))
    return replace(still, velocity=(after - before) / (2.0 * step))


_CARRIED = 1e-3
"""rad."""


def _all(load: Load) -> bool:
    return True


def _balanced(
    forces: LocalForces, system: System, drive: Drive, time: float, acts: Callable[[Load], bool],
    near: FloatArray | None = None,
) -> State:  # fmt: skip
    """Return the balance at an instant under some of the loads, sought from a displacement nearby."""
    motion = drive.at(np.array([time]))
    counted = np.array([acts(load) for load in system.loads], dtype=float)
    load = (counted * system.load_histories(motion)[0]) @ system.load_vectors()
    if not forces.count:
        d = static_displacement(system.stiffness, load, system.names, system.free)
    else:
        d = balanced(system, forces, load, motion, near)
    return State(d, np.zeros(system.size), time, _resting(forces, d, motion))


def _resting(forces: LocalForces, d: FloatArray, motion: CamMotion) -> FloatArray | None:
    """Return the internal states at rest, shape (s,); None where there are none."""
    if not len(forces.table.owners):
        return None
    gap = forces.sensed(d[None], np.zeros((1, len(d))), forces.schedule(motion))[0][0]
    return np.minimum(gap[forces.table.owners], 0.0)  # what carries at rest has not leaked yet, and no oil is missing
