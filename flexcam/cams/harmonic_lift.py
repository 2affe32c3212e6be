"""Lifts with few harmonics: harmonics of a lift, fit to a lift by constrained least squares, and polydyne cams.

A polydyne cam gives a prescribed motion of an elastic train at one speed: each harmonic of that motion is divided by
the train's frequency response. Reference: D. A. Stoddart, Polydyne Cam Design, Machine Design 25 (1953), for one mass,
where it gives s = y + (w/w0)^2 y''; here for any linear train.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexcam.cams.lift_event import Event, unique_angles
from flexcam.core import ComplexArray, FloatArray
from flexcam.core.errors import InputError, finite_array, positive, refuse
from flexcam.core.units import RPM

_AT_ONCE = 64  # number of harmonics evaluated together: ten thousand would need tens of GB


@dataclass(frozen=True)
class HarmonicLift(Event):
    """Lift as a mean and a few harmonics of the cam angle, which bounds the excitation spectrum.

    C. Li, Cam motion simulation and optimization (2014), eq. 5.
    """

    mean: float  #: m
    #: `cosine`, `sine`: amplitudes a_n and b_n of cos(n angle) and sin(n angle), m, n from 1, as many of both
    cosine: tuple[float, ...]
    sine: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.cosine) != len(self.sine) or not self.cosine:
            given = f"{len(self.cosine)} and {len(self.sine)} values"
            raise refuse("cosine, sine", given, "as many of both, one or more")
        if not np.isfinite([self.mean, *self.cosine, *self.sine]).all():
            raise refuse("mean, cosine, sine", "numbers that are not finite", "finite numbers")

    @classmethod
    def of(cls, amplitudes: ComplexArray) -> HarmonicLift:
        """Return the lift Re sum c_n exp(i n angle) of complex amplitudes c_n, n from 0, m."""
        cosine, sine = amplitudes[1:].real.tolist(), (-amplitudes[1:].imag).tolist()
        return cls(float(amplitudes[0].real), tuple(cosine), tuple(sine))

    def with_delay(self, angle: float) -> HarmonicLift:
        """Return the same lift later by a cam angle, rad."""
        n, amplitude = self._amplitudes
        return HarmonicLift.of(np.append(self.mean, amplitude * np.exp(-1j * angle * n)))

    @cached_property
    def _amplitudes(self) -> tuple[FloatArray, ComplexArray]:
        """Orders and complex amplitudes: lift = mean + Re sum c_n exp(i n angle)."""
        n = np.linspace(1.0, len(self.cosine), len(self.cosine))
        return n, np.array(self.cosine) - 1j * np.array(self.sine)

    def __call__(self, angle: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) by the cam angle (rad), m/rad^order, shape as `angle`."""
        angle = np.asarray(angle, dtype=float)
        n, amplitude = self._amplitudes
        value = np.exp(1j * angle[..., None] * n) @ ((1j * n) ** order * amplitude)
        return np.asarray(value.real + (self.mean if order == 0 else 0.0), dtype=float)


