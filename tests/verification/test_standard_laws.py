"""Peaks C_v, C_a, C_j of the standard laws in closed form, and their acceleration jumps next to a dwell.

R. L. Norton, Cam Design and Manufacturing Handbook, 2nd ed. (2009), ch. 2 to 4, gives the numbers. The closed forms
follow from the laws. With the parts b, c, d the SCCA family has the peak acceleration 4 pi^2/((pi^2 - 8)(b^2 - d^2) - 2
pi (pi - 2) b + pi^2). Gutman's and Freudenstein's accelerations are cubics of sin(2 pi z).
"""

import math

import numpy as np
import pytest

from flexcam.cams import LAWS, LiftEvent, Scca, criteria, joints

SOURCE = "Norton, Cam Design and Manufacturing Handbook, standard laws"
PI = math.pi
TRAPEZOID, SINE = 8 * PI / (PI + 2), 4 * PI**2 / (PI + 4)
PEAKS = {
    "parabolic": (2.0, 4.0, None),
    "shm": (PI / 2, PI**2 / 2, PI**3 / 2),
    "cycloidal": (2.0, 2 * PI, 4 * PI**2),
    "modified-trapezoid": (2.0, TRAPEZOID, 4 * PI * TRAPEZOID),
    "modified-sine": (SINE / PI, SINE, 4 * PI * SINE),
    "2-3": (1.5, 6.0, 12.0),
    "3-4-5": (15 / 8, 10 / math.sqrt(3), 60.0),
    "4-5-6-7": (35 / 16, 84 * math.sqrt(5) / 25, 52.5),
    "gutman-1-3": (2.0, 2 * PI * math.sqrt(2 / 3), 6 * PI**2),
    "freudenstein-1-3": (2.0, 12 * PI / 7, 36 * PI**2 / 7),
}
"""None: infinite."""

PRINTED_PEAKS = {
    "modified-trapezoid": (2.0, 4.8881, 61.426),
    "modified-sine": (1.7596, 5.5280, 69.466),
    "gutman-1-3": (2.0, 5.1302, 59.218),
    "freudenstein-1-3": (2.0, 5.3856, 50.758),
}

ACCELERATION_JUMPS = {"parabolic": 4.0, "shm": PI**2 / 2, "2-3": 6.0}
"""Jump of the acceleration next to a dwell; the jerk is infinite there."""


@pytest.mark.parametrize("law", PRINTED_PEAKS)
def test_closed_forms_match_printed_digits(law):
    np.testing.assert_allclose(PEAKS[law], PRINTED_PEAKS[law], rtol=1e-5)  # five digits


@pytest.mark.parametrize("law", PEAKS)
def test_peaks_match_closed_forms(law, record):
    found = criteria(LAWS[law])
    for name, reference, computed in zip(
        ("C_v", "C_a", "C_j"), PEAKS[law], (found.Cv, found.Ca, found.Cj), strict=True
    ):
        if reference is None:
            assert computed is None
        else:
            record(source=SOURCE, case=law, quantity=name, unit="1", reference=reference, computed=computed,
                   tolerance=1e-12, reason="closed form")  # fmt: skip


@pytest.mark.parametrize("law", PEAKS)
def test_acceleration_jump_next_to_dwell(law, record):
    lift, rise = 0.006, 1.2
    first = joints(LiftEvent(LAWS[law], lift, rise, rise, dwell=0.5))[0]
    record(source=SOURCE, case=law, quantity="step of the acceleration next to a dwell", unit="lift/rise^2",
           reference=ACCELERATION_JUMPS.get(law, 0.0), computed=round(first.steps[2] * rise**2 / lift, 8),
           tolerance=1e-7,
           absolute=True, reason="read 4e-9 rad beside the joint")  # fmt: skip
    assert first.steps[:2] == (0.0, 0.0)


@pytest.mark.parametrize(
    "parts", [(0.0, 0.0, 1.0), (0.5, 0.0, 0.5), (0.0, 1.0, 0.0), (0.25, 0.5, 0.25), (0.3, 0.1, 0.6)]
)
def test_peak_acceleration_of_scca_family(parts, record):
    """C_a is the maximum of the second derivative of the law, and gives s(1) = 1."""
    law = Scca(*parts)
    b, c, d = parts
    reference = 4 * PI**2 / ((PI**2 - 8) * (b**2 - d**2) - 2 * PI * (PI - 2) * b + PI**2)
    record(source=SOURCE, case=f"SCCA {b:g}, {c:g}, {d:g}", quantity="C_a", unit="1", reference=reference,
           computed=criteria(law).Ca, tolerance=1e-12, reason="closed form")  # fmt: skip
    assert law(np.array([1.0]))[0] == pytest.approx(1.0, abs=1e-14)


RMS_VALUES = {
    "parabolic": (math.sqrt(4 / 3), 4.0, 0.0),
    "shm": (PI / 2 / math.sqrt(2), PI**2 / 2 / math.sqrt(2), PI**3 / 2 / math.sqrt(2)),
    "cycloidal": (math.sqrt(3 / 2), 2 * PI / math.sqrt(2), 4 * PI**2 / math.sqrt(2)),
    "gutman-1-3": (
        math.sqrt(1 + (225 + 1) / 512), 2 * PI * math.sqrt((225 + 9) / 512), 4 * PI**2 * math.sqrt((225 + 81) / 512)
    ),
    "2-3": (math.sqrt(6 / 5), math.sqrt(12), 12.0),
    "3-4-5": (math.sqrt(10 / 7), math.sqrt(120 / 7), math.sqrt(720.0)),
}  # fmt: skip


@pytest.mark.parametrize("law", RMS_VALUES)
def test_root_mean_squares_match_closed_forms(law, record):
    """Beta functions give the values of s' = 30 z^2 (1 - z)^2 and similar, sums of squares those of harmonics."""
    for name, reference, computed in zip(("s'", "s''", "s'''"), RMS_VALUES[law], criteria(LAWS[law]).rms, strict=True):
        record(source=SOURCE, case=law, quantity=f"root mean square of {name}", unit="1", reference=reference,
               computed=computed, tolerance=1e-12, reason="closed form; rounding")  # fmt: skip


HARMONICS = {
    "cycloidal": lambda n: 2 * PI * (n == 1),
    "gutman-1-3": lambda n: 2 * PI * {1: 15 / 16, 3: 3 / 16}.get(n, 0.0),
    "parabolic": lambda n: 16 / (PI * n) * (n % 2),
    "2-3": lambda n: 12 / (PI * n),
    "shm": lambda n: PI * 4 * n / (4 * n**2 - 1),
}


@pytest.mark.parametrize("law", HARMONICS)
def test_harmonics_of_acceleration(law, record):
    """Sawtooth 6 - 12 z, square wave of 4, sines; for cos(pi z) over half its period 4 n/(pi (4 n^2 - 1))."""
    found = criteria(LAWS[law]).harmonics
    for n in (1, 2, 3, 12):
        record(source=SOURCE, case=law, quantity=f"harmonic {n} of s'' over the rise", unit="1",
               reference=HARMONICS[law](n), computed=round(found[n - 1], 13), tolerance=1e-12, absolute=True,
               reason="closed form; rounding")  # fmt: skip
    assert len(found) == 12
