"""Force laws of contacts, joints and springs, each defined once as a function of plain numbers.

`evaluate_laws` evaluates all laws of a system; static equilibrium, both time-stepping engines, the energy balance,
linearization and the rigid model call it. The functions use only numbers and array elements, so that they run as Python
and as compiled code.

Parameters that several laws share: the penetration `x` of two bodies, m, positive while they touch, and its rate `v`,
m/s; `stiffness`, N/m, and `damping`, N s/m. A law with an internal state also takes the penetration `x_begin` at the
beginning of the step, m, the `state` there, and the length of the `step`, s, zero for an instant. Laws with many
constants or several scalars take the `constants` of all laws and where those of this law begin, `b`; its first scalar
`i`; and `local` and `tangent` as in `evaluate_laws`.

To add a law: write its function here, give it a number and a branch in `evaluate_laws`, and describe its constants in
`LAWS`.
"""
# Elements of arrays are numbers to the compiler and arrays to the type checker.
# pyright: reportArgumentType=false, reportAssignmentType=false

from __future__ import annotations

import math
from dataclasses import dataclass

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.oil_laws import (
    CONVERGED,
    MAX_ITERATIONS,
    chamber_pressure,
    check_valve_velocity,
    fitted_weight,
    oil_chamber,
    oil_column,
)

LawResponse = tuple[float, float, float, float]
"""Force (N), its derivatives by penetration (N/m) and by rate (N s/m), and the stored energy (J)."""

(
    BILATERAL, STOP, HUNT_CROSSLEY, LINE_CONTACT, OIL_COLUMN, OIL_CHAMBER, PULSATING, LEVER, ARCH, SHORT_BEARING,
    SLIDING_FRICTION, TABLE, CUSTOM,
) = range(13)  # fmt: skip
"""Numbers of the laws."""

(
    TRIAL, PENETRATION, RATE, ANSWER, FREE_PENETRATION, FREE_RATE, OWN, ENERGY, BASE, CHANGE, SENSED, STALE, DEPTH,
    MOVED, MOVING,
) = range(15)  # fmt: skip
"""Rows of the local scalars: trial force, sensed penetration and rate under it, force of the law, sensed values
without the forces, square root of the scalar's own compliance, stored energy, four rows of the iteration. Then follow
the penetration of the law with the lift of `CamLift`, of its first scalar, and changes of penetration and rate that
are not yet added, in the columns of the compliance.
"""
LOCAL_ROWS = 15

STATE, BEGIN, NEW_STATE, STATE_RATE, FLOW, ENERGY_BY_STATE, BY_TRAVEL, BY_BEGIN, SPAN = range(9)
"""Rows of the internal states: at the beginning of a step, the penetration there, at its end; the rate at the end, the
rate per unit of (penetration - state), and the derivative of the stored energy by the state. Two rows are derivatives
of (penetration - state) at the end: by the travel of the penetration and by its value at the beginning. The last row is
the length of the step, s, zero for an instant."""
STATE_ROWS = 9

KIND, FIRST, SCALARS, CONSTANTS, FUNCTIONS, LAW_STATE, FRICTION, LIFT = range(8)
"""Columns of the table of laws.

They are the number of the law, its first scalar and number of scalars, first constant, first function of the cam angle,
internal state (-1 for none), first constant of friction, and first constant of the lift (-1 for none).
"""

_SMALLEST = 1e-300
"""Smallest argument of the logarithm."""
THINNEST = 0.99
"""Eccentricity of a journal up to which its film is that of the theory."""
_STEEP = 4.0 * THINNEST / (1.0 - THINNEST**2)
"""Relative growth of the film's force per eccentricity beyond it, that of the steady radial force there."""

TURN = 2.0 * math.pi

ARCH_SCALARS = 7
"""Scalars of a shallow arch: the elongation, then chord slope and both end rotations in two planes."""


def bilateral(x: float, v: float, stiffness: float, damping: float) -> LawResponse:
    """Return the force ``k x + c v`` of a spring and a damper.

    Examples
    --------
    >>> bilateral(-3.0, 0.0, 2.0, 0.0)
    (-6.0, 2.0, 0.0, 9.0)
    """
    return stiffness * x + damping * v, stiffness, damping, 0.5 * stiffness * x * x


