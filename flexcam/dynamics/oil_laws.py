"""Force laws of hydraulic lash adjusters: a column of oil, and a chamber of oil with air, leak and check valve.

Plain numbers, for Python and for the compiler, like all functions of `flexcam.dynamics.force_laws`.
"""

from __future__ import annotations

import math

from flexcam.core import FloatArray

MAX_ITERATIONS = 60
CONVERGED = 1e-7
"""Relative change of a load below which a further Newton iteration, which squares the error, changes no digit."""
_POLYTROPIC = 1.4
"""Exponent of the air in the oil, adiabatic."""


def oil_column(
    x: float, x_begin: float, state: float, step: float, stiffness: float, leak: float, refill: float
) -> tuple[float, float, float]:
    """Return the compression ``e = x - z`` of an oil column at the end of a step, and its two derivatives.

    The column leaks while compressed, ``z' = k e/c``, and is refilled through the check valve while it would be pulled,
    ``z' = k e/c0``. With x linear over the step, ``e' = x' - a e`` has the exact solution
    ``e1 = exp(-a h) e0 + (1 - exp(-a h))/(a h) (x1 - x0)`` for one rate a; a change of sign splits the step. The rule
    is L-stable and of second order.

    The derivatives are by the travel x1 - x0 and by e0.

    Parameters
    ----------
    leak, refill
        c and c0, N s/m.

    Examples
    --------
    >>> oil_column(2.0, 2.0, 1.0, 0.0, 1.0, 1.0, 1.0)
    (1.0, 1.0, 1.0)
    """
    begin, travel = x_begin - state, x - x_begin
    if step == 0.0:
        return begin + travel, 1.0, 1.0
    is_pressed = begin > 0.0 or (begin == 0.0 and travel > 0.0)
    a, b = (stiffness / leak, stiffness / refill) if is_pressed else (stiffness / refill, stiffness / leak)
    decay = -math.expm1(-a * step)
    weight = decay / (a * step)
    end = begin - decay * begin + weight * travel
    if (end > 0.0) == is_pressed or begin * travel >= 0.0:
        return end, weight, 1.0 - decay
    rate = travel / step  # the compression passes zero within the step
    remaining = step - math.log1p(-begin * a / rate) / a
    decay = math.exp(-b * remaining)
    weight = -math.expm1(-b * remaining) / b
    by_begin = decay * rate / (rate - begin * a)
    return weight * rate, (weight - decay * begin / (rate - begin * a)) / step, by_begin


def check_valve_velocity(force: float, leak: float, cracking: float, refill: float, loss: float) -> tuple[float, float]:
    """Return the velocity of a plunger by the oil that leaves its chamber, m/s, and its derivative by the oil's force.

    The force is the pressure of the oil above that of the supply times the area of the plunger. Oil leaks in both
    directions, ``w = f/c``. Below the cracking force F_c the ball is off its seat. Oil then enters with
    ``-f - F_c = c0 w0 + b w0^2``, with the refill c0 and the loss b.

    Examples
    --------
    >>> check_valve_velocity(-10.0, 1e9, 2.0, 4.0, 4.0)
    (-1.00000001, 0.083333334...)
    """
    velocity, slope, pull = force / leak, 1.0 / leak, -force - cracking
    if pull > 0.0:
        root = math.sqrt(refill * refill + 4.0 * loss * pull)
        velocity -= 2.0 * pull / (refill + root)
        slope += 1.0 / root
    return velocity, slope


def chamber_pressure(rest: float, weight: float, constants: FloatArray, b: int) -> float:
    """Return the pressure q of a chamber for which compression and outflow make up a travel (`rest`, m) of its plunger.

    q is the logarithm of the absolute pressure over that of the supply: the root of ``h eps(q) + weight w(q) = rest``,
    by Newton's method inside a bracket. The outflow w acts during the time `weight`, s.
    """
    area, height, modulus, air, supply = (
        constants[b], constants[b + 1], constants[b + 2], constants[b + 3], constants[b + 4],
    )  # fmt: skip
    liquid = (1.0 - air) * supply / modulus
    low, high = 0.0, 0.0
    if rest > 0.0:
        high = math.log1p(rest / (height * liquid))
    else:
        low = -_POLYTROPIC * math.log1p(-rest / (height * air))
    q = high if rest > 0.0 else low
    for _ in range(MAX_ITERATIONS):
        rise = math.expm1(q)
        velocity, slope = check_valve_velocity(
            area * supply * rise, constants[b + 5], constants[b + 6], constants[b + 7], constants[b + 8]
        )
        excess = height * (liquid * rise - air * math.expm1(-q / _POLYTROPIC)) + weight * velocity - rest
        if excess > 0.0:
            high = q
        else:
            low = q
        by_q = height * (liquid * (1.0 + rise) + air / _POLYTROPIC * math.exp(-q / _POLYTROPIC))
        new = q - excess / (by_q + weight * slope * area * supply * (1.0 + rise))
        if not low <= new <= high:
            new = 0.5 * (low + high)
        old, q = q, new
        if abs(q - old) <= CONVERGED * abs(q):
            break
    return q


