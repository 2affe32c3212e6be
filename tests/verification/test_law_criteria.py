"""Criteria of normalized laws: V. D. Pavlovic and M. M. Lutovac, New class of camshaft transfer functions.

Values and places are recomputed from the printed formulas; the trigonometric law is the one of the printed figures.
"""

import math
import re

import numpy as np
import pytest

from flexcam.cams import LAWS, Polynomial, criteria
from flexcam.cams.law_criteria import stationary_points

SOURCE = "Pavlovic and Lutovac, New class of camshaft transfer functions"
AS_PRINTED = LAWS["pavlovic-trigonometric"]
"""z - 15 sin(2 pi z)/(32 pi) - sin(4 pi z)/(96 pi)."""

PUBLISHED = {
    "4-5-6-7 polynomial": (LAWS["4-5-6-7"], (2.1875, 0.5), (7.51319, 0.276393), (10.7502, 0.349244)),
    "trigonometric as computed in print": (AS_PRINTED, (1.89583, 0.5), (5.98019, 0.223172), (7.04106, 0.311711)),
    "Gutman 1-3": (LAWS["gutman-1-3"], (2.0, 0.5), (5.13020, 0.152043), (8.12486, 0.383302)),
    "new, equation (21)": (LAWS["pavlovic-new"], (1.39843, 0.766805), (math.pi**2, 0.0), (6.69869, 0.109312)),
}
"""Maximum f', f'' and f' f'' with their places."""


@pytest.mark.parametrize("case", PUBLISHED)
def test_published_extremes(case, record):
    law, *rows = PUBLISHED[case]
    found = criteria(law)
    for name, extremes, (value, place) in zip(
        ("f'", "f''", "f' f''"), (found.velocity, found.acceleration, found.moment), rows, strict=True
    ):
        record(source=SOURCE, case=case, quantity=f"max {name}", unit="1", reference=value, computed=extremes[1].value,
               tolerance=5e-6, reason="six digits given")  # fmt: skip
        record(source=SOURCE, case=case, quantity=f"place of max {name}", unit="1", reference=place,
               computed=extremes[1].at, tolerance=6e-7, absolute=True, reason="six decimals given")  # fmt: skip


def test_gutman_law_has_two_acceleration_peaks(record):
    """The peaks are at sin^2(2 pi z) = 2/3, z = 0.152043 and 0.347957, with the value 2 pi sqrt(2/3)."""
    found = criteria(LAWS["gutman-1-3"]).acceleration[1]
    record(source=SOURCE, case="Gutman 1-3", quantity="second place of max f''", unit="1", reference=0.347957,
           computed=found.also[0], tolerance=6e-7, absolute=True, reason="six decimals given")  # fmt: skip
    assert len(found.also) == 1
    assert found.value == pytest.approx(2 * math.pi * math.sqrt(2 / 3), rel=1e-12)


class TestNewLaw:
    """Equation (21), with the published values and further ones."""

    def test_maximum_moment_is_negative(self, record):
        found = criteria(LAWS["pavlovic-new"])
        for quantity, reference, computed in [("max |f' f''|", 6.70167, found.Cm),
                                              ("place of max |f' f''|", 0.890559, found.moment[0].at)]:  # fmt: skip
            record(source=SOURCE, case="new, equation (21)", quantity=quantity, unit="1", reference=reference,
                   computed=computed, tolerance=8e-7, reason="six digits given")  # fmt: skip
        assert found.moment[0].value == -found.Cm

    def test_printed_peak_velocity_is_local_maximum(self, record):
        """The paper prints it as the maximum: f' = 1.39414 at 0.23139."""
        law = LAWS["pavlovic-new"]
        at = stationary_points(law, 1)
        near = at[np.argmin(np.abs(at - 0.23139))]
        around = law(near + np.array([-1e-3, 0.0, 1e-3]), 1)
        assert around.argmax() == 1
        assert criteria(law).Cv > around[1] + 0.004
        for quantity, reference, computed, tolerance in [("local maximum of f'", 1.39414, around[1], 5e-6),
                                                         ("its place", 0.23139, near, 6e-6)]:  # fmt: skip
            record(source=SOURCE, case="new, equation (21)", quantity=quantity, unit="1", reference=reference,
                   computed=computed, tolerance=tolerance, absolute=True, reason="as printed")  # fmt: skip

    def test_law_violates_published_conditions(self, record):
        """The law violates (5), f(1/2) = 1/2, and (9), f(z) = 1 - f(1 - z); its acceleration jumps at both ends."""
        found = criteria(LAWS["pavlovic-new"])
        rows = [("f(1/2)", 0.498047, found.middle, 5e-7, "six decimals given"),
                ("f''(0)", math.pi**2, found.ends[0][2], 1e-12, "exact"),
                ("f''(1)", -(math.pi**2), found.ends[1][2], 1e-12, "exact")]  # fmt: skip
        for quantity, reference, computed, tolerance, reason in rows:
            record(source=SOURCE, case="new, equation (21)", quantity=quantity, unit="1", reference=reference,
                   computed=computed, tolerance=tolerance, absolute=True, reason=reason)  # fmt: skip
        assert not found.symmetric
        assert found.rest_at_ends == 1
        steps, middle = found.violations
        assert re.search(r"the acceleration jumps at a dwell, by .9.8696 at z = 0 and by .9.8696 at z = 1$", steps)
        assert middle == "not symmetric: s(1/2) = 0.498047"

    def test_law_matches_printed_products(self):
        """The printed equation (21) contains products of cosines, evaluated here term by term."""
        z = np.linspace(0.0, 1.0, 501)
        c1, c2, c3, c4 = (np.cos(k * math.pi * z) for k in (1, 2, 3, 4))
        printed = (
            0.462615966796875 - 0.4375 * c1 + 0.095703125 * c1**2 - 0.059814453125 * c2 - 0.02392578125 * c2**2
            - 0.0625 * c3 + 0.02734375 * c1 * c3 + 0.001953125 * c3**2 - 0.00213623046875 * c4
            - 0.001708984375 * c2 * c4 - 0.000030517578125 * c4**2
        )  # fmt: skip
        np.testing.assert_allclose(LAWS["pavlovic-new"](z), printed, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("law", "m"), [("pavlovic-trigonometric", 4), ("gutman-1-3", 6)])