def stop(x: float, v: float, stiffness: float, damping: float, depth: float) -> LawResponse:
    """Return the force of an elastic stop: ``k x + c min(x/d, 1) v`` while pressed, never negative.

    The damping grows over the depth d, as in the impact functions of multibody codes: a damper that acts at once would
    make the force jump at touchdown.

    Parameters
    ----------
    depth
        Penetration at which the damping is complete, m.

    Examples
    --------
    >>> stop(1.0, 0.0, 2.0, 0.0, 1e-5)
    (2.0, 2.0, 0.0, 1.0)
    """
    if x <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    fraction, energy = min(x / depth, 1.0), 0.5 * stiffness * x * x
    force = stiffness * x + damping * fraction * v
    if force <= 0.0:
        return 0.0, 0.0, 0.0, energy
    return force, stiffness + (damping * v / depth if fraction < 1.0 else 0.0), damping * fraction, energy


ON_RAMP_END = 1e-6
"""Relative distance from the end of the ramp of a damping that is rounding."""


def passes_ramp(old: float, new: float, depth: float) -> bool:
    """Return whether a penetration passes the depth at which the damping of a stop is complete, up or down."""
    tolerance = ON_RAMP_END * depth
    return (old < depth - tolerance and new > depth) or (old > depth + tolerance and new < depth)


def hunt_crossley(x: float, v: float, stiffness: float, dissipation: float) -> LawResponse:
    """Return the force ``k x (1 + chi v)`` of Hunt and Crossley while pressed, never negative.

    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech.
    42 (1975): the damping grows with the penetration, so that neither touchdown nor separation begins with a jump.

    Parameters
    ----------
    dissipation
        chi, s/m.

    Examples
    --------
    >>> hunt_crossley(1.0, 1.0, 2.0, 0.5)
    (3.0, 3.0, 1.0, 1.0)
    """
    if x <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    factor, energy = 1.0 + dissipation * v, 0.5 * stiffness * x * x
    if factor <= 0.0:
        return 0.0, 0.0, 0.0, energy
    return stiffness * x * factor, stiffness * factor, stiffness * x * dissipation, energy


def line_load(approach: float, limit: float, give: float, rest: float, depth: float) -> tuple[float, float]:
    """Return load per length (N/m) and slope (N/m^2) of a line contact for an approach (m) of both bodies above zero.

    ``approach = q (2 ln(depth/q) - rest)`` with q = give load, by Newton's method on q; above the limit load (N/m),
    where the half width is comparable to the radius, the law continues along its tangent.

    Examples
    --------
    >>> load, slope = line_load(1e-6, 1e9, 1e-12, 1.4, 0.02)
    >>> abs(1e-12 * load * (2.0 * math.log(0.02 / (1e-12 * load)) - 1.4) - 1e-6) < 1e-18
    True
    """
    q = give * limit
    terms = 2.0 * math.log(depth / q) - rest
    end, slope = q * terms, give * (terms - 2.0)
    if approach >= end:
        return limit + (approach - end) / slope, 1.0 / slope
    q = max(q * approach / end, _SMALLEST)
    for _ in range(MAX_ITERATIONS):
        terms = 2.0 * math.log(depth / q) - rest
        old, q = q, q + (approach - q * terms) / (terms - 2.0)
        q = q if q > 0.0 else 0.5 * old
        if abs(q - old) <= CONVERGED * q:
            break
    return q / give, 1.0 / (give * (2.0 * math.log(depth / q) - rest - 2.0))


def line_contact(
    x: float, v: float, cosine: float, limit: float, width: float, give: float, rest: float, depth: float,
    dissipation: float,
) -> LawResponse:  # fmt: skip
    """Return the force of Hertz's line contact along a direction inclined to the contact normal.

    The penetration along the normal is ``x cos(a)``, and so is the component of the normal force along the direction.
    The stored energy is the integral of `line_load`; the dissipation is that of Hunt and Crossley.

    Parameters
    ----------
    cosine
        Of the angle a between direction and normal.
    limit
        Load per length above which the law is linear, N/m.
    width
        Length of the line, m.
    give
        ``(1 - nu^2)/(pi E)``, 1/Pa.
    rest
        Constant subtracted from the logarithm.
    depth
        Reference length of the bodies, m.
    dissipation
        chi, s/m.

    Examples
    --------
    >>> force, by_x, by_v, energy = line_contact(1e-6, 0.0, 1.0, 1e9, 0.01, 1e-12, 1.4, 0.02, 0.0)
    >>> bool(0.5 < energy / (force * 1e-6) * 2.0 < 1.1)
    True
    """
    if x <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    load, slope = line_load(x * cosine, limit, give, rest, depth)
    p = min(load, limit)
    q = give * p
    terms = 2.0 * math.log(depth / max(q, _SMALLEST)) - rest
    excess = 0.5 * (load + limit) * (load - limit) / slope if load > limit else 0.0
    energy = width * (p * q * terms - 0.5 * p * q * (terms + 1.0) + excess)
    factor = 1.0 + dissipation * v * cosine
    if factor <= 0.0:
        return 0.0, 0.0, 0.0, energy
    force, stiffness = width * load * cosine, width * slope * cosine * cosine
    return force * factor, stiffness * factor, force * cosine * dissipation, energy