def fitted_weight(rate: float) -> float:
    """Return the weight of the end of a step with which the theta method is exact for ``y' = f(t) - rate y``, f linear.

    W. Liniger and R. A. Willoughby, Efficient integration methods for stiff systems of ordinary differential equations,
    SIAM J. Numer. Anal. 7 (1970): ``1/(1 - exp(-a h)) - 1/(a h)``, from 1/2 for short steps to 1 for long ones. The
    rate is a h.
    """
    if rate < 1e-3:  # the next term of the series is rate^3/720
        return 0.5 + rate / 12.0
    return -1.0 / math.expm1(-rate) - 1.0 / rate


def oil_chamber(
    x: float, x_begin: float, state: float, step: float, constants: FloatArray, b: int
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Return the response of an oil chamber with entrained air and a check valve at the end of a step.

    The compression of the height h is ``e = x - z = h ((1 - a) (p - p0)/K + a (1 - (p0/p)^(1/n)))``: oil of constant
    modulus K and air that follows ``p V^n`` = const., n = 1.4 (M. G. Rabie, Fluid Power Engineering, 2009, p. 32, eqs.
    2.50, 2.52 and 2.53). The oil's force is ``f = A (p - p0)``, and ``z' = w(f)`` of `check_valve_velocity`. A step is
    one of the theta method with `fitted_weight`, for a penetration that is linear over the step. The force on the
    plunger is never negative: below, the plunger stays behind.

    The constants of the chamber are area A (m^2), height h (m), modulus K (Pa), air a at the supply pressure, absolute
    supply pressure p0 (Pa) and leak c (N s/m); of the check valve: cracking force (N), refill c0 (N s/m) and loss b (N
    s^2/m^2); last, the plunger's force at the supply pressure (N).

    Returns
    -------
    tuple
        Force (N), its derivative by x (N/m), stored energy (J); e1 (m) and its derivatives by the travel and by e0;
        w at the end (m/s), its derivative by e (1/s), and the oil's force (N).

    Examples
    --------
    >>> water = [1e-4, 1e-2, 2e9, 1e-9, 1e5, 1e6, 0.0, 100.0, 0.0, 20.0]
    >>> round(oil_chamber(1e-6, 1e-6, 0.0, 0.0, water, 0)[0], 2)
    40.0
    """
    area, height, modulus, air, supply = (
        constants[b], constants[b + 1], constants[b + 2], constants[b + 3], constants[b + 4],
    )  # fmt: skip
    leak, cracking, refill, loss, plunger = (
        constants[b + 5], constants[b + 6], constants[b + 7], constants[b + 8], constants[b + 9],
    )  # fmt: skip
    liquid, pull = (1.0 - air) * supply / modulus, area * supply
    minimum = math.log1p(-plunger / pull) if plunger < pull else -1e3
    begin, rest, weight, by_begin = x_begin - state, x - state, 0.0, 1.0
    if step > 0.0:
        start = max(chamber_pressure(begin, 0.0, constants, b), minimum)
        velocity, slope = check_valve_velocity(pull * math.expm1(start), leak, cracking, refill, loss)
        if begin > 0.0 or (begin == 0.0 and x > x_begin):
            rate = pull / (height * liquid) / leak
        else:
            rate = pull / (height * (liquid + air / _POLYTROPIC)) * (1.0 / leak + 1.0 / refill)
        weight = step * fitted_weight(rate * step)
        rest -= (step - weight) * velocity
        if start > minimum:
            by_q = height * (liquid * math.exp(start) + air / _POLYTROPIC * math.exp(-start / _POLYTROPIC))
            by_begin = 1.0 - (step - weight) * slope * pull * math.exp(start) / by_q
    q = max(chamber_pressure(rest, weight, constants, b), minimum)
    rise = math.expm1(q)
    velocity, slope = check_valve_velocity(pull * rise, leak, cracking, refill, loss)
    compression = height * (liquid * rise - air * math.expm1(-q / _POLYTROPIC))
    energy = 0.5 * liquid * rise * rise + air * (
        math.expm1(q * (1.0 - 1.0 / _POLYTROPIC)) / (_POLYTROPIC - 1.0) + math.expm1(-q / _POLYTROPIC)
    )
    end = rest - weight * velocity
    energy = plunger * (x - end + compression) + pull * height * energy
    if q == minimum:
        return 0.0, 0.0, energy, end, 1.0, by_begin, velocity, 0.0, pull * rise
    stiffness = (
        pull * (1.0 + rise) / (height * (liquid * (1.0 + rise) + air / _POLYTROPIC * math.exp(-q / _POLYTROPIC)))
    )
    by_travel = 1.0 / (1.0 + weight * slope * stiffness)
    return (
        plunger + pull * rise, stiffness * by_travel, energy, end, by_travel, by_begin * by_travel, velocity,
        slope * stiffness, pull * rise,
    )  # fmt: skip
