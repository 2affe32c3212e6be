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
        self._matrices = [select_storage(matrix) for matrix in (system.mass, system.damping, system.stiffness)]
        stiff = np.abs(system.stiffness.diagonal()) + np.abs(system.mass.diagonal()) / step**2
        self._weights = np.divide(1.0, np.sqrt(stiff), out=np.zeros_like(stiff), where=stiff > 0.0)
        self._largest = np.full(2, -1.0)

    @property
    def share(self) -> float:
        """Largest value so far, 1; zero without forces, negative if no instant was evaluated."""
        residual, force = self._largest
        return float(residual / force if force > 0.0 else force)

    def evaluate(self, track: Trajectory, seen: Observation, inputs: PrescribedInputs, rows: IntArray) -> None:
        """Evaluate instants."""
        if not len(rows) or not len(self._weights):
            return
        motion = (track.a[rows], track.v[rows], track.d[rows])
        parts = [np.asarray(matrix @ x.T, dtype=float).T for matrix, x in zip(self._matrices, motion, strict=True)]
        parts.append(-seen.histories[rows] @ self._vectors)
        if self._forces.count:
            forces = (seen.forces[rows] @ inputs.acts) * inputs.acting_weights[rows]
            parts.append(-forces @ self._forces.act.vectors)
        terms = np.array(parts)
        self._largest = np.maximum(self._largest, [self._size(terms.sum(axis=0)), self._size(terms)])

    def _size(self, rows: FloatArray) -> float:
        weighted = rows * self._weights
        return float(np.sqrt(np.einsum("...i,...i->...", weighted, weighted).max()))

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
    undamped: FloatArray  #: contact forces without dissipation
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
        self._stores, self._unopposed = StoredEnergy(forces, rough), np.flatnonzero(~forces.opposed[rough])
        places = np.cumsum(~smooth) - 1
        self._lifts = [(int(places[first]), int(places[last]), lift) for first, last, lift in forces.lifts]
        self._storing, self._circulatory = forces.storing[rough], np.flatnonzero(forces.circulatory[rough])
        self._has_impacts = not np.isnan(forces.restitution).all()
        # Vectors of the contacts that are not opposed, and the force acting along each.
        self._acting = np.flatnonzero(forces.act.owner[~forces.opposed].any(axis=0))
        self._acting_forces = forces.act.owner[:, self._acting].argmax(axis=0) if forces.count else self._acting
        self._push_vectors = np.concatenate([system.load_vectors(), forces.act.vectors[self._acting]])
        self._last: _EnergyState | None = None
        self._sums = np.zeros(4)  # work, dissipated, numerical, and the energy at the start

    def block(
        self, track: Trajectory, seen: Observation, prescribed_rates: FloatArray, inputs: PrescribedInputs
    ) -> FloatArray:
        """Return the terms of the balance at the instants of a block, shape (m, 7), J."""
        new = self._evaluate_state(track, seen, prescribed_rates, inputs)
        energy = new.kinetic + new.strain + new.contact
        first = self._last is None
        if first:
            self._sums[3] = energy[0]
        terms = self._dissipation(new, self._last)
        sums = self._sums[:3] + np.cumsum(np.vstack([np.zeros((int(first), 3)), terms]), axis=0)
        self._sums[:3], self._last = sums[-1], new.last()
        residual = sums[:, 0] - (energy - self._sums[3]) - sums[:, 1] - sums[:, 2]
        return np.column_stack([sums[:, 0], new.kinetic, new.strain, new.contact, sums[:, 1], sums[:, 2], residual])

    def state(self) -> Arrays:
        """Return the state for the next block."""
        return {**flatten("held", self._last), "sums": self._sums.copy()}

    def restore(self, state: Arrays) -> None:
        """Restore the state."""
        arrays = select_prefix("held", state)
        self._last, self._sums = (_EnergyState(**arrays) if arrays else None), state["sums"].copy()

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

        damped, load_work = path_work("damped", "d", "v"), path_work("pushes", "paths", "path_rates")
        # The work of a contact along its penetration comes from the unknowns and, if not opposed, from the cam.
        forces, elastic, travel, unopposed = sums("force"), sums("undamped"), changes("penetration"), self._unopposed
        cam_work = 0.5 * _dot(forces[:, unopposed], travel[:, unopposed])
        opposed = 0.5 * _dot(forces, travel) - cam_work
        lossy = self._stores.lossy
        absorbed = 0.5 * _dot(forces[:, lossy] - elastic[:, lossy], travel[:, lossy])
        absorbed -= 0.5 * _dot(sums("by_state"), changes("states"))
        # Difference of the work of the mean force and of the nonlinear force, by Simpson's rule.
        half = 0.5 * sums("penetration"), 0.5 * sums("states"), CamFunctionCache(0.5 * sums("angle"))
        sags = np.zeros_like(travel)
        for i, angle, lift in self._lifts:  # the path is curved: in its middle the contact is as deep as on average
            begin, middle, end = (lift(half[0][:, angle] + share * travel[:, angle], 0) for share in (-0.5, 0.0, 0.5))
            sags[:, i] = 0.5 * (begin + end) - middle
            half[0][:, i] += sags[:, i]
        defects = 2.0 / 3.0 * (0.5 * elastic - self._stores.at(*half)[1]) * travel
        if self._lifts:
            defects += 2.0 / 3.0 * sags * changes("undamped")
        defect = defects.sum(axis=1)
        rotary = self._circulatory  # the rotation of the shaft does the work of their forces without motion
        from_shaft = defects[:, rotary].sum(axis=1) - 0.5 * _dot(sums("undamped")[:, rotary], travel[:, rotary])
        if self._corrected:
            terms = (changes("time") / 6.0)[:, None] * (changes("force") - changes("undamped")) * changes("rate")
            absorbed += terms[:, lossy].sum(axis=1)
            opposed += terms.sum(axis=1) - terms[:, unopposed].sum(axis=1)
            cam_work += terms[:, unopposed].sum(axis=1)
            # The work of these forces on the unknowns is already that of the nonlinear force.
            from_cam = defects[:, unopposed].sum(axis=1)
            cam_work, defect = cam_work - from_cam, defect - from_cam
        impulse = new.impulse if last else new.impulse[1:]
        impact = 0.5 * _dot(impulse, sums("prescribed_rates"))
        impact_lost = 0.5 * _dot(impulse, sums("rate")) if self._has_impacts else 0.0 * impact
        # If a contact closes and reverses within one step, its damping force is that of opening while the path
        # still closes: the product is negative, which is an error of the step.
        loss = np.maximum(damped + absorbed + impact_lost, 0.0)
        numerical = load_work - opposed - changes("kinetic") - changes("elastic") + impact + defect + (absorbed - loss)
        work = load_work + cam_work + impact + self._cam_energy(new, last) + from_shaft
        return np.column_stack([work, loss, numerical])

    def _cam_energy(self, new: _EnergyState, last: _EnergyState | None) -> FloatArray:
        """Return the energy stored by cam rotation in contacts whose law depends on the angle."""
        begin = 0 if last else 1
        before = _previous(new.penetration, last and last.penetration), _previous(new.states, last and last.states)
        later = self._stores.varying(*before, CamFunctionCache(new.angle[begin:]))
        angle, changing = _previous(new.angle, last and last.angle), _previous(new.changing, last and last.changing)
        earlier = self._stores.varying(new.penetration[begin:], new.states[begin:], CamFunctionCache(angle))
        return 0.5 * (later - changing + new.changing[begin:] - earlier)

    def _evaluate_state(
        self, track: Trajectory, observed: Observation, prescribed_rates: FloatArray, inputs: PrescribedInputs
    ) -> _EnergyState:
        penetrations, forces, d = observed.penetrations[:, self._rough], observed.forces[:, self._rough], track.d
        stored, elastic, by_state = self._stores.at(penetrations, observed.states, inputs.cam)
        changing = self._stores.varying(penetrations, observed.states, inputs.cam)
        smooth = np.zeros(len(d))
        if self._smooth is not None:
            smooth = self._smooth.at(observed.penetrations[:, self._smooth_scalars], observed.states, inputs.cam)[0]
        strain, empty = 0.5 * self._K.twice(d) + self._system.stored, np.zeros((len(d), 0))
        motion = (d, track.v, self._C.times(track.v)) if self._damped else (empty, empty, empty)
        speeds = (self._push_vectors @ track.v.T).T if self._corrected else empty
        rates = observed.rates[:, self._rough] if self._has_impacts or self._corrected else empty
        impact = (
            (prescribed_rates[:, self._rough], track.impulse[:, self._rough]) if self._has_impacts else (empty, empty)
        )
        acting = observed.forces[:, self._acting_forces] * inputs.acting_weights[:, self._acting]
        return _EnergyState(
            track.time, inputs.angle, 0.5 * self._M.twice(track.v), strain, strain + smooth, stored + smooth,
            *motion, np.hstack([observed.histories, acting]), (self._push_vectors @ d.T).T, speeds,
            forces if self._storing.all() else forces * self._storing, elastic, penetrations, observed.states, by_state,
            changing, rates, *impact,
        )  # fmt: skip


