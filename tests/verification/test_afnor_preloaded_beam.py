"""Simply supported beam under axial force: AFNOR and SFM, Guide de validation des progiciels de calcul (1990).

Reference f_n = f_n0 sqrt(1 + N/(n^2 P_cr)), N positive in tension, f_n0 = n^2 pi/(2 L^2) sqrt(EI/(rho A)),
P_cr = pi^2 EI/L^2; with rotary inertia the exact value is divided by sqrt(1 + n^2 pi^2 I/(A L^2)). The digits of the
list (28.702, 114.807; 22.434, 109.080; 33.827, 120.261 Hz) are these formulas rounded.
"""

import math

import pytest

from flexcam.fem.assembly import Member
from flexcam.fem.sections import Material, Section

SOURCE = "AFNOR/SFM guide (1990), simply supported beam under axial force"
LENGTH, SIDE = 2.0, 0.05
STEEL, SQUARE = Material(2e11, 0.3, 7800.0), Section.rectangle(SIDE, SIDE)
DIGITS = {0.0: (28.702, 114.807), -1e5: (22.434, 109.080), 1e5: (33.827, 120.261)}


def exact_frequency(n, force):
    EI, critical = STEEL.E * SQUARE.Iz, (math.pi / LENGTH) ** 2 * STEEL.E * SQUARE.Iz
    bare = n**2 * math.pi / (2 * LENGTH**2) * math.sqrt(EI / (STEEL.density * SQUARE.A))
    return bare * math.sqrt(1 + force / (n**2 * critical))


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("force", sorted(DIGITS))
def test_formula_matches_printed_digits(n, force):
    assert exact_frequency(n, force) == pytest.approx(DIGITS[force][n - 1], abs=5e-4)


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("rotary", [False, True], ids=["slender", "rotary"])
@pytest.mark.parametrize("force", sorted(DIGITS))
def test_frequencies(record, plane_beam, n, rotary, force):
    beam = plane_beam(Member(STEEL, SQUARE, rotary_inertia=rotary), LENGTH, 8, "pinned-pinned")
    slower = math.sqrt(1 + n**2 * math.pi**2 * SQUARE.Iz / (SQUARE.A * LENGTH**2)) if rotary else 1.0
    record(
        source=SOURCE, case=f"N = {force:+g} N, {'with' if rotary else 'without'} rotary inertia", unit="Hz",
        quantity=f"bending {n}", reference=exact_frequency(n, force) / slower,
        computed=beam.frequencies(n, force)[n - 1],
        tolerance=5e-4 if n == 2 else 5e-5,
        reason="8 cubic elements: (n pi/8)^4/1440 = 2e-5 and 3e-4 of the eigenvalue, half of it in frequency",
    )  # fmt: skip
