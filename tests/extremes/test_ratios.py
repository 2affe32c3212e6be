"""Ratios of masses to 1e12 and of stiffnesses to 1e14: two masses in a row, and a shaft with a heavy tip.

Two unknowns: omega^2 = (b +- sqrt(b^2 - 4 c))/2 with b = (k1 + k2)/m1 + k2/m2 and c = k1 k2/(m1 m2); the lower root is
taken as 2 c/(b + sqrt(..)), which loses nothing. Rounding of an entry k1 + k2 changes k1 by up to eps/2 (k1 + k2): at
k2/k1 = 1e14 that is 1.1 %, and no solver can bring it back.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh

from flexcam.core import Triplets
from flexcam.dynamics import Cause, RunFailedError, modes, static_displacement
from flexcam.fem.assembly import Member, mass, stiffness
from flexcam.fem.assembly import beams as fem_beams
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.rigid_bodies import PointMass, mass_at
from flexcam.fem.sections import Section

MASSES, STIFFNESSES = "ratio of masses", "ratio of stiffnesses"
EPS = float(np.finfo(float).eps)
NAMES, HELD = ("near", "far"), np.zeros((2, 0))


def row_of_two(k, m):
    """Return mass and stiffness of ground - k1 - m1 - k2 - m2."""
    K = np.array([[k[0] + k[1], -k[1]], [-k[1], k[1]]])
    return Triplets.from_dense(np.diag(m)), Triplets.from_dense(K)


def closed_form(k, m):
    b, c = (k[0] + k[1]) / m[0] + k[1] / m[1], k[0] * k[1] / (m[0] * m[1])
    larger = b + math.sqrt(b * b - 4.0 * c)
    return math.sqrt(2.0 * c / larger), math.sqrt(0.5 * larger)


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("ratio", [1e3, 1e6, 1e9, 1e12])
def test_two_masses(expect, ratio, which):
    m = (ratio, 1.0) if which == 0 else (1.0, ratio)
    M, K = row_of_two((1.1, 1.3), m)
    found, theory = modes(M, K).omegas, closed_form((1.1, 1.3), m)
    for i, name in enumerate(("lower", "higher")):
        # The lower mode to rounding; the higher one is taken from the side that keeps it, at worst eps * ratio apart
        # until the two sides meet at the square root of 1/eps: 1e-8, more on some processors.
        expect.right(MASSES, f"two masses, m1/m2 = {m[0] / m[1]:g}, {name} frequency", what="omega",
                     reference=theory[i], computed=found[i], tolerance=5e-8 if i else 1e-14, unit=" rad/s")  # fmt: skip


LENGTH, PARTS = 1.0, 10


class Cantilever:
    """A round shaft of 20 mm, fixed at its start, as matrices; `heavy` times its own mass at its tip."""

    def __init__(self, steel, heavy):
        section = Section.circle(0.02)
        mesh = chain((0, 0, 0), (LENGTH, 0, 0), PARTS)
        beams = fem_beams(mesh, {"shaft": Member(steel, section, rotary_inertia=False)})
        self.dofs = dof_map(mesh, [("start", COMPONENTS)])
        own = steel.density * section.A * LENGTH
        tip = mass_at(mesh.node("end"), PointMass(heavy * own, (0.0, 0.0, 0.0)), self.dofs)
        self.M, self.K = mass(beams, self.dofs) + tip, stiffness(beams, self.dofs)
        # The shape of a static tip load carries 33/140 of the shaft: right to the square of the mass ratio.
        self.lowest = math.sqrt(3.0 * steel.E * section.Iz / LENGTH**3 / ((heavy + 33.0 / 140.0) * own))


@pytest.mark.parametrize("heavy", [1e3, 1e6, 1e9, 1e12])
def test_a_heavy_tip(expect, steel, heavy):
    shaft = Cantilever(steel, heavy)
    found = modes(shaft.M, shaft.K, 2, free=np.zeros((shaft.dofs.size, 0))).omegas
    # Rounding of K, eps n^4 = 2e-12, bounded with all terms of a row by ten times that and more; the shape's remainder,
    # 1/heavy^2 of some 1e-3 at most; the elements' own error, 1e-6, of the shaft's part of the mass.
    expect.right(MASSES, f"shaft with {heavy:g} times its mass at the tip", what="lowest omega", unit=" rad/s",
                 reference=shaft.lowest, computed=found[0],
                 tolerance=1e-3 / heavy**2 + 1e-6 / heavy + 1e-10)  # fmt: skip


def test_why_omega_squared_is_not_solved_for(steel):
    """A general solver of K x = omega^2 M x loses the lowest mode at 1e12: 76 % of omega^2 here, elsewhere its sign.

    The rounding of its largest eigenvalue, eps omega_max^2, is larger than omega_min^2.
    """
    shaft = Cantilever(steel, 1e12)
    squares = eigh(shaft.K.dense(), shaft.M.dense(), eigvals_only=True)
    assert EPS * squares[-1] > shaft.lowest**2
    assert abs(squares[0] / shaft.lowest**2 - 1.0) > 0.05


SOFT_ON_STIFF = [1e6, 1e9]


@pytest.mark.parametrize("ratio", SOFT_ON_STIFF)
def test_a_soft_spring_under_a_stiff_link(expect, ratio):
    k = (1.1, 1.1 * ratio)
    M, K = row_of_two(k, (1.0, 1.0))
    given = f"soft spring to ground, link {ratio:g} times as stiff"
    # The entry's rounding, eps/2 (k1 + k2) of k1, the same of both others, and the solution's; half of it in omega.
    allowed = 4.0 * EPS * ratio
    expect.right(STIFFNESSES, given, what="lowest omega", reference=closed_form(k, (1.0, 1.0))[0], unit=" rad/s",
                 computed=modes(M, K, free=HELD).omegas[0], tolerance=allowed)  # fmt: skip
    moved = static_displacement(K, np.array([0.0, 1.0]), NAMES, HELD)[1]
    expect.right(STIFFNESSES, given, what="deflection", reference=1.0 / k[0] + 1.0 / k[1], computed=moved,
                 tolerance=2.0 * allowed, unit=" m")  # fmt: skip


@pytest.mark.parametrize("ratio", [1e6, 1e14])
def test_a_stiff_spring_under_a_soft_link_costs_nothing(expect, ratio):
    k = (1.1 * ratio, 1.3)
    M, K = row_of_two(k, (1.0, 1.0))
    expect.right(STIFFNESSES, f"soft link on a ground {ratio:g} times as stiff", what="lowest omega", unit=" rad/s",
                 reference=closed_form(k, (1.0, 1.0))[0], computed=modes(M, K, free=HELD).omegas[0],
                 tolerance=1e-14)  # fmt: skip


@pytest.mark.parametrize("ratio", [1e12])
def test_modes_tell_the_digits_lost(expect, ratio):
    k = (1.1, 1.1 * ratio)
    M, K = row_of_two(k, (1.0, 1.0))
    found = modes(M, K, free=HELD)
    lost = abs(found.omegas[0] / closed_form(k, (1.0, 1.0))[0] - 1.0)
    assert lost <= found.rounding[0] <= 1000.0 * EPS * ratio
    expect.warns(STIFFNESSES, f"soft spring to ground, link {ratio:g} times as stiff, modes", found.describe_rounding(),
                 r"rounding", r"\d(\.\d+)? %")  # fmt: skip


@pytest.mark.parametrize("ratio", [1e14])
def test_modes_beyond_the_digits_are_refused(expect, ratio):
    M, K = row_of_two((1.1, 1.1 * ratio), (1.0, 1.0))
    with pytest.raises(RunFailedError) as refusal:
        modes(M, K, free=HELD)
    assert refusal.value.status.cause is Cause.ROUNDING
    expect.refuses(STIFFNESSES, f"soft spring to ground, link {ratio:g} times as stiff, modes",
                   str(refusal.value.status), "rounding", r"\d+(\.\d+)? %")  # fmt: skip


@pytest.mark.parametrize("ratio", [1e14])
def test_statics_beyond_the_digits_are_refused(expect, ratio):
    _, K = row_of_two((1.1, 1.1 * ratio), (1.0, 1.0))
    with pytest.raises(RunFailedError) as refusal:
        static_displacement(K, np.array([0.0, 1.0]), NAMES, HELD)
    assert refusal.value.status.cause is Cause.ROUNDING
    expect.refuses(STIFFNESSES, f"soft spring to ground, link {ratio:g} times as stiff, deflection",
                   str(refusal.value.status), "rounding")  # fmt: skip


def test_a_soft_motion_is_not_taken_for_a_free_one(expect):
    """Where the free motions are not given, they are sought numerically: what rounding has taken must not be one."""
    M, K = row_of_two((1.1, 1.1e14), (1.0, 1.0))
    try:
        said = f"free motions: {modes(M, K).rigid}"
    except RunFailedError as refusal:
        said = str(refusal.status)
    expect.refuses(STIFFNESSES, "bare matrices, link 1e14 times as stiff as the spring to ground, modes", said,
                   "rounding")  # fmt: skip