def lever_motion(path: float, arm: float, driven: float, start: float) -> tuple[float, float, float, float]:
    """Return the motion of the end of a rotating arm beyond its tangent, and how it follows the path of the driven end.

    The motion is ``arm (sin(start + path/driven) - sin(start))`` of lengths in m. The part beyond the tangent is not
    computed as a difference, which would leave the rounding of the motion times a stiff joint. The others are the
    change of the derivative since the start, the derivative, and the second one (1/m).
    """
    angle, ratio = path / driven, arm / driven
    square, half = angle * angle, math.sin(0.5 * angle)
    lag = math.sin(angle) - angle
    if square < 0.25:  # the series of the sine, to rounding
        series = 1.0 - square / 110.0 * (1.0 - square / 156.0)
        lag = -angle * square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0 * series)))
    excess = arm * (math.cos(start) * lag - 2.0 * math.sin(start) * half * half)
    change = -2.0 * ratio * math.sin(start + 0.5 * angle) * half
    return excess, change, ratio * math.cos(start + angle), -ratio / driven * math.sin(start + angle)


def coulomb(rate: float, speed: float) -> tuple[float, float]:
    """Return the direction of Coulomb friction, ``tanh(v/v0)`` of the sliding velocity, and its derivative, s/m.

    The derivative is ``sech^2`` by one exponential: ``1 - tanh^2`` would lose all digits where the tangent is flat.
    """
    decay = math.exp(-2.0 * abs(rate) / speed)
    return math.tanh(rate / speed), 4.0 * decay / (1.0 + decay) ** 2 / speed


def sliding_friction(
    v: float, force: float, breakaway: float, stribeck: float, damping: float, reversal: float
) -> LawResponse:
    """Return the friction of a lubricated slide or pivot, ``(F + (F0 - F) exp(-(v/vs)^2)) tanh(v/v0) + c v``.

    Coulomb friction with Stribeck's decrease and a viscous part: S. Andersson, A. Soderberg and S. Bjorklund, Friction
    models for sliding dry, boundary and mixed lubricated contacts, Tribology International 40 (2007), sec. 2. At rest
    the force is zero: a slide at rest creeps below the velocity v0 instead of sticking.

    Parameters
    ----------
    force, breakaway
        F and F0, N.
    stribeck
        vs, m/s.
    reversal
        v0, m/s.

    Examples
    --------
    >>> sliding_friction(1.0, 5.0, 5.0, 0.1, 2.0, 1e-3)
    (7.0, 0.0, 2.0, 0.0)
    """
    direction, slope = coulomb(v, reversal)
    excess = (breakaway - force) * math.exp(-((v / stribeck) ** 2))
    by_rate = (force + excess) * slope - 2.0 * v / stribeck**2 * excess * direction + damping
    return (force + excess) * direction + damping * v, 0.0, by_rate, 0.0


def lever(constants: FloatArray, b: int, i: int, local: FloatArray, tangent: FloatArray) -> None:
    """Write the response of an elastic lever end with path p and motion x beyond its linear spring.

    The force of the true penetration ``y(p) - x`` less that of the linear one acts on x, and by virtual work times
    ``y'(p)`` on the lever. The constants are stiffness (N/m), damping (N s/m), arm and driven arm (m) and angle (rad);
    the scalars the path p (m) and the motion x (m).
    """
    k, c, path, path_rate = constants[b], constants[b + 1], local[PENETRATION, i], local[RATE, i]
    excess, change, slope, bend = lever_motion(path, constants[b + 2], constants[b + 3], constants[b + 4])
    initial = slope - change
    depth = initial * path - local[PENETRATION, i + 1]
    linear = k * depth + c * (initial * path_rate - local[RATE, i + 1])
    N = k * excess + c * change * path_rate
    local[ANSWER, i], local[ANSWER, i + 1] = N * slope + linear * change, -N
    local[ENERGY, i], local[ENERGY, i + 1] = 0.5 * k * excess * (2.0 * depth + excess), 0.0
    force_slope, square_change = k * slope + c * bend * path_rate, slope * slope - initial * initial
    by_path = slope * force_slope - k * initial * initial + (linear + N) * bend
    tangent[0, i, 0], tangent[0, i, 1] = by_path, -k * change
    tangent[0, i + 1, 0], tangent[0, i + 1, 1] = -force_slope + k * initial, 0.0
    tangent[1, i, 0], tangent[1, i, 1] = c * square_change, -c * change
    tangent[1, i + 1, 0], tangent[1, i + 1, 1] = -c * change, 0.0


