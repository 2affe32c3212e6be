"""The time loop: advance block by block and hand every block to the sinks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from flexcam.integrate.energy import PARTS, EnergyAccount
from flexcam.integrate.events import Walker
from flexcam.integrate.first import Starter
from flexcam.integrate.local import LocalForces, Schedule
from flexcam.integrate.method import Method
from flexcam.integrate.moment import Instant, Moment
from flexcam.integrate.pace import Norm, Pace, StepFloorError
from flexcam.integrate.problem import Problem, State
from flexcam.integrate.settle import NoConvergenceError
from flexcam.integrate.within import basis_of, shown, within
from flexcam.linalg import FloatArray, IntArray, SingularMatrixError
from flexcam.response import (
    STATE,
    Block,
    Cause,
    Memory,
    Outline,
    Response,
    RunFailedError,
    SaveAt,
    Series,
    Sink,
    Stats,
    Status,
)
from flexcam.system import CamMotion, Observed, Probe, System


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
    energies = tuple((f"energy.{part}", "J") for part in PARTS)
    states = [
        (f"{STATE}{force.name}.{i}", "1") for force in system.local_forces for i in range(len(force.law.start_state))
    ]
    names = system.carried.names if system.carried else system.names
    return Outline(names, probes, (*((c.name, c.unit) for c in system.channels), *energies, *states))


def solve(
    problem: Problem,
    scheme: Method,
    *,
    save: SaveAt | None = None,
    sinks: Sequence[Sink] = (),
    stop: Callable[[], bool] | None = None,
) -> Response:
    """Integrate a problem in time.

    Parameters
    ----------
    problem
        System, drive, step and start; it is not changed.
    scheme
        From `newmark`, `bathe`, `central_difference`, `exact`, `radau` or their like.
    save
        What to keep; None for the defaults of `SaveAt`.
    sinks
        Further takers of the results, beside the returned response.
    stop
        Asked before every step; the run ends, keeping what it has, when it says so.

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
    memory = Memory(outline(problem.system))
    takers = (memory, *sinks)
    started = time.perf_counter()
    returns = problem.start.periodicity if problem.start else None
    basis = basis_of(problem)
    inside = problem if basis is None else within(problem, basis)
    stats = Stats(unknowns=inside.system.size, periodicity=-1.0 if returns is None else returns)
    status = Status()
    try:
        run = _Run(inside, scheme, save or SaveAt(), stop or _never)
        for block in run.blocks():
            for sink in takers:
                sink.write(block if basis is None else shown(block, basis))
            steps = stats.steps + len(block.time)
            stats = run.counted(replace(stats, steps=steps))
        status = run.status
    except KeyboardInterrupt:
        status = _STOPPED
    except SingularMatrixError as fault:
        status = _singular(fault, inside.system)
    except OSError as fault:  # of a sink: the numbers computed so far are still in memory
        status = Status(
            Cause.NOT_SAVED, f"the result could not be written: {fault}", "free space or name another folder"
        )
    stats = replace(stats, steps=max(stats.steps - 1, 0), seconds=time.perf_counter() - started)
    _close(takers, status, stats)
    if status.cause is Cause.SINGULAR:
        raise RunFailedError(status)
    return memory.response()


def _close(takers: Sequence[Sink], status: Status, stats: Stats) -> None:
    for sink in takers:
        with suppress(*[OSError] if status.cause is Cause.NOT_SAVED else []):
            sink.close(status, stats)


def _singular(fault: SingularMatrixError, system: System) -> Status:
    where = ", ".join(system.names[i] for i in fault.unknowns[:6]) or "an unknown"
    text = f"nothing determines the motion of {where}: no mass, and no stiffness to place it"
    return Status(Cause.SINGULAR, text, "support it, or give it a mass or a spring")


