"""Stability of a case over speed: time step, parametric instability, resonance and contact loss."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from flexcam.analysis.orders import highest_order, last_revolution_orders
from flexcam.analysis.preparation import PreparedRun, prepare, prepare_without_periodic_search
from flexcam.analysis.run import member_strength
from flexcam.analysis.run_metrics import CHATTER, GROWTH, RevolutionChange, revolution_change
from flexcam.cams import Event, harmonics
from flexcam.case.case import Case
from flexcam.case.problem_builder import excitation_without_period
from flexcam.core import FloatArray
from flexcam.core.errors import InputError
from flexcam.core.units import RPM
from flexcam.dynamics import (
    Floquet,
    Method,
    ProgressCallback,
    Response,
    RunFailedError,
    Status,
    Tangents,
    basis_of,
    floquet,
    highest_frequency,
    project_system,
    reraise_interrupt,
    solve,
    solve_periodic,
    track_progress,
)
from flexcam.valvetrain import OPEN, modes_on_the_lift, opposed_contacts, separation, spring_held_contacts

MAX_DOFS = 400
"""Maximum number of degrees of freedom for a linearization about the motion; larger systems use the highest mode
without contacts."""

# instants evaluated in the last revolution: contacts open and close, and their stiffness changes
_EVALUATED_INSTANTS = 24
_RIGID_BODY_RATIO = 1e-9  # ratio to the highest squared frequency below which a mode is a rigid-body mode


@dataclass(frozen=True)
class StepAmplification:
    """Amplification of a mode by the time integration."""

    radius: float  #: maximum amplification factor of a mode per step
    frequency: float  #: frequency of that mode, Hz
    damping: float  #: its damping ratio
    moving: tuple[str, ...]  #: name of the part with the largest motion
    angle: float  #: cam angle of the maximum, rad
    critical_step: float  #: maximum step without amplification, s; infinite for an unconditionally stable method

    @property
    def is_available(self) -> bool:
        """Return whether a mode could be evaluated."""
        return bool(self.moving)


def step_amplification(ready: PreparedRun, method: Method, response: Response) -> StepAmplification:
    """Return the mode with the largest amplification by the time integration."""
    step, names = ready.problem.step, ready.problem.system.names
    if ready.problem.system.size > MAX_DOFS and not ready.problem.system.is_kinematic:
        # The highest mode without contacts limits conditionally stable methods.
        basis, system = basis_of(ready.problem), ready.problem.system
        omega, moving = highest_frequency(project_system(system, basis) if basis is not None and basis.size else system)
        radius, limit = method.spectral_radius(omega * step), method.stability_limit()
        longest = limit / omega if omega else math.inf
        return StepAmplification(radius, omega / (2.0 * math.pi), 0.0, tuple(moving), 0.0, longest)
    worst, critical = StepAmplification(0.0, 0.0, 0.0, (), 0.0, math.inf), math.inf
    limited = method.stability_limit() < math.inf
    for angle, omegas, ratios, shapes in _modes_along_motion(ready, response):
        pairs = zip(omegas.tolist(), ratios.tolist(), strict=True)
        radii = [method.spectral_radius(omega * step, max(ratio, 0.0)) for omega, ratio in pairs]
        largest = max(range(len(radii)), key=lambda i: (round(radii[i], 9), omegas[i]))
        order: list[int] = np.argsort(-np.abs(shapes[:, largest])).tolist()
        moving = tuple(names[i] for i in order[:3])
        frequency, ratio = float(omegas[largest]) / (2.0 * math.pi), float(ratios[largest])
        candidate = StepAmplification(radii[largest], frequency, ratio, moving, angle, math.inf)
        if limited:
            critical = min(critical, method.stability_limit(max(float(ratios[-1]), 0.0)) / float(omegas[-1]))
        if (round(candidate.radius, 9), candidate.frequency) > (round(worst.radius, 9), worst.frequency):
            worst = candidate
    return replace(worst, critical_step=critical)


def _modes_along_motion(
    ready: PreparedRun, response: Response
) -> Iterator[tuple[float, FloatArray, FloatArray, FloatArray]]:
    """Yield cam angle and modes (angular frequencies, damping ratios, columns) at instants of the last revolution."""
    system = ready.problem.system
    if system.is_kinematic or system.size > MAX_DOFS or not len(response.field_time):
        return
    late: list[int] = np.flatnonzero(response.field_time > response.field_time[-1] - ready.revolution).tolist()
    instants = late[:: max(len(late) // _EVALUATED_INSTANTS, 1)]
    fields = response.fields.at(np.isin(np.arange(len(response.field_time)), instants))
    motion = ready.problem.drive.at(response.field_time[instants])
    tangents = Tangents(system, motion, fields.displacement, fields.velocity)
    basis = basis_of(ready.problem)
    Q = basis.expand(np.eye(basis.size)).T if basis is not None and basis.size else np.eye(system.size)
    last = None
    for i in range(len(instants)):
        C, K = tangents.at(i)
        if last is None or not np.array_equal(K, last):
            omegas, ratios, shapes = _oscillatory_modes(*(Q.T @ A @ Q for A in (tangents.mass, C, K)))
            if len(omegas):
                yield float(response.field_angle[instants[i]]), omegas, ratios, Q @ shapes
        last = K


def _oscillatory_modes(M: FloatArray, C: FloatArray, K: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the oscillatory modes of possibly unsymmetric matrices, lowest first, without free and growing ones."""
    from scipy.linalg import eig

    values, vectors = (np.asarray(array) for array in eig(K, M))
    squares: FloatArray = np.real(values)
    valid = np.isfinite(squares) & (np.abs(np.imag(values)) <= np.abs(squares))
    valid &= squares > _RIGID_BODY_RATIO * np.max(np.abs(squares[valid]), initial=0.0)
    order = np.flatnonzero(valid)[np.argsort(squares[valid])]
    omegas, shapes = np.sqrt(squares[order]), np.real(vectors[:, order])
    modal_mass = np.einsum("ik,ik->k", shapes, M @ shapes)
    modal_damping = np.einsum("ik,ik->k", shapes, C @ shapes)
    return omegas, modal_damping / np.where(modal_mass > 0.0, 2.0 * omegas * modal_mass, np.inf), shapes