def arch(constants: FloatArray, b: int, i: int, count: int, local: FloatArray, tangent: FloatArray) -> None:
    """Write the response of a shallow arch beyond the linear bar and beam, see `flexcam.fem.elements.arch`.

    Axial strain ``e = D + y g (y + 2 y0)/2`` with axial force ``N = EA/L e``: the forces are ``N g (y + y0)`` on the
    bending scalars y and ``EA/L (e - D)`` on the stretch D. The constants are EA/L (N/m), g by rows (36), y0 (6) and g
    y0 (6); the scalars the stretch D (m), then the bending scalars y.

    Parameters
    ----------
    count
        Number of bending scalars that move, from the first on.
    """
    axial, shortening = constants[b], 0.0
    for r in range(count):
        product = 0.0
        for s in range(count):
            product += constants[b + 1 + 6 * r + s] * (local[PENETRATION, i + 1 + s] + constants[b + 37 + s])
        local[ANSWER, i + 1 + r] = product
        shortening += local[PENETRATION, i + 1 + r] * (product + constants[b + 43 + r])
    bending_part = 0.5 * axial * shortening
    N = axial * local[PENETRATION, i] + bending_part
    local[ANSWER, i] = bending_part
    local[ENERGY, i] = bending_part * (0.5 * bending_part / axial + local[PENETRATION, i])
    for r in range(count):
        coupling = axial * local[ANSWER, i + 1 + r]
        local[ENERGY, i + 1 + r] = 0.0
        tangent[0, i, 1 + r], tangent[0, i + 1 + r, 0] = coupling, coupling
        for s in range(count):
            tangent[0, i + 1 + r, 1 + s] = N * constants[b + 1 + 6 * r + s] + coupling * local[ANSWER, i + 1 + s]
    for r in range(count):
        local[ANSWER, i + 1 + r] *= N


def film_integrals(p: float, q: float) -> tuple[float, float, float, float, float, float]:
    """Return integrals over the half of a journal bearing in which its film has pressure.

    With the thickness ``H = 1 - p cos(a) - q sin(a)`` they are the second and third derivatives by p and q of half the
    integral of 1/H over a from -pi/2 to pi/2, ``(pi/2 + atan(p/w))/w`` with ``w^2 = 1 - p^2 - q^2``. They are the
    integrals of cos^2/H^3, cos sin/H^3 and sin^2/H^3, and 3 times those of cos^3/H^4, cos^2 sin/H^4 and cos sin^2/H^4.
    The eccentricity along the middle of the pressure is p, that across it q, as fractions of the clearance.

    Examples
    --------
    >>> film_integrals(0.0, 0.0)
    (1.5707963267948966, 0.0, 1.5707963267948966, 4.0, 0.0, 2.0)
    """
    across, square = 1.0 - q * q, 1.0 - p * p - q * q
    w2, w4, ratio = 1.0 / square, 1.0 / square**2, p * p / across
    w6, f3 = w4 * w2, math.atan2(math.sqrt(square), -p) * w2 / math.sqrt(square)
    f5, f7 = f3 * w2, f3 * w4
    shear = (2.0 + ratio) * w4 + 3.0 * p * f5
    return (
        3.0 * p * w4 + f3 + 3.0 * p * p * f5,
        q * shear,
        p * w2 / across * (1.0 + q * q * (3.0 * w2 + 2.0 / across)) + f3 + 3.0 * q * q * f5,
        4.0 * w4 + 15.0 * p * p * w6 + p * (9.0 * f5 + 15.0 * p * p * f7),
        q * (12.0 * p * w6 + p / across * (w4 + 3.0 * p * p * w6) + 3.0 * f5 + 15.0 * p * p * f7),
        shear + q * q * (2.0 * ratio / across * w4 + (8.0 + 7.0 * ratio) * w6 + 15.0 * p * f7),
    )


