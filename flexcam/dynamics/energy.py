"""Equilibrium residual and energy balance of a run.

Both are computed independently of the operators of the time integration, from the matrices, the loads and the local
forces. The residual is evaluated at saved fields.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexcam.core import FloatArray, IntArray, Triplets, select_storage
from flexcam.dynamics.blocks import Arrays, flatten, select_prefix
from flexcam.dynamics.cam_motion import CamFunctionCache, PrescribedInputs
from flexcam.dynamics.local_forces import LocalForces, StoredEnergy
from flexcam.dynamics.step_state import Trajectory
from flexcam.dynamics.system import Observation, System

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class EquilibriumResidual:
    """Largest residual force relative to the largest force over a run; the step is in s.

    Forces and torques are measured by the displacement that each causes in its own unknown within a step, in the energy
    norm, so that units do not matter.
    """

    def __init__(self, system: System, forces: LocalForces, step: float) -> None:
        self._forces, self._vectors = forces, system.load_vectors()
        self._matrices = [select_storage(one) for one in (system.mass, system.damping, system.stiffness)]
        stiff = np.abs(system.stiffness.diagonal()) + np.abs(system.mass.diagonal()) / step**2
        self._weights = np.divide(1.0, np.sqrt(stiff), out=np.zeros_like(stiff), where=stiff > 0.0)
        self._largest = np.full(2, -1.0)

    @property
    def share(self) -> float:
        """Largest value so far, 1; zero without forces, negative if no instant was evaluated."""
        lacking, acting = self._largest
        return float(lacking / acting if acting > 0.0 else acting)

    def evaluate(self, track: Trajectory, seen: Observation, schedule: PrescribedInputs, rows: IntArray) -> None:
        """Evaluate instants."""
        if not len(rows) or not len(self._weights):
            return
        moved = (track.a[rows], track.v[rows], track.d[rows])
        parts = [np.asarray(matrix @ one.T, dtype=float).T for matrix, one in zip(self._matrices, moved, strict=True)]
        parts.append(-seen.histories[rows] @ self._vectors)
        if self._forces.count:
            acted = (seen.forces[rows] @ schedule.acts) * schedule.acting_weights[rows]
            parts.append(-acted @ self._forces.act.vectors)
        each = np.array(parts)
        self._largest = np.maximum(self._largest, [self._size(each.sum(axis=0)), self._size(each)])

    def _size(self, rows: FloatArray) -> float:
        weighed = rows * self._weights
        return float(np.sqrt(np.einsum("...i,...i->...", weighed, weighed).max()))

    def state(self) -> Arrays:
        """Return the state for resuming."""
        return {"imbalance": self._largest.copy()}

    def restore(self, state: Arrays) -> None:
        """Restore the state."""
        self._largest = state["imbalance"].copy()


PARTS = ("work", "kinetic", "strain", "contact", "dissipated", "numerical", "residual")
"""Names of the terms of the balance, in order."""


@dataclass(frozen=True, eq=False)
class _EnergyState:
    """Energies at m instants, J, shape (m,), and the quantities for the work between them.

    Arrays of absent quantities have no columns.
    """

    time: FloatArray
    angle: FloatArray
    kinetic: FloatArray
    strain: FloatArray
    elastic: FloatArray  #: strain energy including that of polynomial laws
    contact: FloatArray
    d: FloatArray
    v: FloatArray
    damped: FloatArray  #: damping force per unknown
    pushes: FloatArray  #: loads and forces, without those of opposed contacts, see `LocalForces.opposed`
    paths: FloatArray  #: their displacements
    path_rates: FloatArray  #: their velocities
    force: FloatArray
    still: FloatArray  #: contact forces without dissipation
    penetration: FloatArray
    states: FloatArray
    by_state: FloatArray  #: derivatives of their energy by internal states
    changing: FloatArray  #: part of their energy that depends on the cam angle
    rate: FloatArray
    prescribed_rates: FloatArray  #: prescribed part of the sensed rates
    impulse: FloatArray

    def last(self) -> _EnergyState:
        """Return the last instant alone."""
        return _EnergyState(*(getattr(self, n)[-1:] for n in self.__dataclass_fields__))


class EnergyBalance:
    """Energy balance, block by block.

    The work of the mean force along the path balances the energy in steps of the average acceleration; a method of
    higher order needs the work between the instants with the same order.
    """

    def __init__(self, system: System, forces: LocalForces, order: int = 2) -> None:
        self._system, self._forces, self._corrected = system, forces, order > 2
        self._M, self._C, self._K = (_QuadraticForm(m) for m in (system.mass, system.damping, system.stiffness))
        self._damped = bool(system.damping.values.any())
        smooth = forces.polynomial
        rough = np.flatnonzero(~smooth)
        self._rough = rough if smooth.any() else slice(None)
        self._smooth = StoredEnergy(forces, np.flatnonzero(smooth)) if smooth.any() else None
        self._smooth_scalars = np.flatnonzero(smooth)
        self._stores, self._others = StoredEnergy(forces, rough), np.flatnonzero(~forces.opposed[rough])
        places = np.cumsum(~smooth) - 1
        self._lifts = [(int(places[first]), int(places[last]), lift) for first, last, lift in forces.lifts]
        self._storing, self._circulatory = forces.storing[rough], np.flatnonzero(forces.circulatory[rough])
        self._strikes = not np.isnan(forces.restitution).all()
        # Vectors of the contacts that are not opposed, and the force acting along each.
        self._acting = np.flatnonzero(forces.act.owner[~forces.opposed].any(axis=0))
        self._acted = forces.act.owner[:, self._acting].argmax(axis=0) if forces.count else self._acting
        self._pushed = np.concatenate([system.load_vectors(), forces.act.vectors[self._acting]])
        self._last: _EnergyState | None = None
        self._sums = np.zeros(4)  # work, dissipated, numerical, and the energy at the start

    def block(
        self, track: Trajectory, seen: Observation, prescribed_rates: FloatArray, schedule: PrescribedInputs
    ) -> FloatArray:
        """Return the terms of the balance at the instants of a block, shape (m, 7), J."""
        new = self._evaluate_state(track, seen, prescribed_rates, schedule)
        energy = new.kinetic + new.strain + new.contact
        first = self._last is None
        if first:
            self._sums[3] = energy[0]
        gone = self._dissipation(new, self._last)
        sums = self._sums[:3] + np.cumsum(np.vstack([np.zeros((int(first), 3)), gone]), axis=0)
        self._sums[:3], self._last = sums[-1], new.last()
        residual = sums[:, 0] - (energy - self._sums[3]) - sums[:, 1] - sums[:, 2]
        return np.column_stack([sums[:, 0], new.kinetic, new.strain, new.contact, sums[:, 1], sums[:, 2], residual])

    def state(self) -> Arrays:
        """Return the state for the next block."""
        return {**flatten("held", self._last), "sums": self._sums.copy()}

    def restore(self, state: Arrays) -> None:
        """Restore the state."""
        held = select_prefix("held", state)
        self._last, self._sums = (_EnergyState(**held) if held else None), state["sums"].copy()

    def _dissipation(self, new: _EnergyState, last: _EnergyState | None) -> FloatArray:
        """Return work, dissipation and numerical loss since the previous instant, shape (b, 3)."""

        def sums(name: str) -> FloatArray:
            return _combine_successive(np.add, getattr(new, name), getattr(last, name, None))

        def changes(name: str) -> FloatArray:
            return _combine_successive(np.subtract, getattr(new, name), getattr(last, name, None))

        def path_work(force: str, path: str, rate: str) -> FloatArray:
            """Return the work of the mean force along the path, if required without its error of second order.

            That error is ``h^3/12 (F' v' - F'' v)`` in a step; the sum of the last term is minus that of the first one,
            but for a part at both ends of the run that does not accumulate.
            """
            mean = 0.5 * _dot(sums(force), changes(path))
            if not self._corrected:
                return mean
            return mean + changes("time") / 6.0 * _dot(changes(force), changes(rate))

        damped, given = path_work("damped", "d", "v"), path_work("pushes", "paths", "path_rates")
        # The work of a contact along its penetration comes from the unknowns and, if not opposed, from the cam.
        forces, still, deepened, others = sums("force"), sums("still"), changes("penetration"), self._others
        moving = 0.5 * _dot(forces[:, others], deepened[:, others])
        taken = 0.5 * _dot(forces, deepened) - moving
        lossy = self._stores.lossy
        crushed = 0.5 * _dot(forces[:, lossy] - still[:, lossy], deepened[:, lossy])
        crushed -= 0.5 * _dot(sums("by_state"), changes("states"))
        # Difference of the work of the mean force and of the nonlinear force, by Simpson's rule.
        half = 0.5 * sums("penetration"), 0.5 * sums("states"), CamFunctionCache(0.5 * sums("angle"))
        bows = np.zeros_like(deepened)
        for i, angle, lift in self._lifts:  # the path is curved: in its middle the contact is as deep as on average
            begin, middle, end = (lift(half[0][:, angle] + part * deepened[:, angle], 0) for part in (-0.5, 0.0, 0.5))
            bows[:, i] = 0.5 * (begin + end) - middle
            half[0][:, i] += bows[:, i]
        curves = 2.0 / 3.0 * (0.5 * still - self._stores.at(*half)[1]) * deepened
        if self._lifts:
            curves += 2.0 / 3.0 * bows * changes("still")
        curved = curves.sum(axis=1)
        turned = self._circulatory  # the rotation of the shaft does the work of their forces without motion
        from_shaft = curves[:, turned].sum(axis=1) - 0.5 * _dot(sums("still")[:, turned], deepened[:, turned])
        if self._corrected:
            more = (changes("time") / 6.0)[:, None] * (changes("force") - changes("still")) * changes("rate")
            crushed += more[:, lossy].sum(axis=1)
            taken += more.sum(axis=1) - more[:, others].sum(axis=1)
            moving += more[:, others].sum(axis=1)
            # The work of these forces on the unknowns is already that of the nonlinear force.
            from_cam = curves[:, others].sum(axis=1)
            moving, curved = moving - from_cam, curved - from_cam
        impulse = new.impulse if last else new.impulse[1:]
        struck = 0.5 * _dot(impulse, sums("prescribed_rates"))
        impact_lost = 0.5 * _dot(impulse, sums("rate")) if self._strikes else 0.0 * struck
        # If a contact closes and reverses within one step, its damping force is that of opening while the path
        # still closes: the product is negative, which is an error of the step.
        lost = np.maximum(damped + crushed + impact_lost, 0.0)
        numerical = given - taken - changes("kinetic") - changes("elastic") + struck + curved + (crushed - lost)
        work = given + moving + struck + self._cam_energy(new, last) + from_shaft
        return np.column_stack([work, lost, numerical])

    def _cam_energy(self, new: _EnergyState, last: _EnergyState | None) -> FloatArray:
        """Return the energy stored by cam rotation in contacts whose law depends on the angle."""
        begin = 0 if last else 1
        before = _previous(new.penetration, last and last.penetration), _previous(new.states, last and last.states)
        later = self._stores.varying(*before, CamFunctionCache(new.angle[begin:]))
        angle, changing = _previous(new.angle, last and last.angle), _previous(new.changing, last and last.changing)
        earlier = self._stores.varying(new.penetration[begin:], new.states[begin:], CamFunctionCache(angle))
        return 0.5 * (later - changing + new.changing[begin:] - earlier)

    def _evaluate_state(
        self, track: Trajectory, seen: Observation, prescribed_rates: FloatArray, schedule: PrescribedInputs
    ) -> _EnergyState:
        penetrations, forces, d = seen.penetrations[:, self._rough], seen.forces[:, self._rough], track.d
        stored, elastic, by_state = self._stores.at(penetrations, seen.states, schedule.cam)
        changing = self._stores.varying(penetrations, seen.states, schedule.cam)
        smooth = np.zeros(len(d))
        if self._smooth is not None:
            smooth = self._smooth.at(seen.penetrations[:, self._smooth_scalars], seen.states, schedule.cam)[0]
        strain, nothing = 0.5 * self._K.twice(d) + self._system.stored, np.zeros((len(d), 0))
        moved = (d, track.v, self._C.times(track.v)) if self._damped else (nothing, nothing, nothing)
        driven = (self._pushed @ track.v.T).T if self._corrected else nothing
        rates = seen.rates[:, self._rough] if self._strikes or self._corrected else nothing
        struck = (
            (prescribed_rates[:, self._rough], track.impulse[:, self._rough]) if self._strikes else (nothing, nothing)
        )
        acted = seen.forces[:, self._acted] * schedule.acting_weights[:, self._acting]
        return _EnergyState(
            track.time, schedule.angle, 0.5 * self._M.twice(track.v), strain, strain + smooth, stored + smooth,
            *moved, np.hstack([seen.histories, acted]), (self._pushed @ d.T).T, driven,
            forces if self._storing.all() else forces * self._storing, elastic, penetrations, seen.states, by_state,
            changing, rates, *struck,
        )  # fmt: skip


class _QuadraticForm:
    """A matrix in dense form, or its diagonal if it is diagonal."""

    def __init__(self, matrix: Triplets) -> None:
        self._diagonal = matrix.diagonal() if (matrix.rows == matrix.cols).all() else None
        self._whole: FloatArray | csr_array = select_storage(matrix) if self._diagonal is None else np.zeros((0, 0))

    def times(self, rows: FloatArray) -> FloatArray:
        """Return the product with every row, shape (m, n)."""
        if self._diagonal is not None:
            return rows * self._diagonal
        return np.asarray(rows @ self._whole, dtype=float)

    def twice(self, rows: FloatArray) -> FloatArray:
        """Return x A x of every row x, shape (m,)."""
        return np.square(rows) @ self._diagonal if self._diagonal is not None else _dot(self.times(rows), rows)


def _combine_successive(operation: np.ufunc, now: FloatArray, last: FloatArray | None) -> FloatArray:
    """Return sum or difference of successive instants; without `last` the first instant has none."""
    if last is None:
        return np.asarray(operation(now[1:], now[:-1]), dtype=float)
    found = np.empty_like(now)
    operation(now[:1], last, out=found[:1])
    operation(now[1:], now[:-1], out=found[1:])
    return found


def _previous(now: FloatArray, last: FloatArray | None) -> FloatArray:
    """Return the preceding instants; without `last` the first instant has none."""
    return now[:-1] if last is None else np.concatenate([last, now[:-1]])


def _dot(values: FloatArray, others: FloatArray) -> FloatArray:
    return np.einsum("mi,mi->m", values, others)
