"""Laws of contact in plain numbers: one place, one depth, one rate; force and its two derivatives.

They are written so that a compiler can take them as they stand; the laws of `flexcam.train` call them one by one.
"""

from __future__ import annotations

import math

Answer = tuple[float, float, float]
"""Force, and its derivatives by depth and rate."""

_MOST_ITERATIONS = 60
_SETTLED = 1e-7
"""Change of a load, as a part of it, behind which Newton's iteration, which squares its error, changes no digit."""
_LEAST = 1e-300
"""Load times its give, m, below which there is none: the logarithm of zero is not a number."""


def stop(gap: float, rate: float, stiffness: float, damping: float, hold: float) -> Answer:
    """Return k gamma + c gamma' while pressed, never pulling; the damping takes hold over a depth.

    Parameters
    ----------
    gap, rate
        m and m/s.
    stiffness, damping
        N/m and N s/m.
    hold
        Depth at which the damping is whole, m.

    Returns
    -------
    tuple
        N, N/m and N s/m.

    Examples
    --------
    >>> stop(1.0, 0.0, 2.0, 0.0, 1e-5)
    (2.0, 2.0, 0.0)
    """
    if gap <= 0.0:
        return 0.0, 0.0, 0.0
    part = min(gap / hold, 1.0)
    force = stiffness * gap + damping * part * rate
    if force <= 0.0:
        return 0.0, 0.0, 0.0
    by_gap = stiffness + damping * rate / hold if part < 1.0 else stiffness
    return force, by_gap, damping * part


def hunt_crossley(gap: float, rate: float, stiffness: float, dissipation: float) -> Answer:
    """Return k gamma (1 + chi gamma') while pressed, never pulling.

    Parameters
    ----------
    gap, rate
        m and m/s.
    stiffness, dissipation
        N/m and s/m.

    Returns
    -------
    tuple
        N, N/m and N s/m.

    Examples
    --------
    >>> hunt_crossley(1.0, 1.0, 2.0, 0.5)
    (3.0, 3.0, 1.0)
    """
    factor = 1.0 + dissipation * rate
    if gap <= 0.0 or factor <= 0.0:
        return 0.0, 0.0, 0.0
    return stiffness * gap * factor, stiffness * factor, stiffness * gap * dissipation


def line_load(approach: float, most: float, give: float, rest: float, depth: float) -> tuple[float, float]:
    """Return the load per length of a line contact and its slope: ``approach = q (2 ln(depth/q) - rest)``.

    Newton's iteration on q, the load times `give`; straight on from the largest load at which the law holds.

    Parameters
    ----------
    approach
        m, above zero.
    most
        Load per length from which the law is straight, N/m.
    give
        q per load, 1/Pa.
    rest
        What the logarithm is lessened by.
    depth
        Of the body, m.

    Returns
    -------
    tuple
        N/m and N/m^2.

    Examples
    --------
    >>> load, slope = line_load(1e-6, 1e9, 1e-12, 1.4, 0.02)
    >>> abs(1e-12 * load * (2.0 * math.log(0.02 / (1e-12 * load)) - 1.4) - 1e-6) < 1e-18
    True
    """
    q = give * most
    terms = 2.0 * math.log(depth / q) - rest
    end, slope = q * terms, give * (terms - 2.0)
    if approach >= end:
        return most + (approach - end) / slope, 1.0 / slope
    q = max(q * approach / end, _LEAST)
    for _ in range(_MOST_ITERATIONS):
        terms = 2.0 * math.log(depth / q) - rest
        old, q = q, q + (approach - q * terms) / (terms - 2.0)
        q = q if q > 0.0 else 0.5 * old
        if abs(q - old) <= _SETTLED * q:
            break
    return q / give, 1.0 / (give * (2.0 * math.log(depth / q) - rest - 2.0))


