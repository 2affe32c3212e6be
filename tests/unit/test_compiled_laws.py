"""The laws as machine code and as Python: one force, one tangent, at every gap, rate, state and cam angle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam.fem.elements.shallow import Arch
from flexcam.integrate.compiled.packed import PackedForces
from flexcam.integrate.local import LocalForces
from flexcam.linalg import Triplets
from flexcam.system import AngleVector, CamMotion, LocalForce, System, constant
from flexcam.system.pointwise import line_load
from flexcam.train.adjuster import OilColumn
from flexcam.train.bowing import Bowing
from flexcam.train.coils import Pulsating
from flexcam.train.lever import LeverEnd
from flexcam.train.parts import Pulsation
from flexcam.train.penalty import Bilateral, HertzLine, HuntCrossley, Inclined, Sliding, Stop
from flexcam.train.rockers import Lever

SAME = 1e-13
"""Of the largest term: a dozen roundings, which the compiler may take in another order and fuse."""


def radius(angle, order):
    return 0.02 + 0.015 * np.sin(angle) if order == 0 else 0.015 * np.cos(angle)


def cosine(angle, order):
    return 0.9 + 0.09 * np.cos(2.0 * angle)


LINE = HertzLine(0.01, 2.07e11, 0.29, radius, 0.03, 0.2)
LEVER = Lever(
    "a", "b", (0.03, 0.045), 1e-4, np.eye(6)[1], angles=(0.1, -0.2), stiffness=(1e7, 2e7), damping=(50.0, 9.0)
)
LAWS = {
    "bilateral": (Bilateral(2e6, 30.0), 1), "stop": (Stop(2e6, 300.0), 1), "stops": (Stop(2e6, 300.0, 3e-5), 4),
    "stop without damping": (Stop(5e5), 1), "hunt-crossley": (HuntCrossley(5e7, 0.3), 1),
    "elastic": (HuntCrossley(5e7, 0.0), 1), "line": (LINE, 1), "inclined": (Inclined(LINE, cosine), 1),
    "pulsating": (Pulsating(4e4, Pulsation(2.0, 0.7, 0.3)), 3), "lever, driven": (LeverEnd(LEVER, 0), 2),
    "lever, point": (LeverEnd(LEVER, 1), 2), "sliding": (Sliding(HuntCrossley(5e7, 0.3), 0.12, 1e-2), 2),
    "sliding line": (Sliding(LINE, 0.12, 1e-3), 2), "sliding inclined": (Sliding(Inclined(LINE, cosine), 0.1, 1e-2), 2),
    "sliding stop": (Sliding(Stop(2e6, 300.0), 0.1, 1e-2), 2),
    "sliding both ways": (Sliding(Bilateral(1e6), 0.1, 1e-2), 2),
}  # fmt: skip
GAPS = [0.0, -1e-6, 1e-12, 1e-6, 1e-5, 1e-5 * (1 - 1e-15), 3e-5, 2e-4, 1e-3, 0.01, -0.3]
RATES = [0.0, 1e-9, -0.5, 2.0, -30.0, 3e3]


def single(law, count):
    """Return the local force of one law, each scalar an unknown of its own, stacked and as data."""
    rows = [AngleVector.constant(row) for row in np.eye(count)]
    force = LocalForce("force", tuple(rows), tuple(rows), law, (constant(0.0),) * count)
    unit = Triplets.from_dense(np.eye(count))
    forces = LocalForces(System(unit, unit, unit, tuple(map(str, range(count))), local_forces=(force,)))
    return forces, PackedForces.of(forces)


def answered(law, count, gap, rate, angle, state=(), half=0.0):
    """Return what machine code answers: force, by_gap, by_rate, and the rows of the internal state."""
    from flexcam.integrate.compiled.kernel import respond

    forces, packed = single(law, count)
    cam = packed.cam(forces.schedule(CamMotion(*(np.array([x]) for x in (angle, 1.0, 0.0)))))
    width = int(packed.laws[:, 2].max())
    local, tangent, inner = np.zeros((7, count)), np.zeros((2, count, width)), np.zeros((5, len(state)))
    local[1], local[2], inner[2] = gap, rate, state
    respond(packed.laws, packed.constants, cam, 0, cam.shape[1] - len(packed.functions), half, local, tangent, inner)
    whole = np.zeros((2, count, count))
    for first, size in packed.laws[:, 1:3].tolist():
        part = slice(first, first + size)
        whole[:, part, part] = tangent[:, part, :size]
    return local[3], whole[0], whole[1], inner


def assert_same(law, count, gap, rate, angle):
    gap, rate = np.broadcast_to(gap, count).astype(float), np.broadcast_to(rate, count).astype(float)
    expected = law.respond(gap, rate, np.zeros(0), angle)
    force, by_gap, by_rate, _ = answered(law, count, gap, rate, angle)
    pairs = ((expected.force, force), (expected.by_gap, by_gap), (expected.by_rate, by_rate))
    for (one, other), size in zip(pairs, terms(law), strict=True):
        assert np.isfinite(other).all()
        np.testing.assert_allclose(other, one, rtol=SAME, atol=SAME * max(np.abs(one).max(initial=0.0), size))


def terms(law):
    """Return the size of what a law takes differences of, in its force and both tangents."""
    if not isinstance(law, LeverEnd):
        return 0.0, 0.0, 0.0
    k, c, arm, share = law.lever.stiffness[law.end], law.lever.damping[law.end], law.lever.arms[law.end], 1.5
    return k * arm, k * share**2, c * share**2


@pytest.mark.parametrize("name", sorted(LAWS))
def test_where_laws_have_their_corners(name):
    law, count = LAWS[name]
    for gap in GAPS:
        for rate in RATES:
            assert_same(law, count, gap, rate, 0.7)


@pytest.mark.parametrize("name", sorted(LAWS))
@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    gaps=st.lists(st.floats(-1e-3, 3e-3), min_size=4, max_size=4), angle=st.floats(-10.0, 10.0),
    rates=st.lists(st.floats(-20.0, 20.0), min_size=4, max_size=4),
)  # fmt: skip
def test_anywhere(name, gaps, rates, angle):
    law, count = LAWS[name]
    assert_same(law, count, np.array(gaps[:count]), np.array(rates[:count]), angle)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    gap=st.floats(-2e-3, 2e-3), state=st.floats(-2e-3, 2e-3), half=st.sampled_from([0.0, 1e-7, 1e-4]),
)  # fmt: skip
def test_the_oil_column_at_a_step_s_end(gap, state, half):
    """The leak-down that a step ends with obeys the trapezoidal rule, and the tangent is that of gap and leak-down."""
    law = OilColumn(2e7, 5e4, 60.0, 12.0)
    force, by_gap, _, inner = answered(law, 1, gap, 0.0, 0.0, (state,), half)
    at_end = law.respond(np.array([gap]), np.zeros(1), inner[3], 0.0)
    np.testing.assert_allclose(inner[3] - state, half * inner[4], rtol=1e-12, atol=1e-17)
    # The force is stiffness times a difference of gap and leak-down, which each carry a rounding of their own.
    np.testing.assert_allclose(force, at_end.force, rtol=1e-13, atol=2e7 * 4e-16 * (abs(gap) + abs(state)))
    flow = float(at_end.state_rate_by_gap[0, 0])
    follows = half * flow / (1.0 + half * flow)
    expected = at_end.by_gap[0, 0] + at_end.by_state[0, 0] * follows
    if abs(gap - inner[3, 0]) > 1e-15:
        np.testing.assert_allclose(by_gap[0, 0], expected, rtol=1e-12)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**16), elements=st.integers(1, 3), scale=st.sampled_from([0.0, 1e-6, 1e-3, 0.1]))
def test_arches(seed, elements, scale):
    rng = np.random.default_rng(seed)
    g = rng.normal(size=(elements, 6, 6))
    arch = Arch(rng.uniform(1e6, 1e8, elements), g + np.swapaxes(g, 1, 2), 0.01 * rng.normal(size=(elements, 6)))
    assert_same(Bowing(arch), 7 * elements, scale * rng.normal(size=7 * elements), 0.0, 0.0)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(
    approaches=st.lists(st.floats(1e-12, 2e-3), min_size=1, max_size=6), angle=st.floats(-4.0, 4.0),
)  # fmt: skip
def test_line_loads_of_many_instants_are_those_of_one(approaches, angle):
    """Up to the straight part and beyond it; a load that meets the equation itself, beside the other code."""
    R = np.full(len(approaches), float(radius(np.array([angle]), 0)[0]))
    loads, slopes = LINE.line_load(np.array(approaches), R)
    give, rest = 1.0 / (math.pi * LINE.plane_strain), 1.0 + 0.29 / (1.0 - 0.29)
    most = float(R[0]) * math.pi * LINE.plane_strain / 128.0
    for approach, load, slope in zip(approaches, loads.tolist(), slopes.tolist(), strict=True):
        # Newton's iteration ends at 1e-14 of the load, its slope follows within some of that.
        assert line_load(approach, most, give, rest, LINE.depth) == pytest.approx((load, slope), rel=1e-12)
        if load < most:
            q = give * load
            assert q * (2.0 * math.log(LINE.depth / q) - rest) == pytest.approx(approach, rel=1e-12)


def test_the_line_load_is_smooth_where_it_gets_straight():
    give, rest, most, depth = 1e-12, 1.4, 1e9, 0.02
    end = give * most * (2.0 * math.log(depth / (give * most)) - rest)
    below, above = (line_load(end * (1.0 + side * 1e-9), most, give, rest, depth) for side in (-1, 1))
    assert below[0] == pytest.approx(above[0], rel=4e-9)
    assert below[1] == pytest.approx(above[1], rel=1e-8)
    assert line_load(end, most, give, rest, depth)[0] == pytest.approx(most, rel=1e-14)
