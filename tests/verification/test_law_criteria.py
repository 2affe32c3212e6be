"""Criteria of normalized laws: V. D. Pavlovic and M. M. Lutovac, New class of camshaft transfer functions.

Values and places as recomputed from the printed formulas; the trigonometric law is taken as its figures were computed.
"""

from __future__ import annotations

import math

import pytest

from flexcam.motion import LAWS, Harmonic, Polynomial, criteria

SOURCE = "Pavlovic and Lutovac, New class of camshaft transfer functions"
AS_PRINTED = Harmonic(((1, 15.0 / 16.0), (2, 1.0 / 24.0)))
"""z - 15 sin(2 pi z)/(32 pi) - sin(4 pi z)/(96 pi)."""

ROWS = {
    "4-5-6-7 polynomial": (LAWS["4-5-6-7"], (2.1875, 0.5), (7.51319, 0.276393), (10.7502, 0.349244)),
    "trigonometric as computed in print": (AS_PRINTED, (1.89583, 0.5), (5.98019, 0.223172), (7.04106, 0.311711)),
    "Gutman 1-3": (LAWS["gutman-1-3"], (2.0, 0.5), (5.13020, None), (8.12486, 0.383302)),
}


@pytest.mark.parametrize("case", ROWS)
def test_published_extremes(case, record):
    law, *rows = ROWS[case]
    found = criteria(law)
    for name, extremes, (value, place) in zip(
        ("f'", "f''", "f' f''"), (found.velocity, found.acceleration, found.moment), rows, strict=True
    ):
        record(source=SOURCE, case=case, quantity=f"max {name}", unit="1", reference=value, computed=extremes[1].value,
               tolerance=5e-6, reason="six digits given")  # fmt: skip
        if place is not None:
            record(source=SOURCE, case=case, quantity=f"place of max {name}", unit="1", reference=place,
                   computed=extremes[1].at, tolerance=6e-7, absolute=True, reason="six decimals given")  # fmt: skip


def test_the_printed_trigonometric_law_does_not_come_to_rest(record):
    start = criteria(AS_PRINTED).ends[0]
    record(source=SOURCE, case="trigonometric as computed in print", quantity="f'(0)", unit="1", reference=1 / 48,
           computed=start[1], tolerance=1e-12, reason="exact")  # fmt: skip
    assert criteria(AS_PRINTED).rest_at_ends == 0


@pytest.mark.parametrize(
    ("name", "order"),
    [("shm", 1), ("parabolic", 1), ("cycloidal", 2), ("modified-sine", 2), ("2-3", 1), ("3-4-5", 2), ("4-5-6-7", 3)],
)
def test_rest_at_the_ends(name, order):
    assert criteria(LAWS[name]).rest_at_ends == order


@pytest.mark.parametrize("name", sorted(LAWS))
def test_every_law_listed_is_symmetric_and_bounded(name):
    found = criteria(LAWS[name])
    assert found.symmetric
    assert found.Ca >= 4.0 - 1e-12  # no law from rest to rest stays below the parabola
    assert (found.Cj is None) == (name == "parabolic")


def test_signed_extremes_of_an_unsymmetric_law():
    """Published row 1 of the quinquinomials: u'' from -6.3086 to 6.3374."""
    found = criteria(Polynomial((2, 5, 8, 11, 14)))
    assert found.acceleration[0].value == pytest.approx(-6.3086, abs=5e-5)
    assert found.acceleration[1].value == pytest.approx(6.3374, abs=5e-5)
    assert not found.symmetric
    assert found.Ca == pytest.approx(6.3374, abs=5e-5)


def test_closed_form_of_the_simple_harmonic_moment():
    """S' s'' = (pi^3/8) sin 2 pi z: its peak is pi^3/8 at z = 1/4."""
    found = criteria(LAWS["shm"])
    assert found.Cm == pytest.approx(math.pi**3 / 8, rel=1e-12)
    assert found.moment[1].at == pytest.approx(0.25, abs=1e-10)
