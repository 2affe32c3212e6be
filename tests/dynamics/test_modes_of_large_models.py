"""Modes of models above the limit of dense matrices: same digits and same errors as below the limit.

References: closed forms of beams. Rounding in K shifts omega^2 by up to about eps times the ratio of the maximum to
the minimum eigenvalue, which grows as n^4 with the number of elements: it sets the tolerances.
"""

import math
import sys

import numpy as np
import pytest

from flexcam.dynamics import NotPositiveError, modes
from flexcam.fem.assembly import Member, build_beams, geometric, stiffness
from flexcam.fem.assembly import mass as mass_of
from flexcam.fem.dofs import COMPONENTS, dof_map
from flexcam.fem.mesh import chain
from flexcam.fem.rigid_bodies import PointMass, free_motions, mass_at
from flexcam.fem.sections import Section
from tests.thinning import mostly_slow

ROUND = Section.circle(0.01)
LENGTH = 2.0
HINGED = [("start", ("ux", "uy", "uz", "rx")), ("end", ("uy", "uz"))]
FIXED = [("start", COMPONENTS)]


class Shaft:
    def __init__(self, steel, parts, supports, section=ROUND):
        self.mesh = chain((0, 0, 0), (LENGTH, 0, 0), parts)
        self.beams = build_beams(self.mesh, {"shaft": Member(steel, section, rotary_inertia=False)})
        self.dofs = dof_map(self.mesh, supports)
        self.K, self.M = stiffness(self.beams, self.dofs), mass_of(self.beams, self.dofs)
        self.free = free_motions(self.mesh, self.dofs, [])

    def axial(self, force):
        return self.K + geometric(self.beams, np.full(len(self.beams), force), self.dofs)

    def tip(self, mass, inertia=(0.0, 0.0, 0.0)):
        return mass_at(self.mesh.node("end"), PointMass(mass, inertia), self.dofs)


@pytest.fixture(params=["dense", "lanczos"])
def path(request, monkeypatch):
    """Set the dense limit to solve a model of any size by either method; three masses are always condensed."""
    limit = 10**6 if request.param == "dense" else 3
    monkeypatch.setattr(sys.modules["flexcam.dynamics.modes"], "DENSE_LIMIT", limit)
    return request.param


def paths_and_parts(few, many):
    """Return parameters of tests with few and many elements; many on the dense path are slow."""
    return [("dense", few), ("lanczos", few), pytest.param("dense", many, marks=pytest.mark.slow), ("lanczos", many)]


def bending_frequencies(steel, count):
    """Return omega_n = n^2 pi^2/L^2 sqrt(EI/rho A)."""
    n = np.arange(1, count + 1)
    return (n * math.pi / LENGTH) ** 2 * math.sqrt(steel.E * ROUND.Iz / (steel.density * ROUND.A))


@pytest.mark.parametrize(("path", "parts"), paths_and_parts(60, 102), indirect=["path"])
def test_modes_of_hinged_shaft(steel, path, parts):
    """Eight modes in pairs; eps n^4 is 3e-8 at most, the error of the elements (4 pi/60)^4/1440 is 1.3e-6.

    Bending of a round shaft in two planes has equal frequencies up to the rounding of K.
    """
    shaft = Shaft(steel, parts, HINGED)
    omegas = modes(shaft.M, shaft.K, 8, free=shaft.free).omegas
    assert np.allclose(omegas, np.repeat(bending_frequencies(steel, 4), 2), rtol=2e-6, atol=0.0)
    pairs = omegas.reshape(4, 2)
    assert np.ptp(pairs, axis=1).max() <= 1e-7 * pairs.min()


@pytest.mark.parametrize(("path", "parts"), paths_and_parts(40, 102), indirect=["path"])
def test_modes_of_free_shaft(steel, path, parts):
    """Six zeros, and shapes orthonormal to 1e-10; the first bending pair is (4.730040745)^2 sqrt(EI/rho A)/L^2."""
    shaft = Shaft(steel, parts, [])
    found = modes(shaft.M, shaft.K, 12, free=shaft.free)
    assert found.rigid == 6
    assert found.omegas[:6].tolist() == [0.0] * 6
    gram = found.shapes.T @ shaft.M.multiply(found.shapes)
    assert np.abs(gram - np.eye(len(gram))).max() <= 1e-10
    first = 4.730040744862704**2 / LENGTH**2 * math.sqrt(steel.E * ROUND.Iz / (steel.density * ROUND.A))
    assert found.omegas[6:8] == pytest.approx([first, first], rel=1e-6)