def rotate_tensor(cc: float, cs: float, ss: float, cosine: float, sine: float) -> tuple[float, float, float]:
    """Return the entries xx, xy and yy of a symmetric matrix from those in axes that are rotated by an angle."""
    product = cosine * sine
    return (
        cc * cosine * cosine - 2.0 * cs * product + ss * sine * sine,
        (cc - ss) * product + cs * (cosine * cosine - sine * sine),
        cc * sine * sine + 2.0 * cs * product + ss * cosine * cosine,
    )


def short_bearing(constants: FloatArray, b: int, i: int, local: FloatArray, tangent: FloatArray) -> None:
    """Write the response of the oil film of a short journal bearing, cavitated over half its circumference.

    Ocvirk's bearing (D. Childs, Turbomachinery Rotordynamics, 1993, ch. 3): the pressure is
    ``p = 3 mu (L^2/4 - z^2) (A . n)/h^3`` where ``A . n > 0``, and zero elsewhere. With the displacement d and the
    velocity v of the journal, the normal n to the shell and the axes x to y in the sense of rotation, ``h = c - d . n``
    and ``A = omega (d_y, -d_x) + 2 v``. The force that resists the motion is ``mu R L^3/(2 c^3)`` times the integral of
    ``(A . n) n/(h/c)^3``; see `film_integrals`. Beyond the eccentricity 0.99 the force grows linearly: this bounds an
    iteration and is no model of a touching shell.

    The constants are ``mu R L^3/(2 c^3)`` (N s/m), clearance c (m) and speed omega (rad/s); the scalars the
    displacements d_x and d_y of the journal across the shaft (m).
    """
    factor, clearance, speed = constants[b], constants[b + 1], constants[b + 2]
    x, y = local[PENETRATION, i], local[PENETRATION, i + 1]
    a_x, a_y = speed * y + 2.0 * local[RATE, i], -speed * x + 2.0 * local[RATE, i + 1]
    size, radius = math.hypot(a_x, a_y), math.hypot(x, y)
    cosine, sine = (a_x / size, a_y / size) if size > 0.0 else (1.0, 0.0)
    excess = max(radius / clearance - THINNEST, 0.0)
    scale = THINNEST / radius if excess > 0.0 else 1.0 / clearance
    factor *= 1.0 + _STEEP * excess
    cc, cs, ss, ccc, ccs, css = film_integrals(scale * (x * cosine + y * sine), scale * (y * cosine - x * sine))
    m_xx, m_xy, m_yy = rotate_tensor(cc, cs, ss, cosine, sine)
    t_xx, t_xy, t_yy = rotate_tensor(ccc, ccs, css, cosine, sine)
    f_x, f_y = factor * (m_xx * a_x + m_xy * a_y), factor * (m_xy * a_x + m_yy * a_y)
    local[ANSWER, i], local[ANSWER, i + 1], local[ENERGY, i], local[ENERGY, i + 1] = f_x, f_y, 0.0, 0.0
    tangent[1, i, 0], tangent[1, i, 1] = 2.0 * factor * m_xx, 2.0 * factor * m_xy
    tangent[1, i + 1, 0], tangent[1, i + 1, 1] = 2.0 * factor * m_xy, 2.0 * factor * m_yy
    thinning, rotation = factor * size * scale, factor * speed
    tangent[0, i, 0], tangent[0, i, 1] = thinning * t_xx - rotation * m_xy, thinning * t_xy + rotation * m_xx
    tangent[0, i + 1, 0], tangent[0, i + 1, 1] = thinning * t_xy - rotation * m_yy, thinning * t_yy + rotation * m_xy
    if excess > 0.0:  # the film follows the direction of the displacement only
        e_x, e_y, growth = x / radius, y / radius, _STEEP / (1.0 + _STEEP * excess) / clearance
        change_x = growth * f_x - thinning * (t_xx * e_x + t_xy * e_y)
        change_y = growth * f_y - thinning * (t_xy * e_x + t_yy * e_y)
        tangent[0, i, 0] += change_x * e_x
        tangent[0, i, 1] += change_x * e_y
        tangent[0, i + 1, 0] += change_y * e_x
        tangent[0, i + 1, 1] += change_y * e_y