def force_harmonics(response: Response, contact: str, count: int) -> FloatArray:
    """Return the amplitudes of the harmonics of a contact force in the last revolution of a run."""
    force, resolved = response.channels.get(f"contacts.{contact}.force"), min(count, highest_order(response))
    if force is None or not resolved:
        return np.full(count, np.nan)
    amplitudes = last_revolution_orders(response, force, resolved).amplitudes[1:]
    return np.append(amplitudes, np.full(count - resolved, np.nan))


_HARMONICS = 24

MIN_HARMONIC_RATIO = 0.02
"""Acceleration relative to that of the largest harmonic below which a harmonic is ignored."""


@dataclass(frozen=True)
class Resonance:
    """Coincidence of a harmonic of a cam with a mode."""

    contact: str  #: name of the contact of the cam
    rpm: float  #: camshaft speed of the resonance, rpm
    harmonic: int  #: order of the harmonic, per camshaft revolution
    amplitude: float  #: amplitude of that harmonic in the lift, m
    #: amplitude of that harmonic in the contact force in the last revolution of the run, N; zero if the steps are too
    #: few to resolve it
    load: float
    mode: int  #: index of the mode, from 0
    frequency: float  #: frequency of the mode, Hz
    words: str  #: description of the mode
    #: the amplitude of the force relative to the maximum contact force of the revolution, zero if not known
    share: float = 0.0


def resonances(ready: PreparedRun, response: Response) -> tuple[Resonance, ...]:
    """Return the resonances of cam harmonics with the modes."""
    crossings: list[Resonance] = []
    for name, contact in ready.model.cam_contacts.items():
        modes = modes_on_the_lift(ready.model, name, ready.case.speed)
        lifts = lift_harmonics(ready.model.cams[contact.cam].event, _HARMONICS)
        loads = np.nan_to_num(force_harmonics(response, name, _HARMONICS))
        force = response.channels.get(f"contacts.{name}.force", np.zeros(0))[response.latest(ready.revolution)]
        maximum = max(float(np.abs(force).max(initial=0.0)), np.finfo(float).tiny)
        for n, amplitude in lifts.items():
            for i in modes.relevant_modes:
                frequency, words = float(modes.model_modes.modes.frequencies[i]), modes.model_modes.words(i)
                rpm, load = 60.0 * frequency / n, float(loads[n - 1])
                crossings.append(Resonance(name, rpm, n, amplitude, load, i, frequency, words, load / maximum))
    case_rpm = ready.case.speed / RPM
    return tuple(sorted(crossings, key=lambda crossing: abs(math.log(crossing.rpm / case_rpm))))