def dissipating(force: float, slope: float, rate: float, cosine: float, dissipation: float) -> Answer:
    """Return a force along a normal and its slope, with dissipation, along the lift.

    Parameters
    ----------
    force, slope
        Along the normal without dissipation, N and N/m.
    rate
        Along the lift, m/s.
    cosine
        Of the angle between both.
    dissipation
        chi of Hunt and Crossley, s/m.

    Returns
    -------
    tuple
        N, N/m and N s/m.

    Examples
    --------
    >>> dissipating(10.0, 5.0, 1.0, 1.0, 0.1)
    (11.0, 5.5, 1.0)
    """
    factor = 1.0 + dissipation * rate * cosine
    if factor <= 0.0:
        return 0.0, 0.0, 0.0
    return force * factor * cosine, slope * factor * cosine**2, force * dissipation * cosine**2


def oil(
    gap: float, begun: float, half: float, stiffness: float, leak: float, refill: float
) -> tuple[float, float, float]:
    """Return how far an oil column is pressed at a step's end, its leak-down, and how the first follows the gap.

    The leak-down z' = k (gamma - z)/c advances by the trapezoidal rule: ``z = begun + half z'``.

    Parameters
    ----------
    gap
        m.
    begun
        Leak-down at the step's beginning, and half a step of its rate there, m.
    half
        Half a step, s.
    stiffness
        N/m.
    leak, refill
        Force per velocity while pressed and while the check valve is open, N s/m.

    Returns
    -------
    tuple
        m, m and 1.

    Examples
    --------
    >>> oil(2.0, 1.0, 0.0, 1.0, 1.0, 1.0)
    (1.0, 1.0, 1.0)
    """
    flow = stiffness / (leak if gap > begun else refill)
    share = 1.0 / (1.0 + half * flow)
    pressed = (gap - begun) * share
    return pressed, gap - pressed, share


def turning(path: float, arm: float, driven: float, start: float) -> tuple[float, float, float, float]:
    """Return what the end of a turning arm does beyond its linear motion, and how its motion follows the path.

    The motion is ``arm (sin(start + path/driven) - sin(start))``; what is beyond its tangent is not found by a
    difference, which would leave the rounding of the motion times a stiff joint.

    Parameters
    ----------
    path
        Of the driven end, m.
    arm, driven
        Lengths of the arm and of the driven one, m.
    start
        Angle of the arm at no path, rad.

    Returns
    -------
    tuple
        Motion beyond the linear one, m; change of its derivative since the start, that derivative, 1; and the second
        one, 1/m.

    Examples
    --------
    >>> turning(0.0, 2.0, 1.0, 0.0)[2]
    2.0
    """
    turn, share = path / driven, arm / driven
    square, half = turn * turn, math.sin(0.5 * turn)
    lag = math.sin(turn) - turn
    if square < 0.25:  # the series of the sine, to rounding
        series = 1.0 - square / 110.0 * (1.0 - square / 156.0)
        lag = -turn * square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0 * series)))
    beyond = arm * (math.cos(start) * lag - 2.0 * math.sin(start) * half * half)
    more = -2.0 * share * math.sin(start + 0.5 * turn) * half
    return beyond, more, share * math.cos(start + turn), -share / driven * math.sin(start + turn)


def sliding(rate: float, speed: float) -> tuple[float, float]:
    """Return how far Coulomb's friction has turned over, tanh(v/v0), and its derivative.

    The derivative is sech^2 by one exponential: 1 - tanh^2 would lose all its digits where the tangent is flat.

    Parameters
    ----------
    rate
        v, m/s.
    speed
        v0, m/s.

    Returns
    -------
    tuple
        Dimensionless from -1 to 1, and 1/(m/s).

    Examples
    --------
    >>> sliding(0.0, 2.0)
    (0.0, 0.5)
    """
    decay = math.exp(-2.0 * abs(rate) / speed)
    return math.tanh(rate / speed), 4.0 * decay / (1.0 + decay) ** 2 / speed