def test_laws_match_printed_sums(law, m):
    """Both laws have the form z - 15 sin(2 pi z)/(32 pi) - sin(m pi z)/(96 pi)."""
    z = np.linspace(0.0, 1.0, 501)
    printed = z - 15 * np.sin(2 * math.pi * z) / (32 * math.pi) - np.sin(m * math.pi * z) / (96 * math.pi)
    np.testing.assert_allclose(LAWS[law](z), printed, rtol=0, atol=1e-15)


@pytest.mark.parametrize("end", [0, 1])
def test_printed_trigonometric_law_has_velocity_jumps(record, end):
    found = criteria(AS_PRINTED)
    record(source=SOURCE, case="trigonometric as computed in print", quantity=f"f'({end})", unit="1", reference=1 / 48,
           computed=found.ends[end][1], tolerance=1e-12, reason="exact")  # fmt: skip
    assert found.rest_at_ends == 0
    jumps = r"the velocity jumps at a dwell, by .0.0208333 at z = 0 and by .0.0208333 at z = 1$"
    assert re.search(jumps, found.violations[0])


@pytest.mark.parametrize(
    ("name", "order"),
    [("shm", 1), ("parabolic", 1), ("cycloidal", 2), ("modified-sine", 2), ("2-3", 1), ("3-4-5", 2), ("4-5-6-7", 3)],
)
def test_order_of_rest_at_ends(name, order):
    assert criteria(LAWS[name]).rest_at_ends == order


Z = np.linspace(0.0, 1.0, 101)


@pytest.mark.parametrize("name", sorted(LAWS))
def test_acceleration_bound_and_symmetry_of_all_laws(name):
    found = criteria(LAWS[name])
    assert found.symmetric == np.allclose(LAWS[name](Z) + LAWS[name](1.0 - Z), 1.0, rtol=0, atol=1e-9)
    assert found.Ca >= 4.0 - 1e-12  # no law from rest to rest is below the parabola
    assert (found.Cj is None) == (name == "parabolic")


def test_signed_extremes_of_asymmetric_law():
    """Published row 1 of the quinquinomials has u'' from -6.3086 to 6.3374."""
    found = criteria(Polynomial((2, 5, 8, 11, 14)))
    assert found.acceleration[0].value == pytest.approx(-6.3086, abs=5e-5)
    assert found.acceleration[1].value == pytest.approx(6.3374, abs=5e-5)
    assert not found.symmetric
    assert found.Ca == pytest.approx(6.3374, abs=5e-5)


def test_moment_of_simple_harmonic_law():
    """The moment s' s'' = (pi^3/8) sin 2 pi z has its peak pi^3/8 at z = 1/4."""
    found = criteria(LAWS["shm"])
    assert found.Cm == pytest.approx(math.pi**3 / 8, rel=1e-12)
    assert found.moment[1].at == pytest.approx(0.25, abs=1e-10)