def harmonics(event: Event, count: int, order: int = 0) -> ComplexArray:
    """Return the harmonics of an event's lift or of its derivative."""
    points, weights = np.polynomial.legendre.leggauss(8)
    even = np.linspace(0.0, math.tau, max(361, 2 * count + 1))
    edges = np.concatenate([unique_angles(np.concatenate([even[:-1], event.joints])), [math.tau]])
    half = 0.5 * np.diff(edges)
    angle = (edges[:-1] + half)[:, None] + half[:, None] * points
    values = (half[:, None] * weights * event(angle, order)).ravel()
    blocks = np.array_split(np.arange(count + 1), count // _AT_ONCE + 1)
    sums = np.concatenate([np.exp(-1j * np.outer(n, angle.ravel())) @ values for n in blocks])
    amplitude = np.asarray(sums / math.pi, dtype=np.complex128)
    amplitude[0] *= 0.5
    return amplitude


def harmonic_rows(angle: FloatArray, count: int) -> FloatArray:
    """Return 1, the cosines and the sines of the multiples of angles up to a count, shape (n, 2 count + 1)."""
    angles = np.outer(angle, np.arange(1, count + 1))
    return np.hstack([np.ones((len(angle), 1)), np.cos(angles), np.sin(angles)])


def _amplitudes(x: FloatArray) -> ComplexArray:
    """Return the complex amplitudes, from order 0, of coefficients of `harmonic_rows`."""
    count = len(x) // 2
    return np.append(x[:1].astype(np.complex128), x[1 : count + 1] - 1j * x[count + 1 :])


@dataclass(frozen=True, eq=False)
class OrderSpectrum:
    """Order spectrum of a time history."""

    #: complex amplitudes c_0 to c_count, shape (count + 1,): value = Re sum c_n exp(i n angle)
    coefficients: ComplexArray
    #: difference of the values at both ends, in their own unit; it leaks into every order by about gap/(pi n)
    gap: float

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes from order 0 (the size of the mean), shape (count + 1,)."""
        return np.abs(self.coefficients)


def order_spectrum(angle: ArrayLike, values: ArrayLike, count: int) -> OrderSpectrum:
    """Return the order spectrum of a history over one revolution.

    No window is applied because a revolution is the period. The orders are those of the least-squares trigonometric
    polynomial, weighted by the angle of each sample. They are exact for a polynomial of degree `count` at any samples,
    and equal the discrete Fourier transform for equally spaced ones.
    """
    angles = finite_array("angle", angle, (None,))
    history = finite_array("values", values, (len(angles),))
    if count < 1:
        raise refuse("count", count, "a whole number, at least 1")
    if len(angles) < 2 * count + 2:
        why = "each order needs two instants"
        raise refuse("angle", f"{len(angles)} instants", f"{2 * count + 2} or more for {count} orders", why)
    steps, span = np.diff(angles), float(angles[-1] - angles[0])
    if (steps <= 0.0).any() or abs(span - math.tau) > 1.5 * float(steps.max()):
        raise refuse("angle", f"{math.degrees(span):.6g} deg", "rising angles over one revolution, 360 deg")
    weights = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    waves = harmonic_rows(angles, count)
    weighted = waves * weights[:, None]
    coefficients = np.asarray(np.linalg.solve(weighted.T @ waves, weighted.T @ history), dtype=float)
    return OrderSpectrum(_amplitudes(coefficients), abs(float(history[-1] - history[0])))


PRECISE = 1e-10  # tolerance of linear programs
_FEASIBLE = 1e-10  # residual of the dual problem below which the inequalities are contradictory


def constrained_least_squares(E: FloatArray, f: FloatArray, G: FloatArray, h: FloatArray) -> FloatArray | None:
    """Return the x that minimizes the norm of E x - f subject to G x >= h.

    The problem is reduced to a least-distance problem, and that to non-negative least squares: C. L. Lawson and R. J.
    Hanson, Solving Least Squares Problems (1974), ch. 23.
    """
    from scipy.optimize import nnls

    Q, R = np.linalg.qr(E)
    x0 = np.asarray(np.linalg.solve(R, Q.T @ f), dtype=float)
    if not len(G) or bool((G @ x0 >= h).all()):
        return x0
    # y = R (x - x0): minimum norm of y with (G R^-1) y >= h - G x0.
    C = np.linalg.solve(R.T, G.T).T
    d = h - G @ x0
    size = max(float(np.abs(d).max()), np.finfo(float).tiny)
    d = d / size
    A = np.vstack([C.T, d])
    right = np.append(np.zeros(len(R)), 1.0)
    u = nnls(A, right, maxiter=30 * A.shape[1])[0]
    r = np.asarray(A @ u - right, dtype=float)
    if float(np.linalg.norm(r)) < _FEASIBLE or r[-1] >= 0.0:
        return None
    return x0 + np.asarray(np.linalg.solve(R, -r[:-1] / r[-1] * size), dtype=float)


_MAX_FITTED = 200
_POINTS_PER_HARMONIC, _MIN_POINTS = 24, 720


@dataclass(frozen=True, eq=False)
class HarmonicFit:
    """Finite-harmonic lift and its deviation from the target lift."""

    event: HarmonicLift
    #: `strict_deviation`, `deviation`: maximum deviation from the target lift on the strict sections and overall, m
    strict_deviation: float
    deviation: float
    rms_deviation: float  #: over the working sections, m


def harmonic_fit(
    wanted: Event, count: int, *, strict: Sequence[tuple[float, float]] | None = None, tolerance: float,
    bound: float | None = None,
) -> HarmonicFit:  # fmt: skip
    """Return the lift with a given number of harmonics that has the minimum squared distance from a target lift.

    C. Li, Cam motion simulation and optimization (2014), eqs. 5-6, with its dwells as constraints instead of weights.
    """
    positive("tolerance", tolerance, "m")
    if not 1 <= count <= _MAX_FITTED:
        raise refuse("count", count, f"a whole number from 1 to {_MAX_FITTED}")
    points = max(_MIN_POINTS, _POINTS_PER_HARMONIC * count)
    ends = [end for section in strict or () for end in section] if strict is not None else list(wanted.joints)
    even = np.linspace(0.0, math.tau, points, endpoint=False)
    angle = np.unique(np.concatenate([even, np.mod(np.array(ends, dtype=float), math.tau)]))
    target = wanted(angle)
    if strict is None:  # the dwells
        inside = np.abs(wanted(angle, 1)) + np.abs(wanted(angle, 2)) < 1e-9 * wanted.height
    else:
        inside = np.zeros(len(angle), dtype=np.bool_)
        for start, end in strict:
            inside |= np.mod(angle - start, math.tau) <= end - start
    rows = harmonic_rows(angle, count)
    # Only the equally spaced angles measure the deviation; section ends between them are constraints.
    measured, lift = harmonic_rows(even, count), wanted(even)

    def solve(tolerance: float, bound: float | None) -> FloatArray | None:
        limit = np.where(inside, tolerance, math.inf if bound is None else bound)
        bounded = np.isfinite(limit)
        G = np.vstack([rows[bounded], -rows[bounded]])
        h = np.concatenate([(target - limit)[bounded], (-target - limit)[bounded]])
        return constrained_least_squares(measured, lift, G, h)

    x = solve(tolerance, None if bound is None else positive("bound", bound, "m"))
    if x is None:
        raise _fit_error(rows, target, inside, tolerance, bound, lambda inner, outer: solve(inner, outer) is not None)
    event = HarmonicLift.of(_amplitudes(x))
    deviations = np.abs(rows @ x - target)
    rms = 0.0 if inside.all() else float(np.sqrt(np.mean(deviations[~inside] ** 2)))
    return HarmonicFit(event, float(deviations[inside].max(initial=0.0)), float(deviations.max()), rms)


def harmonics_below(frequency: float, speed: float) -> int:
    """Return the number of harmonics of a cam below a natural frequency: n < w0/w."""
    return max(0, math.ceil(positive("frequency", frequency, "rad/s") / positive("speed", speed, "rad/s")) - 1)


def _fit_error(
    rows: FloatArray, target: FloatArray, inside: NDArray[np.bool_], tolerance: float, bound: float | None,
    attainable: Callable[[float, float | None], bool],
) -> InputError:  # fmt: skip
    """Return the error of a tolerance or bound that so few harmonics cannot meet, with values that they can meet."""
    dwells, outside, empty = (rows[inside], target[inside]), (rows[~inside], target[~inside]), (rows[:0], target[:0])
    widest = float(np.ptp(target))  # a wider limit allows any lift

    def find_tolerance(outer: float | None) -> float | None:
        constraint, limit = (empty, tolerance) if outer is None else (outside, outer)
        minimum = _minimize_deviation(*dwells, *constraint, limit, widest)
        return _round_up(minimum, tolerance, lambda inner: attainable(inner, outer))

    def find_bound(inner: float, given: float) -> float | None:
        minimum = _minimize_deviation(*outside, *dwells, inner, widest)
        return _round_up(minimum, given, lambda outer: attainable(inner, outer))

    inner, outer, conjunction, count = find_tolerance(bound), None, " or ", (rows.shape[1] - 1) // 2
    given = f"{_micrometres(tolerance)} in the dwells"
    if bound is not None:
        outer = find_bound(tolerance, bound)
        if inner is None and outer is None:  # neither alone helps
            inner, conjunction = find_tolerance(None), " and "
            outer = None if inner is None else find_bound(inner, bound)
        given += f" and {_micrometres(bound)} elsewhere"
    given += f", too small for {count} harmonic{'s' * (count != 1)}"
    wider = {"tolerance": inner, "bound": outer}
    texts = [f"a {name} (--{name}) of at least {_micrometres(value)}" for name, value in wider.items() if value]
    where = "bound" if outer and conjunction == " or " else "tolerance"
    remedy = "more harmonics (--count) allow smaller values"
    return refuse(where, given, conjunction.join(texts) or "attainable values", "", remedy)


_MAX_ROUNDED = 20  # number of tried values: just above the minimum the least squares may fail


def _round_up(minimum: float | None, given: float, attainable: Callable[[float], bool]) -> float | None:
    """Return an attainable value, m, above a minimum and the given value, rounded up to three digits in micrometres."""
    if minimum is None:
        return None
    exponent = math.floor(math.log10(1e6 * max(minimum, given))) - 2
    mantissa = math.ceil(1e6 * max(minimum, given) / 10.0**exponent)
    values = (float(f"{number}e{exponent - 6}") for number in range(mantissa, mantissa + _MAX_ROUNDED))
    return next((value for value in values if value > given and attainable(value)), None)


def _micrometres(value: float) -> str:
    return f"{1e6 * value:.6g} um"


def _minimize_deviation(
    rows: FloatArray, target: FloatArray, bounded: FloatArray, goal: FloatArray, tolerance: float, widest: float
) -> float | None:
    """Return the smallest maximum deviation, up to `widest`, with others within a tolerance: a linear program."""
    from scipy.optimize import linprog

    ones, zeros = np.ones((len(rows), 1)), np.zeros((len(bounded), 1))
    A = np.block([[rows, -ones], [-rows, -ones], [bounded, zeros], [-bounded, zeros]])
    b = np.concatenate([target, -target, goal + tolerance, tolerance - goal]) / widest
    if not len(A):
        return None
    cost = np.append(np.zeros(rows.shape[1]), 1.0)
    box = [*[(None, None)] * rows.shape[1], (0.0, 1.0)]
    result = linprog(cost, A, b, bounds=box, method="highs", options={
        "primal_feasibility_tolerance": PRECISE, "dual_feasibility_tolerance": PRECISE,
    })  # fmt: skip
    return None if result.x is None else widest * float(np.asarray(result.x, dtype=float)[-1])


Transfer = Callable[[FloatArray], ComplexArray]
"""Frequency response: motion of the follower's end per lift of the cam, by circular frequency (rad/s, zero included).
"""

_MIN_RESPONSE = 1e-9  # frequency response, relative to the static one, below which a harmonic cannot be prescribed
_ROUNDING = 1e-12
_MAX_HARMONICS = 1000
_GRID = np.linspace(0.0, 2.0 * math.pi, 1441)


@dataclass(frozen=True)
class SingleMass:
    """Mass on a spring driven by the cam's lift: y'' + 2 D w0 (y' - s') + w0^2 (y - s) = 0."""

    frequency: float  #: w0, rad/s
    damping: float = 0.0  #: D, part of the critical damping

    def __post_init__(self) -> None:
        positive("frequency", self.frequency, "rad/s")
        positive("damping", self.damping, "", zero=True)

    def __call__(self, omega: FloatArray) -> ComplexArray:
        """Return the frequency response."""
        r = omega / self.frequency
        drive = 1.0 + 2j * self.damping * r
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = drive / (drive - r**2)
        return np.where(np.abs(drive - r**2) <= _ROUNDING * (1.0 + r**2), np.inf, gain)


@dataclass(frozen=True, eq=False)
class Polydyne:
    """A polydyne cam."""

    event: HarmonicLift  #: lift of the cam
    target: HarmonicLift  #: target motion, as harmonics
    left_out: float  #: largest deviation of the target motion from its harmonics, m


def polydyne(target: Event, transfer: Transfer, speed: float, *, count: int = 60) -> Polydyne:
    """Return the cam that gives the end of a train a target motion at a design speed."""
    positive("speed", speed, "rad/s")
    if not 1 <= count <= _MAX_HARMONICS:
        raise refuse("count", count, f"a whole number from 1 to {_MAX_HARMONICS}")
    amplitude = harmonics(target, count)
    gain = transfer(speed * np.arange(count + 1.0))
    silent = ~np.isfinite(gain[:1]) if not np.isfinite(gain[0]) else np.abs(gain) < _MIN_RESPONSE * abs(gain[0])
    if silent.any():
        given = f"a train that does not respond to harmonic {int(np.argmax(silent))} at {speed / RPM:g} rpm"
        raise refuse("speed", given, "a response to every harmonic", "", "choose another speed, or add damping")
    goal = HarmonicLift.of(amplitude)
    # A harmonic in resonance must be absent from the cam.
    resonant = ~np.isfinite(gain)
    cam = np.where(resonant, 0.0, amplitude / np.where(resonant, 1.0, gain))
    return Polydyne(HarmonicLift.of(cam), goal, float(np.abs(goal(_GRID) - target(_GRID)).max()))


def off_design_deviation(design: Polydyne, transfer: Transfer, speeds: Sequence[float]) -> FloatArray:
    """Return the largest deviation from the target motion at other speeds."""
    count, target = len(design.event.cosine), design.target(_GRID)

    def deviation(speed: float) -> float:
        amplitude, gain = harmonics(design.event, count), transfer(speed * np.arange(count + 1.0))
        present = np.abs(amplitude) > _ROUNDING * np.abs(amplitude).max()
        if (present & ~np.isfinite(gain)).any():  # in resonance
            return math.inf
        motion = HarmonicLift.of(amplitude * np.where(np.isfinite(gain), gain, 0.0))
        return float(np.abs(motion(_GRID) - target).max())

    return np.array([deviation(positive("speed", float(speed), "rad/s")) for speed in speeds])