class _Run:
    """One run: the walk over the blocks."""

    def __init__(self, problem: Problem, scheme: Method, save: SaveAt, stop: Callable[[], bool]) -> None:
        self._problem, self._save, self._system, self._stop = problem, save, problem.system, stop
        self._forces = LocalForces(problem.system)
        if refusal := scheme.refusal(problem.system, problem.step):
            raise refusal
        self._starter = Starter(problem.system, self._forces)
        self._load_vectors = problem.system.load_vectors()
        self._walker = Walker(problem.system, scheme, problem.step, self._forces, self._starter, self._at)
        self._pace = self._paced(problem, scheme)
        self._start = problem.start or State.rest(problem.system.size)
        self._account = EnergyAccount(problem.system, self._forces)
        self.status, self._iterations, self._substeps = Status(), 0, 0

    def _paced(self, problem: Problem, scheme: Method) -> Pace | None:
        if problem.adaptive is None or not problem.system.size:
            return None
        norm = Norm(problem.system, _pilot(problem, scheme))
        return Pace(self._walker, self._at, problem.step, problem.adaptive, norm)

    def counted(self, stats: Stats) -> Stats:
        """Return figures of the run so far."""
        stats = replace(stats, iterations=self._iterations, events=self._walker.events)
        return replace(stats, substeps=self._substeps, rejected=self._pace.rejected) if self._pace else stats

    def blocks(self) -> Iterator[Block]:
        """Yield the results block by block, the start in the first.

        A block is cut before the first instant that is not finite or did not settle, and is then the last one;
        `status` says why.
        """
        size = self._save.field_every * self._save.fields_per_block
        end = self._problem.steps + 1
        last: Moment | None = None
        for first in range(0, end, size):
            steps = np.arange(first, min(first + size, end))
            with np.errstate(over="ignore", invalid="ignore"):  # a run that blows up is reported by block
                walked, self.status = self._advance(steps, last)
            if walked:
                self._iterations += sum(m.iterations for part in walked for m in part)
                self._substeps += sum(len(part) for part in walked)
                yield self._block(steps[: len(walked)], walked)
                last = walked[-1][-1]
            if not self.status.ok:
                return

    def _at(self, time: float) -> Instant:
        motion = self._problem.drive.at(np.array([time]))
        load = self._system.load_histories(motion)[0] @ self._load_vectors
        return Instant(time, load, self._forces.schedule(motion))

    def _times(self, steps: IntArray) -> FloatArray:
        """Return the times after so many steps; a run that goes on counts from where the first one began."""
        start, step = self._start, self._problem.step
        return np.asarray((start.time - start.taken * step) + (start.taken + steps) * step, dtype=float)

    def _advance(self, steps: IntArray, last: Moment | None) -> tuple[list[list[Moment]], Status]:
        """Return, per step, the instants that end it: stops at events, and the step's own end as the last.

        At saved fields the forces are taken anew from the motion, so that a run from there is this one bit by bit.
        """
        at = self._times(steps)
        motion = self._problem.drive.at(at)
        schedule = self._forces.schedule(motion)
        loads = self._system.load_histories(motion) @ self._load_vectors
        walked: list[list[Moment]] = []
        moment, walker = last, self._pace or self._walker
        for i, load in enumerate(loads):
            if self._stop():
                return walked, _STOPPED
            to = Instant(float(at[i]), load, schedule, i)
            try:
                part = walker.walk(moment, to) if moment else [self._starter.first(self._start, to)]
            except NoConvergenceError as fault:
                return walked, _unsettled(fault.forces, at[i], motion.angle[i])
            except StepFloorError as fault:
                return walked, _too_small(fault, self._system, at[i], motion.angle[i])
            if steps[i] % self._save.field_every == 0:
                part[-1] = self._starter.resumed(part[-1], to)
            walked.append(part)
            moment = part[-1]
        return _in_range(walked, last, self._system, motion.angle)

    def _block(self, steps: IntArray, walked: list[list[Moment]]) -> Block:
        moments = [moment for part in walked for moment in part]
        ends: IntArray = np.cumsum([len(part) for part in walked]) - 1
        motion = self._problem.drive.at(np.array([m.time for m in moments]))
        schedule = self._forces.schedule(motion)
        seen, carried = self._observed(moments, motion, schedule)
        energies = self._account.block(moments, seen, carried, schedule)[ends]
        seen = seen.at(ends)
        series = Series(seen.displacement, seen.velocity, seen.acceleration)
        saved = (steps % self._save.field_every == 0) | (steps == self._problem.steps)
        time, angle = np.array([part[-1].time for part in walked]), seen.motion.angle
        channels = [channel.value(seen) for channel in self._system.channels]
        return Block(
            time=time, angle=angle, probes=_probe_series(self._system.probes, series, seen.motion),
            channels=np.column_stack([*channels, energies, seen.states]),
            field_time=time[saved], field_angle=angle[saved],
            fields=(Series(*self._system.carried.at(seen.motion)) if self._system.carried else series).at(saved),
        )  # fmt: skip

    def _observed(self, moments: list[Moment], motion: CamMotion, schedule: Schedule) -> tuple[Observed, FloatArray]:
        """Return what is observed, and the part of the sensed rates that the cam alone causes."""
        d, v, a, forces = (np.array([getattr(m, name) for m in moments]) for name in ("d", "v", "a", "local"))
        gaps, rates, carried = self._forces.sensed(d, v, schedule)
        states = np.array([m.inner.state for m in moments])
        return Observed(motion, d, v, a, self._system.load_histories(motion), forces, gaps, rates, states), carried


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


