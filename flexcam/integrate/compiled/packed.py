"""An uncoupled system as the few plain arrays that the compiled step takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.integrate.local import LocalForces
from flexcam.integrate.schedule import Schedule, Weights
from flexcam.integrate.scheme import Scheme
from flexcam.linalg import FloatArray, IntArray
from flexcam.system import AngleFunction, Evaluated, Formula, Formulated, Kind, System

_NONE = np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class PackedForces:
    """The local forces of a system as data.

    Parameters
    ----------
    laws
        Per formula: kind, first scalar, number of scalars that are needed, where its constants and its functions begin,
        its internal state, and where the constants of its friction begin; shape (l, 7).
    constants
        All of them.
    places
        Where the sensing and the acting vectors of each scalar begin, shape (2, c + 1).
    functions
        All functions of the cam angle.
    loosely
        Whether each of them only bounds a law, so that it need not be known well.
    """

    laws: IntArray
    constants: FloatArray
    places: IntArray
    functions: tuple[AngleFunction, ...]
    loosely: tuple[bool, ...]

    @classmethod
    def of(cls, forces: LocalForces) -> PackedForces:
        """Return the forces of a system whose laws are all known as formulas; others are left out."""
        each: list[tuple[Formula, int]] = []
        for law, part, inner in forces.laws:
            formulas = law.formulas(part.stop - part.start) if isinstance(law, Formulated) else None
            each += [(one, inner.start) for one in formulas or ()]
        rows: list[tuple[int, ...]] = []
        constants: list[float] = []
        functions: list[AngleFunction] = []
        loosely: list[bool] = []
        places = np.vstack([_begins(stack.owner) for stack in (forces.sense, forces.act)])
        first = 0
        for one, state in each:
            begin = len(constants)
            constants += [*one.constants, *(one.friction or ())]
            scalars = _bent(places, first) if one.kind is Kind.ARCH else one.scalars
            rows.append((one.kind, first, scalars, begin, len(functions), state, begin + len(one.constants)))
            functions += one.functions
            loosely += [one.kind is Kind.LINE and i == 0 for i in range(len(one.functions))]
            first += one.scalars
        laws = np.array(rows, dtype=np.intp).reshape(-1, 7)
        return cls(laws, np.array(constants, dtype=float), places, tuple(functions), tuple(loosely))

    def cam(self, schedule: Schedule) -> FloatArray:
        """Return what follows from the cam side by side, a row per instant.

        Weights of the sensing vectors, their rates, weights of the acting ones, offsets, their rates, functions.
        """
        widths = [len(part.still) for part in schedule.parts]
        found = np.empty((len(schedule.angle), sum(widths) + len(self.functions)))
        self.put(schedule, found)
        return found

    def put(self, schedule: Schedule, into: FloatArray) -> None:
        """Put what `cam` returns into an array."""
        end = 0
        for part in schedule.parts:
            begin, end = end, end + len(part.still)
            part.put(into[:, begin:end])
        for i, function in enumerate(self.functions, end):
            into[:, i] = schedule.cam(function, 0)

    def schedule(self, cam: FloatArray, angle: FloatArray, forces: LocalForces) -> Schedule:
        """Return what such rows were made of, at their cam angles (rad)."""
        senses, acts, c = len(forces.sense.vectors), len(forces.act.vectors), forces.count
        cuts = np.cumsum([senses, senses, acts, c, c])
        sensed, rates, acted, offsets, offset_rates, _ = (Weights.known(part) for part in np.split(cam, cuts, axis=1))
        owners = forces.sense.owner, forces.act.owner
        return Schedule(sensed, rates, acted, offsets, offset_rates, angle, *owners, Evaluated(angle))


def _bent(places: IntArray, first: int) -> int:
    """Return how many scalars of an arch are needed: the planes behind those in which something moves are left out."""
    moved = [plane for plane in (1, 2) if (places[:, first + 3 * plane + 1] > places[:, first + 3 * plane - 2]).any()]
    return 1 + 3 * max(moved, default=0)


def _begins(owner: FloatArray) -> IntArray:
    return np.concatenate([[0], np.cumsum(owner.sum(axis=1))]).astype(np.intp)


@dataclass(frozen=True, eq=False)
class Operator:
    """What a step of one length does to the motions of an uncoupled system, and room for that of parts of it.

    Parameters
    ----------
    scheme
        Step (s), beta, gamma, alpha_m and alpha_f, shape (2, 5).
    motions
        Mass, damping, stiffness and, where damping couples nothing, the inverse of the step's operator; then what a
        unit along each acting vector adds to the accelerations, shape (2, 4 + acting, n).
    give
        What it adds to those that are sensed, shape (2, acting, sensing).
    inverse
        The inverse where damping does couple, shape (n, n); else empty.
    """

    scheme: FloatArray
    motions: FloatArray
    give: FloatArray
    inverse: FloatArray


@dataclass(frozen=True, eq=False)
class PackedSystem:
    """An uncoupled system as data.

    Parameters
    ----------
    motions
        Mass, damping and stiffness, shape (3, n).
    coupled
        Damping beside its diagonal, shape (n, n); empty where there is none.
    vectors
        Of the local forces, those that sense and then those that act, shape (sensing + acting, n).
    sensing
        How many sense.
    """

    motions: FloatArray
    coupled: FloatArray
    vectors: FloatArray
    sensing: int

    @classmethod
    def of(cls, system: System, forces: LocalForces) -> PackedSystem:
        """Return those of a system whose mass and stiffness are diagonal."""
        own = system.damping.diagonal()
        beside = system.damping.dense() - np.diag(own)
        motions = np.array([system.mass.diagonal(), own, system.stiffness.diagonal()])
        vectors = np.vstack([forces.sense.vectors, forces.act.vectors])
        return cls(motions, beside if beside.any() else _NONE, vectors, len(forces.sense.vectors))

    def operator(self, scheme: Scheme, step: float) -> Operator:
        """Return what a step does."""
        new = 1.0 - scheme.alpha_f
        mass, damping, stiffness = self.motions
        whole = (1.0 - scheme.alpha_m) * mass + new * (
            scheme.gamma * step * damping + scheme.beta * step**2 * stiffness
        )
        sensing, acting = self.vectors[: self.sensing], self.vectors[self.sensing :]
        single, inverse = np.zeros_like(whole), _NONE
        if len(self.coupled):
            inverse = np.asarray(np.linalg.inv(np.diag(whole) + new * scheme.gamma * step * self.coupled), dtype=float)
            answering = new * acting @ inverse.T
        else:
            single = 1.0 / whole
            answering = new * acting * single
        weights = np.array([step, scheme.beta, scheme.gamma, scheme.alpha_m, scheme.alpha_f])
        motions, give = np.vstack([self.motions, single, answering]), answering @ sensing.T
        twice = [np.array([one, one]) for one in (weights, motions, give)]
        return Operator(twice[0], twice[1], twice[2], inverse)