def lift_harmonics(event: Event, count: int) -> dict[int, float]:
    """Return the harmonics of a lift that are significant in its acceleration, which excites the modes."""
    sizes = np.abs(harmonics(event, count))[1:]
    accelerations = np.arange(1, count + 1) ** 2 * sizes
    significant = np.flatnonzero(accelerations >= MIN_HARMONIC_RATIO * accelerations.max())
    return {n + 1: float(sizes[n]) for n in significant.tolist()}


RESONANCE_WIDTH = 0.03
"""Relative distance of a harmonic from a mode that counts as resonance."""

MIN_FORCE_RATIO = 0.05
"""Amplitude relative to the maximum contact force from which a resonant harmonic counts; weaker ones are listed."""

_MIN_CHANGE = 0.01, CHATTER, GROWTH  # differences of two revolutions, of motion, force and stress: chatter counts
_LISTED_SPEED_RATIO = 2.0  # multiple of the case's speed up to which resonances are listed individually
_PERIODICITY_TOLERANCE = 1e-3  # allowed difference between start and end of a periodic motion, relative to the motion
_MIN_REVOLUTIONS = 10.0  # of a run that does not begin with an unstable periodic motion
_GROWTH_THRESHOLD = 1.0 + 1e-6
_MIN_STEPS = 360  # minimum steps per revolution for the Floquet analysis: coarse steps miss parametric instability
# maximum steps per revolution: every step requires a linearization, and a hundredth of a degree is sufficient
_MAX_STEPS = 36_000


@dataclass(frozen=True, eq=False)
class Stability:
    """Stability of a case at its speed."""

    rpm: float  #: camshaft speed, rpm
    discrete: StepAmplification  #: amplification by the time integration with the step of the case
    floquet: Floquet | None  #: Floquet multipliers of the periodic motion; None without a periodic motion
    why_not: str  #: reason for missing multipliers; empty otherwise
    resonances: tuple[Resonance, ...]  #: resonances in ascending distance from the case's speed
    #: width of the cam angle range with an open contact, or a tensile bilateral one, on the main lift, rad
    open_on_the_lift: float
    change: RevolutionChange | None  #: difference of the last two revolutions; None if the run ended before
    status: Status  #: status of the run used to evaluate contacts, modes and the integrator
    why_no_modes: str = ""  #: reason for missing resonances; empty otherwise

    @property
    def active_resonances(self) -> tuple[Resonance, ...]:
        """Resonances at the case's speed that change the contact force, the largest change first."""
        near = (r for r in self.resonances if abs(r.rpm / self.rpm - 1.0) <= RESONANCE_WIDTH)
        return tuple(sorted((r for r in near if r.share >= MIN_FORCE_RATIO), key=lambda r: -r.share))

    @property
    def highest_listed_rpm(self) -> float:
        """Camshaft speed up to which resonances are listed individually, rpm: twice that of the case."""
        return _LISTED_SPEED_RATIO * self.rpm

    @property
    def within(self) -> tuple[Resonance, ...]:
        """Resonances up to that speed: those that change the force at the case's speed, then the nearest first."""
        active = self.active_resonances
        others = (r for r in self.resonances if r not in active and r.rpm <= self.highest_listed_rpm)
        return (*active, *others)

    @property
    def higher_resonances(self) -> tuple[Resonance, ...]:
        """Resonances above that speed, in ascending order."""
        above = (r for r in self.resonances if r.rpm > self.highest_listed_rpm)
        return tuple(sorted(above, key=lambda r: r.rpm))

    @property
    def is_chattering(self) -> bool:
        """Return whether contacts open and close so that small differences grow: single bounces cannot be predicted."""
        return self.floquet is not None and not self.floquet.stable() and self.floquet.events > 0

    @property
    def is_scattering(self) -> bool:
        """Return whether chatter changes the motion, the force of a cam or a stress from revolution to revolution."""
        if not self.is_chattering or self.change is None:
            return self.is_chattering
        changes = self.change.motion, self.change.force, self.change.stress_change
        return any(change > minimum for change, minimum in zip(changes, _MIN_CHANGE, strict=True))

    @property
    def causes(self) -> tuple[str, ...]:
        """Threats to stability at the speed, in this order.

        ``broken off`` (the run ended early), ``numerical``, ``parametric``, ``resonance``, ``contact loss``,
        ``chatter`` that changes the motion.
        """
        causes: list[str] = [] if self.status.ok else ["broken off"]
        if self.discrete.radius > _GROWTH_THRESHOLD:
            causes.append("numerical")
        if self.floquet is not None and not self.floquet.stable() and not self.floquet.events:
            causes.append("parametric")
        if self.active_resonances:
            causes.append("resonance")
        if self.open_on_the_lift > OPEN:
            causes.append("contact loss")
        if self.is_scattering:
            causes.append("chatter")
        return tuple(causes)