_STOPPED = Status(Cause.INTERRUPTED, "stopped by the user", "what was finished is kept")

_LARGEST = 1e100
"""Size (SI) beyond which a motion has diverged; its squares, as stresses need them, are still numbers."""


def _never() -> bool:
    return False


def _in_range(
    walked: list[list[Moment]], before: Moment | None, system: System, angle: FloatArray
) -> tuple[list[list[Moment]], Status]:
    """Return the steps up to the last one in range, and a status that names what left it first."""
    motion = np.array([_everything(part[-1]) for part in walked])
    good = (np.abs(motion) < _LARGEST).all(axis=1)  # False for NaN as well
    if good.all():
        return walked, Status()
    count = int(np.argmin(good))
    previous = walked[count - 1][-1] if count else before
    # One overflow spoils every unknown within its step: what was ahead just before is what left.
    ahead = np.where(np.isfinite(motion[count]), np.abs(motion[count]), np.inf)
    if previous is not None and np.count_nonzero(ahead == ahead.max()) > 1:
        ahead = np.abs(_everything(previous))
    names = [*(3 * system.names), *(name for force in system.local_forces for name in [force.name] * len(force.sense))]
    when = _instant(walked[count][-1].time, angle[count])
    text = f"{names[int(np.argmax(ahead))]} left the range of numbers {when}"
    return walked[:count], Status(Cause.NOT_FINITE, text, "take a smaller step, more damping or a lower speed")


def _everything(moment: Moment) -> FloatArray:
    return np.concatenate([moment.d, moment.v, moment.a, moment.local])


def _unsettled(forces: list[str], at: float, angle: float) -> Status:
    text = f"{', '.join(dict.fromkeys(forces))} did not settle within the step {_instant(at, angle)}"
    return Status(Cause.NO_CONVERGENCE, text, "take a smaller step or a softer contact")


def _too_small(fault: StepFloorError, system: System, at: float, angle: float) -> Status:
    text = (
        f"the error of {system.names[fault.unknown]} stays at {fault.times:.3g} times the tolerance with steps of "
        f"{fault.step:.3g} s {_instant(at, angle)}"
    )
    return Status(Cause.STEP_TOO_SMALL, text, "allow a larger run.adaptive.tolerance or a smaller smallest step")


def _pilot(problem: Problem, method: Method) -> Series:
    """Return the motion of the first revolution by the steps as given: errors are measured against its size."""
    begin = problem.start.time if problem.start else 0.0
    times: FloatArray = begin + problem.step * np.arange(problem.steps + 1, dtype=float)
    angle = problem.drive.at(times).angle
    steps = max(int(np.count_nonzero(angle < angle[0] + 2.0 * np.pi)), 1)
    first = replace(problem, steps=min(steps, problem.steps), adaptive=None)
    return solve(first, method, save=SaveAt(field_every=max(first.steps // _LOOKS, 1))).fields


_LOOKS = 200
"""Fields of the pilot run that are looked at."""


def _instant(at: float, angle: float) -> str:
    return f"at t = {at:.6g} s, cam angle {np.degrees(angle):.2f} deg"
