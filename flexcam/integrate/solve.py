"""The time loop: advance block by block and hand every block to the sinks."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flexcam.integrate.local import LocalForces, NoConvergenceError, Schedule
from flexcam.integrate.problem import Problem, SaveAt, State
from flexcam.integrate.scheme import Scheme
from flexcam.integrate.step import Moment, Stepper, first_moment
from flexcam.linalg import FloatArray, IntArray, SingularMatrixError
from flexcam.response import Block, Cause, Memory, Outline, Response, RunFailedError, Series, Sink, Stats, Status
from flexcam.system import CamMotion, Probe, System


def outline(system: System) -> Outline:
    """Return the names of what a run of a system saves.

    Parameters
    ----------
    system
        The system.

    Returns
    -------
    Outline
        Unknowns, probes and channels in the order of a block's columns.
    """
    probes = tuple((p.name, p.components) for p in system.probes)
    return Outline(system.names, probes, tuple((c.name, c.unit) for c in system.channels))


def solve(problem: Problem, scheme: Scheme, *, save: SaveAt | None = None, sinks: Sequence[Sink] = ()) -> Response:
    """Integrate a problem in time with a fixed step.

    Parameters
    ----------
    problem
        System, drive, step and start; it is not changed.
    scheme
        From `newmark`, `hht` or `generalized_alpha`.
    save
        What to keep; None for the defaults of `SaveAt`.
    sinks
        Further takers of the results, beside the returned response.

    Returns
    -------
    Response
        With a status: a run that breaks off keeps what it has and says why.

    Raises
    ------
    RunFailedError
        If not even the first instant can be computed: some motion has neither mass nor stiffness.

    Examples
    --------
    A mass on a spring, started from rest under a constant force:

    >>> from flexcam.integrate import Problem, newmark, solve
    >>> from flexcam.linalg import Triplets
    >>> from flexcam.system import ConstantSpeed, Load, Probe, System
    >>> one = Triplets.from_dense([[1.0]])
    >>> push = Load("push", np.ones(1), lambda motion: np.ones_like(motion.angle))
    >>> system = System(one, Triplets.zeros(1), one, ("x",), (push,), probes=(Probe("x", ("x",), np.eye(1), (None,)),))
    >>> response = solve(Problem(system, ConstantSpeed(1.0), step=0.01, steps=315), newmark())
    >>> bool(abs(response["x"].displacement.max() - 2.0) < 1e-4)
    True
    """
    save = save or SaveAt()
    memory = Memory(outline(problem.system))
    takers = (memory, *sinks)
    started = time.perf_counter()
    status, stats = Status(), Stats(unknowns=problem.system.size)
    try:
        for block, iterations in _Run(problem, scheme, save).blocks():
            good, status = _finite_part(block, problem.system)
            for sink in takers:
                sink.write(good)
            stats = replace(stats, steps=stats.steps + len(good.time), iterations=stats.iterations + iterations)
            if not status.ok:
                break
    except NoConvergenceError:
        text = "the local forces (contacts, joints) did not settle within a step"
        status = Status(Cause.NO_CONVERGENCE, text, "take a smaller step or a softer contact")
    except KeyboardInterrupt:
        status = Status(Cause.INTERRUPTED, "stopped by the user", "what was finished is kept")
    except SingularMatrixError as fault:
        raise RunFailedError(_singular(fault, problem.system)) from None
    seconds = time.perf_counter() - started
    stats = replace(stats, steps=max(stats.steps - 1, 0), factorizations=2, seconds=seconds)
    for sink in takers:
        sink.close(status, stats)
    return memory.response()


def _singular(fault: SingularMatrixError, system: System) -> Status:
    where = ", ".join(system.names[i] for i in fault.unknowns[:6]) or "an unknown"
    return Status(Cause.SINGULAR, f"nothing holds {where}: neither mass nor stiffness", "support it or give it a mass")


class _Run:
    """One run: the step operator and the walk over the blocks."""

    def __init__(self, problem: Problem, scheme: Scheme, save: SaveAt) -> None:
        self._problem, self._save, self._system = problem, save, problem.system
        self._forces = LocalForces(problem.system)
        self._stepper = Stepper(problem.system, scheme, problem.step, self._forces)
        self._load_vectors = problem.system.load_vectors()
        self._start = problem.start or State.rest(problem.system.size)

    def blocks(self) -> Iterator[tuple[Block, int]]:
        """Yield the results block by block, the start in the first, with the iterations each took."""
        size = self._save.field_every * self._save.fields_per_block
        end = self._problem.steps + 1
        last: Moment | None = None
        for first in range(0, end, size):
            steps = np.arange(first, min(first + size, end))
            at = np.asarray(self._start.time + steps * self._problem.step, dtype=float)
            motion = self._problem.drive.at(at)
            with np.errstate(over="ignore", invalid="ignore"):  # a run that blows up is reported by block
                moments = list(self._moments(motion, last))
            last = moments[-1]
            yield self._block(steps, at, motion, moments), sum(m.iterations for m in moments)

    def _moments(self, motion: CamMotion, last: Moment | None) -> Iterator[Moment]:
        loads = self._system.load_histories(motion) @ self._load_vectors
        schedule = self._forces.schedule(motion)
        moment = last
        for i, load in enumerate(loads):
            moment = self._stepper.advance(moment, load, schedule, i) if moment else self._first(load, schedule)
            yield moment

    def _first(self, load: FloatArray, schedule: Schedule) -> Moment:
        start = self._start
        return first_moment(self._system, self._forces, start.displacement, start.velocity, load, schedule)

    def _block(self, steps: IntArray, at: FloatArray, motion: CamMotion, moments: list[Moment]) -> Block:
        series = Series(*(np.array([getattr(m, name) for m in moments]) for name in ("d", "v", "a")))
        local = np.array([m.local for m in moments])
        saved = (steps % self._save.field_every == 0) | (steps == self._problem.steps)
        return Block(
            time=at, angle=motion.angle,
            probes=_probe_series(self._system.probes, series, motion),
            channels=_channels(self._system, local, motion),
            field_time=at[saved], field_angle=motion.angle[saved], fields=series.at(saved),
        )  # fmt: skip


def _probe_series(probes: tuple[Probe, ...], moved: Series, motion: CamMotion) -> Series:
    picked = np.concatenate([p.rows for p in probes]) if probes else np.zeros((0, moved.displacement.shape[1]))
    d, v, a = (series @ picked.T for series in (moved.displacement, moved.velocity, moved.acceleration))
    for column, offset in enumerate(o for p in probes for o in p.offset):
        if offset is not None:
            slope = offset(motion.angle, 1)
            d[:, column] += offset(motion.angle, 0)
            v[:, column] += slope * motion.speed
            a[:, column] += offset(motion.angle, 2) * motion.speed**2 + slope * motion.rate
    return Series(d, v, a)


def _channels(system: System, local: FloatArray, motion: CamMotion) -> FloatArray:
    histories = system.load_histories(motion)
    firsts = np.cumsum([0, *(len(f.offset) for f in system.local_forces)])
    values = np.zeros((len(motion.angle), len(system.channels)))
    for column, channel in enumerate(system.channels):
        places = [int(firsts[force]) + scalar for force, scalar in channel.forces]
        values[:, column] = histories[:, list(channel.loads)].sum(axis=1) + local[:, places].sum(axis=1)
        if channel.factor is not None:
            values[:, column] *= channel.factor(motion.angle, 0)
    return values


def _finite_part(block: Block, system: System) -> tuple[Block, Status]:
    """Return the block up to its last finite instant, and a status that names the first bad one."""
    bad = ~(block.probes.finite() & np.isfinite(block.channels).all(axis=1))
    bad |= block.time >= block.field_time[~block.fields.finite()].min(initial=np.inf)
    if not bad.any():
        return block, Status()
    count = int(np.argmax(bad))
    fields = block.field_time < block.time[count]
    column = np.flatnonzero(~np.isfinite(block.fields.displacement[~fields]).all(axis=0))
    where = system.names[int(column[0])] if column.size else "a probe"
    text = (
        f"the motion of {where} left the range of numbers at t = {block.time[count]:.6g} s, "
        f"cam angle {np.degrees(block.angle[count]):.2f} deg"
    )
    good = np.arange(len(block.time)) < count
    cut = Block(
        block.time[good], block.angle[good], block.probes.at(good), block.channels[good],
        block.field_time[fields], block.field_angle[fields], block.fields.at(fields),
    )  # fmt: skip
    return cut, Status(Cause.NOT_FINITE, text, "take a smaller step, more damping or a lower speed")