def force_table(x: float, constants: FloatArray, b: int) -> LawResponse:
    """Return the force of a table over the travel x, linear between its rows and beyond both ends.

    The constants are the number n of rows, then n travels (m, ascending), n forces (N) and n stored energies (J).

    Examples
    --------
    >>> force_table(1.5, [2.0, 0.0, 1.0, 0.0, 4.0, 0.0, 2.0], 0)
    (6.0, 4.0, 0.0, 4.5)
    """
    n = int(constants[b])
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x < constants[b + 1 + middle]:
            high = middle
        else:
            low = middle
    row = b + 1 + low
    force, distance = constants[row + n], x - constants[row]
    slope = (constants[row + n + 1] - force) / (constants[row + 1] - constants[row])
    return force + slope * distance, slope, 0.0, constants[row + 2 * n] + distance * (force + 0.5 * slope * distance)


def cam_lift(angle: float, constants: FloatArray, b: int) -> tuple[float, float, float]:
    """Return the lift of a cam at an angle, m, with its first and second derivative (m/rad and m/rad^2).

    The constants are the number of pieces, then the rows of `CamLift`.
    """
    t = angle - TURN * math.floor(angle / TURN)
    low, high = 0, int(constants[b])
    while high - low > 1:
        middle = (low + high) // 2
        if t < constants[b + 1 + 7 * middle]:
            high = middle
        else:
            low = middle
    row = b + 1 + 7 * low
    x, lift, slope, bend = t - constants[row], 0.0, 0.0, 0.0
    for k in range(6):
        bend, slope, lift = bend * x + 2.0 * slope, slope * x + lift, lift * x + constants[row + 6 - k]
    return lift, slope, bend


def turn_cam(i: int, last: int, slope: float, bend: float, local: FloatArray, tangent: FloatArray) -> None:
    """Write the response on the angle of a cam, the last scalar of a law, and that of the law to this angle.

    With the lift s the force is ``s' N``, so that both derive from the energy of the law.
    """
    r, N = last - i, local[ANSWER, i]
    local[ANSWER, last], local[ENERGY, last] = slope * N, 0.0
    tangent[0, last, 0], tangent[1, last, 0] = slope * tangent[0, i, 0], slope * tangent[1, i, 0]
    for j in range(i, last + 1):
        by_x, by_v = tangent[0, j, 0], tangent[1, j, 0]
        tangent[0, j, r], tangent[1, j, r] = slope * by_x + bend * local[RATE, last] * by_v, slope * by_v
    tangent[0, last, r] += bend * N


def custom(law: int, angle: float, local: FloatArray, tangent: FloatArray) -> None:
    """Do nothing: the direct engine binds a function in its place that evaluates a law written in Python.

    Parameters
    ----------
    law
        Row of the table of laws.
    angle
        Cam angle, rad.
    """