def assess_stability(case: Case) -> Stability:
    """Return the stability of a case at its speed."""
    ready = prepare(case.with_stable_method())
    integrator = case.record.run.integrator
    method = ready.scheme if integrator is None else integrator.part
    steps = math.ceil(ready.revolution / ready.problem.step)
    problem = replace(ready.problem, steps=max(ready.problem.steps, 2 * steps))  # two revolutions are compared
    response = solve(problem, ready.scheme, save=ready.save)
    reraise_interrupt(response.status)
    opened = 0.0
    if len(response.time):
        last = response.latest(ready.revolution)
        contacts = [name for name in ready.model.cam_contacts if name not in opposed_contacts(ready.model)]
        opened = max((separation(ready.model, response, name, last) for name in contacts), default=0.0)
    multipliers, why_not = None, "the follower leaves its cam, and the impacts that follow need not repeat"
    change = revolution_change(ready, response, member_strength(ready, response))
    if opened <= OPEN or not spring_held_contacts(ready.model):
        multipliers, why_not = _floquet_multipliers(case)
        if multipliers and multipliers.events and not multipliers.stable() and case.record.run.start == "periodic":
            change = _change_from_equilibrium(case)
    crossings, why_no_modes = (), ""
    try:
        crossings = resonances(ready, response)
    except RunFailedError as failure:  # such as a shaft within the backlash of its gear, at the nose of its cam
        why_no_modes = f"no stable equilibrium at full lift: {failure.status.text}"
    return Stability(
        rpm=case.speed / RPM,
        discrete=step_amplification(ready, method, response),
        floquet=multipliers,
        why_not=why_not,
        resonances=crossings,
        open_on_the_lift=opened,
        change=change,
        status=response.status,
        why_no_modes=why_no_modes,
    )


def _change_from_equilibrium(case: Case) -> RevolutionChange | None:
    """Return the difference of the last two revolutions of a run that does not begin with an unstable periodic motion.

    A run that begins with it stays on it until rounding errors have grown. None if the run fails.
    """
    revolutions = max(case.record.run.revolutions, _MIN_REVOLUTIONS)
    try:
        ready = prepare(case.with_run({"start": "equilibrium", "revolutions": revolutions}).with_stable_method())
        response = solve(ready.problem, ready.scheme, save=ready.save)
    except RunFailedError:
        return None
    reraise_interrupt(response.status)
    return revolution_change(ready, response, member_strength(ready, response))


def _floquet_multipliers(case: Case) -> tuple[Floquet | None, str]:
    for key, excitation in excitation_without_period(case).items():
        return None, f"the excitation does not repeat with the camshaft: {excitation} ({key})"
    ready = prepare_without_periodic_search(case.with_newmark())
    # The steps of the case, if an integer number of them fits into a revolution and is within the limits.
    requested = round(ready.revolution / ready.problem.step)
    steps = min(max(requested, _MIN_STEPS), _MAX_STEPS)
    adaptive = ready.problem.adaptive if steps == requested else None
    cycle = replace(ready.problem, step=ready.revolution / steps, steps=steps, adaptive=adaptive)
    try:
        state = solve_periodic(cycle, ready.scheme, tolerance=1e-7)
        if (residual := state.periodicity or 0.0) > _PERIODICITY_TOLERANCE:
            change = f"differs from that at its start by {100.0 * residual:.2g} % of the amplitude"
            return None, f"no periodic motion was found: the state after one revolution {change}"
        return floquet(replace(cycle, start=state)), ""
    except InputError as refusal:
        return None, refusal.faults[0].why
    except RunFailedError as failure:
        reraise_interrupt(failure.status)
        return None, failure.status.text


def stability_over_speeds(
    case: Case, speeds: Iterable[float], *, advance: ProgressCallback | None = None
) -> list[Stability]:
    """Return the stability of a case at several speeds."""
    return [assess_stability(case.at_speed(speed)) for speed in track_progress(speeds, advance)]
