"""Sections: closed forms, printed torsion table, thin-tube limits, and shear factors.

Torsion of a rectangle: S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed., art. 109, table on p. 312
(J = k1 (2a)^3 (2b) with sides 2b >= 2a, three printed digits). Cowper (1966), Table 1: shear factors.
"""

import math

import numpy as np
import pytest
from scipy.special import zeta

from flexcam.core.errors import InputError
from flexcam.fem.sections import Section


def membrane_torsion(a, b, terms=4000):
    """Return twice the volume under Prandtl's membrane by the double sine series (a different one than in flexcam)."""
    n = np.arange(1, terms, 2, dtype=float)
    i, j = n[:, None], n
    return 256 / math.pi**6 * float(np.sum(1 / (i * j) ** 2 / ((i / a) ** 2 + (j / b) ** 2))) * a * b


@pytest.mark.parametrize(
    ("ratio", "k1"),
    [(1.0, 0.1406), (1.2, 0.166), (1.5, 0.196), (2.0, 0.229), (2.5, 0.249), (3.0, 0.263), (10.0, 0.312)],
)
def test_rectangle_torsion_matches_table(ratio, k1):
    digits = 0.6e-4 if ratio == 1.0 else 0.6e-3  # half a unit of the last printed digit, plus rounding of the table
    assert abs(Section.rectangle(1.0, ratio).J / ratio - k1) <= digits


@pytest.mark.parametrize(("h", "b"), [(1.0, 1.0), (0.02, 0.05), (3.0, 0.7)])
def test_rectangle_torsion_matches_double_series(h, b):
    # The double series truncated at 4000 is low by less than 1e-10 (the tail falls as terms^-3 times an edge sum).
    assert pytest.approx(membrane_torsion(h, b), rel=1e-9) == Section.rectangle(h, b).J


def series_torsion(a, b):
    """Return J to twelve digits: sum tanh(x_n)/n^5 = 31 zeta(5)/32 - sum (1 - tanh x_n)/n^5, decaying as e^-2x."""
    x = [(n, n * math.pi * a / (2 * b)) for n in range(1, 60, 2)]
    series = 31 / 32 * zeta(5) - math.fsum((1 - math.tanh(t)) / n**5 for n, t in x)
    return a * b**3 * (1 / 3 - 64 * b / (math.pi**5 * a) * series)


@pytest.mark.parametrize("ratio", [1.0, 1.7, 10.0])
def test_rectangle_torsion_to_twelve_digits(ratio):
    assert pytest.approx(series_torsion(ratio, 1.0), rel=1e-12) == Section.rectangle(1.0, ratio).J


def test_rectangle_properties():
    section = Section.rectangle(width_y=0.02, width_z=0.05)
    assert section.Iz == pytest.approx(0.05 * 0.02**3 / 12)
    assert section.Iy == pytest.approx(0.02 * 0.05**3 / 12)
    assert (section.fibre_y, section.fibre_z) == (0.01, 0.025)
    assert section.kappa_y == section.kappa_z == pytest.approx(5 / 6)


def test_circle_properties():
    section = Section.circle(0.025)
    assert pytest.approx(math.pi * 0.0125**2) == section.A
    assert section.Iy == section.Iz == pytest.approx(math.pi * 0.0125**4 / 4)
    assert pytest.approx(section.Iy + section.Iz) == section.J
    assert section.kappa_y == pytest.approx(6 * 1.3 / (7 + 6 * 0.3))  # Cowper: 6 (1 + nu)/(7 + 6 nu)


def test_thin_tube_properties():
    # A thin tube: A = 2 pi r t, J = 2 pi r^3 t, kappa = 2 (1 + nu)/(4 + 3 nu) (Cowper); error of order (t/r)^2.
    r, t = 1.0, 1e-3
    tube = Section.tube(2 * r + t, 2 * r - t)
    assert pytest.approx(2 * math.pi * r * t, rel=1e-12) == tube.A
    assert pytest.approx(2 * math.pi * r**3 * t, rel=t**2) == tube.J
    assert tube.kappa_y == pytest.approx(2 * 1.3 / 4.9, rel=t**2)


@pytest.mark.parametrize(
    "make", [lambda: Section.tube(0.01, 0.01), lambda: Section.circle(0.0), lambda: Section.rectangle(1, -1)]
)
def test_invalid_section_raises_error(make):
    with pytest.raises(InputError):
        make()


@pytest.mark.parametrize("same", [Section.circle(0.03), Section.rectangle(0.03, 0.02)], ids=["circle", "rectangle"])
def test_default_fibre_distances(same):
    """Twice the radius of gyration: exact for a solid circle, conservative for a rectangle."""
    given = Section(same.A, same.Iy, same.Iz, same.J)
    assert given.fibre_y == pytest.approx(2.0 * math.sqrt(same.Iz / same.A), rel=1e-12)
    assert given.fibre_z == pytest.approx(2.0 * math.sqrt(same.Iy / same.A), rel=1e-12)
    assert given.fibre_y >= same.fibre_y * (1.0 - 1e-12)
    assert given.fibre_z >= same.fibre_z * (1.0 - 1e-12)