def evaluate_laws(
    laws: IntArray, constants: FloatArray, cam: FloatArray, k: int, column: int, local: FloatArray,
    tangent: FloatArray, states: FloatArray,
) -> None:  # fmt: skip
    """Write forces, tangents and energies of all laws at the given penetrations and rates.

    `laws` (l, 8) and `constants` are the table of the laws. `cam` has the functions of the cam angle, a row per
    instant: row k is that of the instant, and `column` has the first function. `local` has a row per quantity of
    the scalars; `PENETRATION` and `RATE` are read, `ANSWER` and `ENERGY` written. `tangent` (2, c, width) are the
    derivatives of the force of a scalar by penetration (0) and rate (1) of the scalars of its law; `states` has a row
    per quantity of the internal states.
    """
    for law in range(len(laws)):
        kind, i, b, f = laws[law, KIND], laws[law, FIRST], laws[law, CONSTANTS], column + laws[law, FUNCTIONS]
        x, v = local[PENETRATION, i], local[RATE, i]
        N, by_x, by_v, energy = 0.0, 0.0, 0.0, 0.0
        if kind == ARCH:
            arch(constants, b, i, laws[law, SCALARS] - 1, local, tangent)
            continue
        if kind == LEVER:
            lever(constants, b, i, local, tangent)
            continue
        if kind == SHORT_BEARING:
            short_bearing(constants, b, i, local, tangent)
            continue
        if kind == CUSTOM:
            custom(law, cam[k, f], local, tangent)
            continue
        last, slope, bend = i + laws[law, SCALARS] - 1, 0.0, 0.0
        if laws[law, LIFT] >= 0:  # the last scalar is the angle of the cam
            lift, slope, bend = cam_lift(local[PENETRATION, last], constants, laws[law, LIFT])
            x, v = x + lift, v + slope * local[RATE, last]
        local[DEPTH, i] = x
        if kind == BILATERAL:
            N, by_x, by_v, energy = bilateral(x, v, constants[b], constants[b + 1])
        elif kind == STOP:
            N, by_x, by_v, energy = stop(x, v, constants[b], constants[b + 1], constants[b + 2])
        elif kind == HUNT_CROSSLEY:
            N, by_x, by_v, energy = hunt_crossley(x, v, constants[b], constants[b + 1])
        elif kind == LINE_CONTACT:
            N, by_x, by_v, energy = line_contact(
                x, v, cam[k, f + 1], constants[b + 5] * cam[k, f], constants[b], constants[b + 1], constants[b + 2],
                constants[b + 3], constants[b + 4],
            )  # fmt: skip
        elif kind == OIL_COLUMN:
            z = laws[law, LAW_STATE]
            stiffness, leak, refill = constants[b], constants[b + 1], constants[b + 2]
            e, by_travel, by_begin = oil_column(
                x, states[BEGIN, z], states[STATE, z], states[SPAN, z], stiffness, leak, refill
            )  # fmt: skip
            states[BY_TRAVEL, z], states[BY_BEGIN, z] = by_travel, by_begin
            active_stiffness = stiffness if e > 0.0 else 0.0
            N, by_x = constants[b + 3] + active_stiffness * e, active_stiffness * by_travel
            energy = constants[b + 3] * x + 0.5 * active_stiffness * e * e
            states[NEW_STATE, z] = x - e
            states[FLOW, z] = stiffness / (leak if e > 0.0 else refill)
            states[STATE_RATE, z], states[ENERGY_BY_STATE, z] = states[FLOW, z] * e, -active_stiffness * e
        elif kind == OIL_CHAMBER:
            z = laws[law, LAW_STATE]
            N, by_x, energy, e, by_travel, by_begin, velocity, flow, oil = oil_chamber(
                x, states[BEGIN, z], states[STATE, z], states[SPAN, z], constants, b
            )
            states[BY_TRAVEL, z], states[BY_BEGIN, z], states[NEW_STATE, z] = by_travel, by_begin, x - e
            states[STATE_RATE, z], states[FLOW, z], states[ENERGY_BY_STATE, z] = velocity, flow, -oil
        elif kind == SLIDING_FRICTION:
            N, by_x, by_v, energy = sliding_friction(
                v, constants[b], constants[b + 1], constants[b + 2], constants[b + 3], constants[b + 4]
            )
        elif kind == TABLE:
            N, by_x, by_v, energy = force_table(x, constants, b)
        else:
            N, by_x, by_v, energy = bilateral(x, v, constants[b] * cam[k, f], 0.0)
        local[ANSWER, i], local[ENERGY, i], tangent[0, i, 0], tangent[1, i, 0] = N, energy, by_x, by_v
        if last > i + (laws[law, LIFT] >= 0):  # Coulomb friction on the next scalar
            b = laws[law, FRICTION]
            direction, steepness = coulomb(local[RATE, i + 1], constants[b + 1])
            friction = constants[b] * direction
            local[ANSWER, i + 1], local[ENERGY, i + 1] = friction * N, 0.0
            tangent[0, i + 1, 0], tangent[1, i + 1, 0] = friction * by_x, friction * by_v
            tangent[1, i + 1, 1] = constants[b] * N * steepness
        if laws[law, LIFT] >= 0:
            turn_cam(i, last, slope, bend, local, tangent)


