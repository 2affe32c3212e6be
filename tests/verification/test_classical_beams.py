"""Slender beams in classical supports, against the roots of the characteristic equations.

S. P. Timoshenko, Vibration Problems in Engineering, 3rd ed., sec. 53-58: sin x = 0, cos x cosh x = -1 or +1, tan x =
tanh x. f = x^2/(2 pi L^2) sqrt(EI/(rho A)). The roots are computed here.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from flexcam.dynamics import modes
from flexcam.fem.assembly import Member
from flexcam.fem.sections import Material, Section

SOURCE = "Classical beams, characteristic equations"
# Divided by cosh, so that the roots are well conditioned.
EQUATIONS = {
    "pinned-pinned": (math.sin, lambda n: n * math.pi),
    "fixed-free": (lambda x: math.cos(x) + 1 / math.cosh(x), lambda n: (n - 0.5) * math.pi),
    "fixed-fixed": (lambda x: math.cos(x) - 1 / math.cosh(x), lambda n: (n + 0.5) * math.pi),
    "fixed-pinned": (lambda x: math.sin(x) - math.cos(x) * math.tanh(x), lambda n: (n + 0.25) * math.pi),
}
LENGTH, SECTION, STEEL = 0.9, Section.tube(0.02, 0.012), Material(2e11, 0.3, 7800.0)
SLENDER = Member(STEEL, SECTION, rotary_inertia=False)


def root(supports, n):
    equation, near = EQUATIONS[supports]
    return brentq(equation, near(n) - 0.6, near(n) + 0.6, xtol=1e-14)


def exact_frequency(supports, n):
    speed = math.sqrt(STEEL.E * SECTION.Iz / (STEEL.density * SECTION.A))
    return root(supports, n) ** 2 / (2 * math.pi * LENGTH**2) * speed


def bending_frequencies(plane_beam, supports, elements, count):
    beam = plane_beam(SLENDER, LENGTH, elements, supports)
    bends = np.array([i for i, name in enumerate(beam.dofs.names) if not name.endswith("ux")])
    beam.mass, beam.stiffness = beam.mass.part(bends), beam.stiffness.part(bends)
    return modes(beam.mass, beam.stiffness, count).frequencies


def test_roots_match_tabulated_values():
    """The five digits include 7.8548, once misprinted as 7.885."""
    assert [round(root("fixed-free", n), 4) for n in (1, 2, 3)] == [1.8751, 4.6941, 7.8548]
    assert [round(root("fixed-fixed", n), 4) for n in (1, 2, 3)] == [4.7300, 7.8532, 10.9956]


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("supports", sorted(EQUATIONS))
def test_frequencies(record, plane_beam, supports, n):
    x = root(supports, n)
    record(
        source=SOURCE,
        case=f"{supports}, 16 elements",
        quantity=f"bending {n}",
        unit="Hz",
        reference=exact_frequency(supports, n),
        computed=bending_frequencies(plane_beam, supports, 16, n)[n - 1],
        tolerance=(x / 16) ** 4 / 1440,
        reason="cubic elements: (x/16)^4/1440 of the eigenvalue, half of it in frequency, doubled for clamped ends",
    )


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("supports", sorted(EQUATIONS))
def test_frequencies_converge_with_fourth_order(record, plane_beam, fitted_order, supports, n):
    counts = np.array([4, 6, 8, 12, 16])
    errors = [bending_frequencies(plane_beam, supports, k, n)[n - 1] / exact_frequency(supports, n) - 1 for k in counts]
    assert min(errors) > 0.0  # consistent mass: frequencies converge from above
    record(
        source=SOURCE, case=supports, quantity=f"order of convergence in h, bending {n}", unit="1", reference=4.0,
        computed=fitted_order(1 / counts, errors), tolerance=0.15, absolute=True,
        reason="2 (p + 1 - m) = 4 for cubics and second derivatives; fitted over 4 to 16 elements",
    )  # fmt: skip


def test_axial_and_torsional_rods(record, straight_beam):
    """Frequencies of fixed-free rods are (2n - 1) c/4L; J = I_p for a round tube, so that c = sqrt(G/rho)."""
    held = [("start", ("ux", "uy", "uz", "rx", "ry", "rz"))]
    beam = straight_beam(SLENDER, LENGTH, 40, held)
    for component, modulus in (("ux", STEEL.E), ("rx", STEEL.G)):
        picked = np.array([i for i, name in enumerate(beam.dofs.names) if name.endswith(component)])
        found = modes(beam.mass.part(picked), beam.stiffness.part(picked), 2).frequencies
        for n in (1, 2):
            record(
                source=SOURCE,
                case=f"fixed-free rod, 40 elements, {component}",
                quantity=f"mode {n}",
                unit="Hz",
                reference=(2 * n - 1) / (4 * LENGTH) * math.sqrt(modulus / STEEL.density),
                computed=found[n - 1],
                tolerance=1.05 * ((2 * n - 1) * math.pi / 80) ** 2 / 24,
                reason="linear bars: (k h)^2/24, consistent mass",
            )