class _QuadraticForm:
    """A matrix in dense form, or its diagonal if it is diagonal."""

    def __init__(self, matrix: Triplets) -> None:
        self._diagonal = matrix.diagonal() if (matrix.rows == matrix.cols).all() else None
        self._matrix: FloatArray | csr_array = select_storage(matrix) if self._diagonal is None else np.zeros((0, 0))

    def times(self, rows: FloatArray) -> FloatArray:
        """Return the product with every row, shape (m, n)."""
        if self._diagonal is not None:
            return rows * self._diagonal
        return np.asarray(rows @ self._matrix, dtype=float)

    def twice(self, rows: FloatArray) -> FloatArray:
        """Return x A x of every row x, shape (m,)."""
        return np.square(rows) @ self._diagonal if self._diagonal is not None else _dot(self.times(rows), rows)


def _combine_successive(operation: np.ufunc, now: FloatArray, last: FloatArray | None) -> FloatArray:
    """Return sum or difference of successive instants; without `last` the first instant has none."""
    if last is None:
        return np.asarray(operation(now[1:], now[:-1]), dtype=float)
    result = np.empty_like(now)
    operation(now[:1], last, out=result[:1])
    operation(now[1:], now[:-1], out=result[1:])
    return result


def _previous(now: FloatArray, last: FloatArray | None) -> FloatArray:
    """Return the preceding instants; without `last` the first instant has none."""
    return now[:-1] if last is None else np.concatenate([last, now[:-1]])


def _dot(values: FloatArray, factors: FloatArray) -> FloatArray:
    return np.einsum("mi,mi->m", values, factors)