def evaluate_rows(
    laws: IntArray, constants: FloatArray, cam: FloatArray, column: int, penetration: FloatArray, rate: FloatArray,
    inner: FloatArray, begin: FloatArray, spans: FloatArray, local: FloatArray, tangent: FloatArray,
    states: FloatArray, force: FloatArray, energy: FloatArray, state_rows: FloatArray, tangents: FloatArray,
) -> None:  # fmt: skip
    """Write forces (N), stored energies (J) and the rows of the internal states at m instants, a row each.

    Scalars and their rates have the shape (m, c), internal states `inner` (m, s); each instant ends a step of a length
    of `spans` (m,), s, at whose beginning the states and the scalars `begin` (m, s) of their laws apply. `state_rows`
    has the shape (m, 9, s); `tangents` (m, 2, c, width) is not written if it has no rows. The first four arguments are
    those of `evaluate_laws`; `local`, `tangent` and `states` are work arrays.
    """
    for k in range(len(penetration)):
        for i in range(local.shape[1]):
            local[PENETRATION, i], local[RATE, i] = penetration[k, i], rate[k, i]
            local[ANSWER, i], local[ENERGY, i] = 0.0, 0.0
        for z in range(states.shape[1]):
            states[STATE, z], states[BEGIN, z], states[SPAN, z] = inner[k, z], begin[k, z], spans[k]
        evaluate_laws(laws, constants, cam, k, column, local, tangent, states)
        for i in range(local.shape[1]):
            force[k, i], energy[k, i] = local[ANSWER, i], local[ENERGY, i]
        for z in range(states.shape[1]):
            for row in range(len(states)):
                state_rows[k, row, z] = states[row, z]
        if len(tangents) > 0:
            for i in range(local.shape[1]):
                for j in range(tangent.shape[2]):
                    tangents[k, 0, i, j], tangents[k, 1, i, j] = tangent[0, i, j], tangent[1, i, j]


FUNCTIONS_OF_LAWS = (
    bilateral, stop, passes_ramp, hunt_crossley, line_load, line_contact, oil_column, check_valve_velocity,
    chamber_pressure, fitted_weight, oil_chamber, lever_motion, coulomb, sliding_friction, lever, arch, film_integrals,
    rotate_tensor, short_bearing, force_table, cam_lift, turn_cam, custom, evaluate_laws, evaluate_rows,
)  # fmt: skip
"""Functions for the compiler, in the order of their calls."""


@dataclass(frozen=True)
class LawKind:
    """Row of the table of laws: the names of its function, constants and functions of the cam angle, and its traits."""

    name: str
    constants: tuple[str, ...]
    functions: tuple[str, ...] = ()
    scalars: int = 1  #: sensed scalars, without friction
    states: int = 0  #: internal states
    damping: tuple[int, ...] = ()  #: indices of the constants of dissipation
    touching: bool = False  #: it begins to act where its first scalar becomes positive: a step ends there
    ramp: int | None = None  #: index of the penetration over which the damping of a touching law grows, if it does
    polynomial: bool = False  #: its force is a polynomial of at most third degree: Simpson's rule is exact
    circulatory: bool = False  #: its force has no potential: the rotation of the shaft does work through it


LAWS = {
    BILATERAL: LawKind("bilateral", ("stiffness", "damping"), damping=(1,)),
    STOP: LawKind("stop", ("stiffness", "damping", "depth"), damping=(1,), touching=True, ramp=2),
    HUNT_CROSSLEY: LawKind("hunt_crossley", ("stiffness", "dissipation"), damping=(1,), touching=True),
    LINE_CONTACT: LawKind(
        "line_contact", ("width", "give", "rest", "depth", "dissipation", "limit per radius"),
        ("relative radius", "cosine"), damping=(4,), touching=True,
    ),
    OIL_COLUMN: LawKind("oil_column", ("stiffness", "leak", "refill", "plunger force"), states=1),
    OIL_CHAMBER: LawKind(
        "oil_chamber",
        ("area", "height", "modulus", "air", "supply pressure", "leak", "cracking force", "refill", "valve loss",
         "plunger force"), states=1,
    ),
    PULSATING: LawKind("bilateral", ("stiffness",), ("pulsation",)),
    LEVER: LawKind("lever", ("stiffness", "damping", "arm", "driven arm", "angle"), scalars=2, damping=(1,)),
    ARCH: LawKind("arch", ("axial", "shortening", "bow", "pull of the bow"), scalars=ARCH_SCALARS, polynomial=True),
    SHORT_BEARING: LawKind(
        "short_bearing", ("factor", "clearance", "speed"), scalars=2, damping=(0,), circulatory=True,
    ),
    SLIDING_FRICTION: LawKind(
        "sliding_friction", ("force", "breakaway force", "Stribeck velocity", "damping", "reversal velocity"),
        damping=(0, 1, 3),
    ),
    TABLE: LawKind("force_table", ("rows", "travels", "forces", "energies")),
    CUSTOM: LawKind("custom", (), ("cam angle",)),
}  # fmt: skip
"""The laws by number."""