@pytest.mark.parametrize(
    ("path", "count"),
    mostly_slow(
        [
            ("lanczos", 2),
            ("lanczos", 6),
            ("lanczos", None),
            pytest.param("dense", 6, marks=pytest.mark.slow),
            ("dense", 2),
            pytest.param("dense", None, marks=pytest.mark.slow),
        ],
        2,
    ),
    indirect=["path"],
)
def test_modes_with_extreme_mass_ratio(steel, path, count):
    """A tip mass 1e12 times the shaft's: sqrt(3EI/L^3/m), with rounding of K eps n^4 = 3e-8."""
    shaft = Shaft(steel, 102, FIXED)
    heavy = 1e12 * steel.density * ROUND.A * LENGTH
    found = modes(shaft.M + shaft.tip(heavy), shaft.K, count, free=shaft.free)
    first = math.sqrt(3.0 * steel.E * ROUND.Iz / LENGTH**3 / heavy)
    assert found.omegas[:2] == pytest.approx([first, first], rel=1e-6)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("parts", [40, 102])
def test_modes_of_massless_members(steel, path, parts, count):
    """With a tip mass only: two bending modes, sqrt(3EI/L^3/m), and an axial mode, sqrt(EA/L/m)."""
    shaft = Shaft(steel, parts, FIXED)
    found = modes(shaft.tip(2.0), shaft.K, count, free=shaft.free)
    bending, axial = math.sqrt(3.0 * steel.E * ROUND.Iz / LENGTH**3 / 2.0), math.sqrt(steel.E * ROUND.A / LENGTH / 2.0)
    assert found.omegas == pytest.approx([bending, bending, axial][:count], rel=1e-6)  # eps n^4 = 3e-8


@pytest.mark.parametrize("parts", [40, 102])
def test_massless_members_add_no_modes(steel, path, parts):
    """Three masses have three modes, for any requested number; massless unknowns add no spurious modes."""
    shaft = Shaft(steel, parts, FIXED)
    found = modes(shaft.tip(2.0), shaft.K, 10, free=shaft.free)
    assert len(found.omegas) == 3


def buckling_load(steel):
    return math.pi**2 * steel.E * ROUND.Iz / LENGTH**2


@pytest.mark.parametrize("parts", [40, 102])
def test_modes_beyond_buckling_raise_error(steel, path, parts):
    """The motion is the half sine, in any plane: only it loses its stiffness at Euler's load."""
    shaft = Shaft(steel, parts, HINGED)
    with pytest.raises(NotPositiveError, match="not positive") as refusal:
        modes(shaft.M, shaft.axial(-1.01 * buckling_load(steel)), 6, free=shaft.free)
    way = shaft.dofs.nodal(refusal.value.motion)
    deep = np.hypot(way[:, 1], way[:, 2])
    assert deep / deep.max() == pytest.approx(np.sin(math.pi * shaft.mesh.nodes[:, 0] / LENGTH), abs=1e-4)


@pytest.mark.parametrize(("path", "parts"), paths_and_parts(40, 102), indirect=["path"])
@pytest.mark.parametrize("share", mostly_slow([0.5, 0.99], 2))
def test_modes_below_buckling(steel, path, parts, share):
    """Omega sqrt(1 - P/P_cr); the error of the elements (pi/40)^4/720 = 5e-8 of P_cr is 5e-6 of 1 - 0.99."""
    shaft = Shaft(steel, parts, HINGED)
    found = modes(shaft.M, shaft.axial(-share * buckling_load(steel)), 2, free=shaft.free).omegas
    assert found == pytest.approx([bending_frequencies(steel, 1)[0] * math.sqrt(1.0 - share)] * 2, rel=2e-5)


def test_modes_of_thousand_elements(steel):
    """Plane bending, ten modes. Rounding of K: eps (n/k)^4, n = 1000, is 2e-4 for the first and 2e-8 for the tenth.

    Half of it appears in omega; the error of the elements (10 pi/1000)^4/1440 is 1e-9.
    """
    flat = ("uz", "rx", "ry")
    shaft = Shaft(steel, 1000, [("start", ("ux", "uy", *flat)), ("inner", flat), ("end", ("uy", *flat))])
    assert shaft.dofs.size > 600
    found, exact = modes(shaft.M, shaft.K, 10, free=shaft.free).omegas, bending_frequencies(steel, 10)
    allowed = 1e-4 / np.arange(1, 11) ** 4 + 1e-8
    assert (np.abs(found / exact - 1.0) <= allowed).all(), found / exact - 1.0
