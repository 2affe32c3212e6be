"""Buckling of columns, K + lambda K_g: S. P. Timoshenko, J. M. Gere, Theory of Elastic Stability, 2nd ed., ch. 2.

P L^2/EI with n equal elements; the digits are those of an independent script. One
element by hand, pinned-pinned: ends turning by -r and r, 2 EI/L r = P L/6 r, so 12.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh

from flexcam.fem import Material, Member, Section

SOURCE = "Euler columns, cubic elements"
DIGITS = {
    "pinned-pinned": {1: 12.0, 2: 9.94385, 4: 9.87466, 8: 9.86993, 10: 9.86974},
    "fixed-free": {1: 2.48596, 2: 2.46866, 4: 2.46748, 8: 2.46741, 10: 2.46740},
}
EXACT = {"pinned-pinned": math.pi**2, "fixed-free": math.pi**2 / 4, "fixed-fixed": 4 * math.pi**2}
LENGTH, SECTION, STEEL = 1.7, Section.circle(0.02), Material(2e11, 0.3, 7800.0)


def critical(plane_beam, supports, elements):
    beam = plane_beam(Member(STEEL, SECTION), LENGTH, elements, supports)
    bends = [i for i, name in enumerate(beam.dofs.names) if not name.endswith("ux")]
    pick = np.ix_(bends, bends)
    K, G = beam.stiffness.dense()[pick], beam.geometric(-1.0).dense()[pick]
    largest = eigh(-G, K, eigvals_only=True)[-1]
    return LENGTH**2 / (STEEL.E * SECTION.Iz * largest)


CASES = [(supports, n) for supports, table in DIGITS.items() for n in table]


@pytest.mark.parametrize(("supports", "elements"), CASES)
def test_load_factors(record, plane_beam, supports, elements):
    record(
        source=SOURCE, case=supports, quantity=f"P L^2/EI, {elements} elements", unit="1",
        reference=DIGITS[supports][elements], computed=critical(plane_beam, supports, elements), tolerance=5.1e-6,
        absolute=True, reason="half a unit of the last digit given",
    )  # fmt: skip


@pytest.mark.parametrize("supports", sorted(EXACT))
def test_convergence_to_euler(record, plane_beam, fitted_order, supports):
    counts = np.array([4, 8, 16, 32])
    errors = [critical(plane_beam, supports, n) / EXACT[supports] - 1 for n in counts]
    assert min(errors) > 0.0  # a displacement method is too stiff
    record(
        source=SOURCE, case=supports, quantity="order of convergence in h", unit="1", reference=4.0,
        computed=fitted_order(1 / counts, errors), tolerance=0.1, absolute=True,
        reason="cubic elements: 2 (p + 1 - m) = 4; fitted over 4 to 32 elements",
    )  # fmt: skip
