"""Time integration of a problem, and digest of a problem for resuming."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import reduce
from hashlib import sha256
from importlib import import_module
from typing import Any

import numpy as np

from flexcam.core import FloatArray, IntArray, SingularMatrixError
from flexcam.core.errors import refuse
from flexcam.dynamics.active_dofs import expand_block
from flexcam.dynamics.basis import Basis
from flexcam.dynamics.blocks import Arrays, Block, Checkpoint, CheckpointSink, CompletedPart, SaveAt, Series, Sink
from flexcam.dynamics.cam_motion import CamMotion
from flexcam.dynamics.energy import PARTS, EnergyBalance, EquilibriumResidual
from flexcam.dynamics.engine import CONTINUE, STOPPED, Engine
from flexcam.dynamics.engine_selection import MAX_MODES, SelectedEngine, create_engine, forces_of, select_engine
from flexcam.dynamics.generalized_alpha import newmark
from flexcam.dynamics.integrator import Method
from flexcam.dynamics.local_forces import LocalForces
from flexcam.dynamics.memory import MemorySink, ResponseSink
from flexcam.dynamics.modal_engine import ProbeEngine
from flexcam.dynamics.problem import Problem
from flexcam.dynamics.response import STATE, Outline, Response
from flexcam.dynamics.status import Cause, RunFailedError, Stats, Status
from flexcam.dynamics.step_state import ProbeTrajectory, SensedTrajectory, Trajectory
from flexcam.dynamics.system import Observation, PrescribedMotion, Probe, System

_INSTANTS = 64
"""Number of instants of the run at which loads and sensed scalars enter the digest."""

_BEGINNING, _APART = 8192, 13
"""Additional initial steps and their spacing: instants over the whole run may share a cam angle."""


def fingerprint(problem: Problem, method: Method, save: SaveAt) -> str:
    """Return a digest of a problem: matrices, loads, prescribed motion, steps, method and output settings.

    The initial state is excluded: its rounding may depend on the number of threads, and a resumed run does not begin
    there.
    """
    system = problem.system
    forces = LocalForces(system)
    spread = np.linspace(0, problem.steps, _INSTANTS).round().astype(np.intp)
    steps = np.union1d(spread, np.arange(0, min(problem.steps, _BEGINNING) + 1, _APART))
    motion = problem.drive.at(problem.times(steps))
    inputs = forces.prescribed_inputs(motion)
    arrays = [motion.angle, motion.speed, system.load_vectors(), system.load_histories(motion), forces.act.vectors]
    arrays += [forces.sense.vectors, inputs.rows, forces.table.laws, forces.table.constants]
    for matrix in (system.mass, system.damping, system.stiffness):
        arrays += [matrix.rows, matrix.cols, matrix.values]
    arrays += [probe.rows for probe in system.probes]
    setup = (method, save, problem.step, problem.steps, problem.adaptive, problem.prune, problem.engine, system.names)
    digest = sha256(repr((*setup, forces.names)).encode())
    for array in arrays:
        digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def outline(system: System, save: SaveAt | None = None) -> Outline:
    """Return the names of the results of a system, with all channels by default."""
    save = save or SaveAt()
    probes = tuple((p.name, p.components) for p in system.probes)
    names = system.names
    if not save.channels:
        return Outline(names, probes, ())
    channels = tuple((c.name, c.unit) for c in system.channels)
    if not save.energies:
        return Outline(names, probes, channels)
    energies = () if system.prescribed_motion else tuple((f"energy.{part}", "J") for part in PARTS)
    states = [(f"{STATE}{force.name}.{i}", "1") for force in system.local_forces for i in range(force.states)]
    return Outline(names, probes, (*channels, *energies, *states))


def solve(
    problem: Problem,
    scheme: Method,
    *,
    save: SaveAt | None = None,
    sinks: Sequence[Sink] = (),
    stop: Callable[[], bool] | None = None,
    until: float | None = None,
    memory: ResponseSink | None = None,
    resume: CompletedPart | None = None,
) -> Response:
    """Integrate a problem in time.

    Parameters
    ----------
    problem
        System, drive, step and initial state; not modified.
    scheme
        From `newmark`, `bathe`, `central_difference`, `collocation`, `radau` or another constructor.
    save
        Output settings; None for the defaults of `SaveAt`.
    sinks
        Additional sinks of the results.
    stop
        Stop callback, called before every step; if true, the run ends with the results so far.
    until
        Latest end of the run, with the results so far, s of `time.monotonic`; None for no limit.
    memory
        Sink that provides the returned response; None to store everything in memory.
    resume
        Completed part of an interrupted run of this problem: the run resumes there, and all sinks receive the earlier
        results first. None to begin at the start.

    Returns
    -------
    Response
        Results with a status, which gives the reason if the run ended early.

    Raises
    ------
    RunFailedError
        If the first instant cannot be computed because a motion has neither mass nor stiffness.

    Examples
    --------
    A mass on a spring, started from rest under a constant force:

    >>> from flexcam.dynamics import Problem, newmark, solve
    >>> from flexcam.core import Triplets
    >>> from flexcam.dynamics import ConstantSpeed, Load, Probe, System
    >>> one = Triplets.from_dense([[1.0]])
    >>> push = Load("push", np.ones(1), lambda motion: np.ones_like(motion.angle))
    >>> system = System(one, Triplets.zeros(1), one, ("x",), (push,), probes=(Probe("x", ("x",), np.eye(1), (None,)),))
    >>> response = solve(Problem(system, ConstantSpeed(1.0), step=0.01, steps=315), newmark())
    >>> bool(abs(response["x"].displacement.max() - 2.0) < 1e-4)
    True
    """
    output = save or SaveAt()
    names = outline(problem.system, output)
    memory = memory or MemorySink(names, problem.steps + 1, problem.steps // output.field_every + 2)
    all_sinks = (memory, *sinks)

    def is_late() -> bool:
        return until is not None and time.monotonic() >= until

    checkpoint_sinks = [sink for sink in sinks if isinstance(sink, CheckpointSink)]
    digest = fingerprint(problem, scheme, output) if checkpoint_sinks or resume else ""
    if resume and resume.checkpoint.problem != digest:
        why = "a run can be continued only with the problem that began it"
        allowed = "the completed part of a run of this problem"
        raise refuse("resume", "the completed part of a run of another problem", allowed, why, "run it from its start")
    begin = time.perf_counter()
    error = problem.start.periodicity if problem.start else None
    selected = select_engine(problem, scheme)
    reduced = selected.problem
    sizes = len(names.unknowns), 0 if reduced.system.is_kinematic else reduced.system.size
    stats = Stats(
        engine=selected.engine, size=sizes[0], unknowns=sizes[1], periodicity=-1.0 if error is None else error
    )
    status, can_resume = Status(), resume is not None
    try:
        forces = forces_of(selected, scheme)
        engine = create_engine(
            selected, scheme, forces, output, lambda: is_late() or (stop is not None and stop()), pilot
        )
        run = _Run(reduced, engine, forces, output, scheme.order)
        if resume is not None:
            for block in resume.blocks():
                for sink in all_sinks:
                    sink.write(block)
            run.restore(resume.checkpoint.arrays)
            stats = run.statistics(replace(stats, steps=resume.checkpoint.steps))
            begin -= float(resume.checkpoint.arrays.get("seconds", 0.0))
        with limit_blas_threads(selected):
            for block in run.blocks(stats.steps):
                expanded = reduce(expand_block, selected.bases, block)
                for sink in all_sinks:
                    sink.write(expanded)
                stats = run.statistics(replace(stats, steps=stats.steps + len(block.time)))
                if checkpoint_sinks and run.status.ok:
                    seconds = np.array(time.perf_counter() - begin)
                    checkpoint = Checkpoint(stats.steps, digest, {**run.state(), "seconds": seconds})
                    for sink in checkpoint_sinks:
                        sink.write_checkpoint(checkpoint)
                    can_resume = True
        status = _TIME_UP if run.status is STOPPED and is_late() else run.status
    except KeyboardInterrupt:
        status = STOPPED
    except SingularMatrixError as fault:
        status = singular_status(fault, reduced.system)
    except OSError as fault:  # error of a sink: the results so far are still in memory
        status = _write_failure(fault)
    if checkpoint_sinks and not can_resume and status.cause in (Cause.TIME_LIMIT, Cause.INTERRUPTED):
        status = replace(status, remedy=_NOTHING_TO_RESUME)
    stats = replace(stats, steps=max(stats.steps - 1, 0), seconds=time.perf_counter() - begin)
    for sink in sinks:
        try:
            sink.close(status, stats)
        except OSError as fault:
            status = _write_failure(fault)
    memory.close(status, stats)
    if status.cause is Cause.SINGULAR:
        raise RunFailedError(status)
    return memory.response()


def limit_blas_threads(selected: SelectedEngine) -> AbstractContextManager[object]:
    """Return a context with one thread of the linear algebra for a small system; the host's setting returns after it.

    In small matrices threads only hinder each other: a run of 66 unknowns takes twice the time.
    """
    if (
        selected.engine != "direct"
        or selected.problem.system.size > MAX_MODES
        or os.environ.get("OPENBLAS_NUM_THREADS") == "1"
    ):
        return nullcontext()
    return _SINGLE_THREAD


class _SingleThread:
    """One thread of the linear algebra while any run of the process needs it: the last one restores the setting."""

    def __init__(self) -> None:
        self._lock, self._runs = threading.Lock(), 0
        self._limits: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if not self._runs:
                control: Any = import_module("threadpoolctl")
                self._limits = control.threadpool_limits(1, user_api="blas")
            self._runs += 1

    def __exit__(self, *fault: object) -> None:
        with self._lock:
            self._runs -= 1
            if not self._runs and self._limits is not None:
                self._limits.restore_original_limits()


_SINGLE_THREAD = _SingleThread()


def _write_failure(fault: OSError) -> Status:
    text = f"the result could not be written: {fault}"
    remedy = "free space or name another folder; --resume continues from the saved part, if there is one"
    return Status(Cause.NOT_SAVED, text, remedy)


def singular_status(fault: SingularMatrixError, system: System) -> Status:
    """Return the status of an undetermined motion."""
    names = ", ".join(system.names[i] for i in fault.unknowns[:6]) or "an unknown"
    text = f"nothing determines the motion of {names}: no mass, and no stiffness to place it"
    return Status(Cause.SINGULAR, text, "support it, or give it a mass or a spring")


class _Observer:
    def __init__(self, problem: Problem, forces: LocalForces, save: SaveAt, order: int) -> None:
        self._problem, self._system, self._save, self._forces = problem, problem.system, save, forces
        self._checks: tuple[EnergyBalance, EquilibriumResidual] | None = None
        if save.channels and save.energies and not problem.system.prescribed_motion:
            residual = EquilibriumResidual(problem.system, forces, problem.step)
            self._checks = EnergyBalance(problem.system, forces, order), residual

    def block(self, steps: IntArray, track: Trajectory, sensed: SensedTrajectory | None = None) -> Block:
        """Return the observations at the ends of some steps, with the sensed scalars if they are known."""
        motion, time = replace(self._problem.drive.at(track.time), known=track.cam), track.time
        ends = track.ends if len(track.ends) < len(time) else slice(None)
        fields, series = track.ends[self._save.fields(steps, self._problem.steps)], Series(track.d, track.v, track.a)
        probes = _probe_series(self._system.probes, series, motion)
        return Block(
            time=time[ends], angle=motion.angle[ends], probes=probes.at(ends),
            channels=self._channels(steps, track, motion, sensed) if self._save.channels else np.zeros((len(steps), 0)),
            field_time=time[fields], field_angle=motion.angle[fields],
            fields=series if len(fields) == len(time) else series.at(fields),
        )  # fmt: skip

    def _channels(
        self, steps: IntArray, track: Trajectory, motion: CamMotion, sensed: SensedTrajectory | None
    ) -> FloatArray:
        """Return channels, energies and internal states at the ends of steps; check the balance of forces at some."""
        if sensed is None:
            inputs = self._forces.prescribed_inputs(motion)
            penetrations, rates, prescribed_rates = self._forces.sense_motion(track.d, track.v, inputs)
        else:
            inputs, penetrations, rates = sensed.inputs, sensed.penetration, sensed.rate
            prescribed_rates = np.zeros_like(rates)  # for energies alone
        forces = np.asfortranarray(track.local)  # contiguous per scalar, like the sensed scalars
        series, histories = Series(track.d, track.v, track.a), self._system.load_histories(motion)
        observed = Observation(motion, inputs.cam, series, histories, forces, penetrations, rates, track.state)
        columns = [channel.value(observed) for channel in self._system.channels]
        if self._checks:
            balance, residual = self._checks
            saved = self._save.fields(steps, self._problem.steps)
            residual.evaluate(track, observed, inputs, track.ends[saved & (steps > 0)])  # step 0 is no step
            columns.append(balance.block(track, observed, prescribed_rates, inputs))
        if self._save.energies:
            columns.append(observed.states)
        values = np.column_stack([np.zeros((len(track.time), 0)), *columns])
        return values[track.ends] if len(steps) < len(values) else values


class Recorder:
    """Response of a motion that is given block by block: probes and channels, without energies and fields.

    The bases lead from the unknowns of the motion to those of the response, innermost first.
    """

    def __init__(self, problem: Problem, forces: LocalForces, method: Method, bases: Sequence[Basis]) -> None:
        save = SaveAt(field_every=problem.steps, energies=False)
        self._memory = MemorySink(outline(problem.system, save), problem.steps + 1, 2)
        self._observer, self._bases, self._steps = _Observer(problem, forces, save, method.order), bases, problem.steps

    def write(self, steps: IntArray, sensed: SensedTrajectory) -> Response:
        """Store the instants at the ends of some steps, and return them."""
        block = reduce(expand_block, self._bases, self._observer.block(steps, sensed.track, sensed))
        self._memory.write(block)
        return self._memory.response_of(block)

    def response(self) -> Response:
        """Return the response."""
        self._memory.close(Status(), Stats(steps=self._steps))
        return self._memory.response()


class _Run(_Observer):
    """A run: blocks of an engine with all observations."""

    def __init__(self, problem: Problem, engine: Engine, forces: LocalForces, save: SaveAt, order: int) -> None:
        super().__init__(problem, forces, save, order)
        self._engine = engine
        components = sum(len(probe.rows) for probe in problem.system.probes)
        width = components if isinstance(engine, ProbeEngine) else problem.system.size
        self._at_once = max(AT_ONCE // max(width, 1), LEAST_AT_ONCE)
        self.status = Status()

    def state(self) -> Arrays:
        """Return the state for the next block that is not part of the problem."""
        parts = (self._engine, *(self._checks or ()))
        return {name: array for part in parts for name, array in part.state().items()}

    def restore(self, state: Arrays) -> None:
        """Restore the state."""
        for part in (self._engine, *(self._checks or ())):
            part.restore(state)

    def blocks(self, done: int = 0) -> Iterator[Block]:
        """Yield the results block by block, with the initial state in the first block of a new run.

        A block is cut before the first instant that is not finite or did not converge, and is then the last one;
        `status` gives the reason.
        """
        size, end = self._save.block, self._problem.steps + 1
        for first in range(done, end, size):
            parts = list(self._parts(first, min(first + size, end)))
            if parts:
                yield Block.concatenate(parts)
            if not self.status.ok:
                return

    def _parts(self, first: int, end: int) -> Iterator[Block]:
        """Yield the parts of a block; only saved results stay, because a large system has few steps in memory."""
        for begin in range(first, end, self._at_once):
            steps = np.arange(begin, min(begin + self._at_once, end))
            with np.errstate(over="ignore", invalid="ignore"):  # divergence is reported per block
                if isinstance(self._engine, ProbeEngine):
                    history, self.status = self._engine.advance_probes(steps)
                    block = self._probe_part(steps[: len(history.time)], history) if len(history.time) else None
                else:
                    track, self.status = self._engine.advance(steps)
                    block = self.block(steps[: len(track.ends)], track) if len(track.ends) else None
            if block is not None:
                yield block
            if not self.status.ok:
                return

    def _probe_part(self, steps: IntArray, history: ProbeTrajectory) -> Block:
        motion, saved = self._problem.drive.at(history.time), self._save.fields(steps, self._problem.steps)
        return Block(
            time=history.time, angle=motion.angle, probes=_offset(self._system.probes, history.probes, motion),
            channels=np.zeros((len(steps), 0)), field_time=history.time[saved], field_angle=motion.angle[saved],
            fields=history.fields,
        )  # fmt: skip

    def statistics(self, stats: Stats) -> Stats:
        """Return the statistics with the counts of this run."""
        stats = self._engine.statistics(stats)
        return replace(stats, imbalance=self._checks[1].share) if self._checks else stats


def _probe_series(probes: tuple[Probe, ...], series: Series, motion: CamMotion) -> Series:
    rows = _stacked_rows(probes, series.displacement.shape[1])
    return _offset(probes, Series(*(values @ rows.T for values in series)), motion)


def _stacked_rows(probes: tuple[Probe, ...], size: int) -> FloatArray:
    return np.concatenate([np.zeros((0, size)), *(probe.rows for probe in probes)])


def _offset(probes: tuple[Probe, ...], series: Series, motion: CamMotion) -> Series:
    """Return the rows times a motion, plus the prescribed offset."""
    d, v, a = map(np.array, series)
    cam, speed = motion.cam, motion.speed
    for column, offset in enumerate(o for p in probes for o in p.offset):
        if offset is not None:
            slope = cam(offset, 1)
            d[:, column] += cam(offset, 0)
            v[:, column] += slope * speed
            a[:, column] += cam(offset, 2) * speed**2 + slope * motion.rate
    return Series(d, v, a)


def prescribed_probes(system: System, prescribed: PrescribedMotion, motion: CamMotion) -> Series:
    """Return the motion of the probes of a system in a prescribed motion."""
    return _offset(system.probes, Series(*prescribed.along(_stacked_rows(system.probes, system.size), motion)), motion)


_TIME_UP = Status(Cause.TIME_LIMIT, "the run reached its time limit", CONTINUE)

_NOTHING_TO_RESUME = (
    "the run ended before its first checkpoint, so --resume cannot continue it; run it again with --overwrite"
)


def pilot(problem: Problem, method: Method) -> Series:
    """Return the motion of the first revolution with the given steps, as the reference size of errors.

    The given steps may be beyond the stability limit; an unbounded motion is no reference.
    """
    stable = method if method.stability_limit() == math.inf else newmark()
    angle = problem.drive.at(problem.times(np.arange(problem.steps + 1))).angle
    steps = max(int(np.count_nonzero(angle < angle[0] + 2.0 * np.pi)), 1)
    revolution = replace(problem, steps=min(steps, problem.steps), adaptive=None)
    return solve(revolution, stable, save=SaveAt(field_every=max(revolution.steps // _PILOT_FIELDS, 1))).fields


AT_ONCE, LEAST_AT_ONCE = 200_000, 8
"""Maximum number of unknowns, or of components of probes, times steps computed at once: larger blocks are not faster.
Minimum number of these steps."""

_PILOT_FIELDS = 200
"""Number of fields of the pilot run."""
