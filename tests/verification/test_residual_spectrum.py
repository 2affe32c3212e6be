"""Residual vibration after a rise as a spectrum of the law: closed forms, quadrature, and the oscillator itself.

y'' + w^2 y = w^2 s over the rise, ratio = rise time over period. The closed forms of single laws are in M. P. Koster,
Vibrations of Cam Mechanisms (1974), ch. 3; that of a sum of harmonics follows from the Fourier integral of its s'. The
other reference integrates the oscillator with s itself (order 8, error 1e-12 per step), where flexcam uses a Fourier
integral of s''.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flexcam import compare, read_case, run
from flexcam.cams import LAWS, BSplineLaw, CompoundCycloid, Harmonic, Polynomial, ReversedLaw, Scca, residual_spectrum
from tests.thinning import mostly_slow

SOURCE = "Residual vibration after a rise, spectrum of a law"
RATIOS = np.array([1e-3, 0.05, 0.5, 0.73, 1.0, 1.5, 2.0, 2.5, 3.0, 4.2, 7.0, 15.3])
"""Ratios that include multiples of 1/2, at which the closed forms are limits."""


def harmonic_spectrum(law):
    """Return abs(sin pi l)/(pi l) times abs(1 + sum c_n l^2/(n^2 - l^2)) in a form that is finite at l = n."""

    def residual(ratio):
        terms = [c * (-1.0) ** (n + 1) * np.sinc(ratio - n) / (n + ratio) for n, c in law.harmonics]
        return np.abs(np.sinc(ratio) + ratio * sum(terms))

    return residual


FOUR_HARMONICS = Harmonic(((1, 0.9), (2, 0.2), (3, -0.3), (4, 0.2)))
SINGLE_LAWS = {
    "shm": lambda ratio: np.abs(0.5 * math.pi * np.sinc(0.5 - ratio) / (2.0 * ratio + 1.0)),
    "parabolic": lambda ratio: np.sinc(0.5 * ratio) ** 2,
    "cycloidal": lambda ratio: np.abs(np.sinc(ratio - 1.0) / (ratio * (1.0 + ratio))),
}
HARMONIC_LAWS = {
    name: law for name, law in {**LAWS, "four harmonics": FOUR_HARMONICS}.items() if isinstance(law, Harmonic)
}
CLOSED_FORMS = (
    {name: (LAWS[name], form) for name, form in SINGLE_LAWS.items()}
    | {"cos": (LAWS["cos"], SINGLE_LAWS["shm"])}
    | {name: (law, harmonic_spectrum(law)) for name, law in HARMONIC_LAWS.items()}
)


@pytest.mark.parametrize(
    ("law", "ratio", "digits"),
    [
        ("shm", 0.5, math.pi / 4), ("shm", 1.0, 1 / 3), ("shm", 1.5, 0.0), ("shm", 2.0, 1 / 15),
        ("parabolic", 1.0, 0.405285), ("parabolic", 1.5, 0.090063), ("parabolic", 2.0, 0.0),
        ("cycloidal", 1.0, 0.5), ("cycloidal", 1.5, 0.169765), ("cycloidal", 2.0, 0.0),
    ],
)  # fmt: skip
def test_spectrum_matches_known_values(law, ratio, digits, record):
    record(source=SOURCE, case=law, quantity=f"residual amplitude / lift, ratio {ratio:g}", unit="1", reference=digits,
           computed=round(float(residual_spectrum(LAWS[law], ratio)), 12), tolerance=5.1e-7, absolute=True,
           reason="six decimals given, or exact")  # fmt: skip


@pytest.mark.parametrize("law", sorted(CLOSED_FORMS))
def test_quadrature_matches_closed_form(law, record):
    """The integral of s'' over w loses digits as 1/w: at a ratio of 1e-3 the factor of the rounding of s'' is 160."""
    closed, integral = CLOSED_FORMS[law][1](RATIOS), residual_spectrum(CLOSED_FORMS[law][0], RATIOS)
    record(source=SOURCE, case=law, quantity="quadrature minus closed form, largest of twelve ratios", unit="1",
           reference=0.0, computed=round(np.abs(integral - closed).max(), 13), tolerance=1e-12, absolute=True,
           reason="rounding")  # fmt: skip


def integrate_oscillator(law, ratio):
    """Return the residual amplitude of the undamped oscillator, integrated piece by piece between joints."""
    w, state = 2 * math.pi * ratio, np.zeros(2)

    def rate(z, y):
        return [y[1], w**2 * (float(law(np.array([z]))[0]) - y[0])]

    for start, end in pairwise([0.0, *law.breaks, 1.0]):
        state = solve_ivp(rate, (start, end), state, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return math.hypot(state[0] - 1.0, state[1] / w)


OTHER_LAWS = {
    "modified-trapezoid": LAWS["modified-trapezoid"],
    "modified-sine": LAWS["modified-sine"],
    "2-3": LAWS["2-3"],
    "3-4-5": LAWS["3-4-5"],
    "4-5-6-7": LAWS["4-5-6-7"],
    "pavlovic-new": LAWS["pavlovic-new"],
    "quinquinomial": LAWS["quinquinomial"],
    "quinquinomial turned": ReversedLaw(LAWS["quinquinomial"]),
    "fb2": LAWS["fb2"],
    "fb2, split 0.55, turned": ReversedLaw(CompoundCycloid(0.55)),
    "SCCA 0.3, 0.1, 0.6": Scca(0.3, 0.1, 0.6),
    "steady start": Polynomial((1, 2, 3), ((1.0, 0, 1.0), (1.0, 1, 0.5), (0.0, 1, 0.8))),
    "B-spline": BSplineLaw((0.0, 0.0, 0.0, 0.2, 0.9, 1.0, 1.0, 1.0)),
}
"""Other laws; two of them begin or end with a velocity jump, which excites vibration as well."""


@pytest.mark.parametrize("ratio", mostly_slow([0.62, 1.5, 3.1]))
@pytest.mark.parametrize("law", OTHER_LAWS)
def test_spectrum_matches_oscillator(law, ratio, record):
    record(source=SOURCE, case=law, quantity=f"residual amplitude / lift, ratio {ratio:g}", unit="1",
           reference=round(integrate_oscillator(OTHER_LAWS[law], ratio), 9),
           computed=residual_spectrum(OTHER_LAWS[law], ratio),
           tolerance=2e-9, absolute=True, reason="some hundred steps of the reference, 1e-11 each")  # fmt: skip


@pytest.mark.parametrize("law", ["pavlovic-trigonometric", "freudenstein-1-3"])
def test_closed_form_matches_oscillator(law, record):
    record(source=SOURCE, case=law, quantity="residual amplitude / lift, ratio 1.7", unit="1",
           reference=round(integrate_oscillator(LAWS[law], 1.7), 9), computed=residual_spectrum(LAWS[law], 1.7),
           absolute=True,
           tolerance=2e-9, reason="some hundred steps of the reference, 1e-11 each")  # fmt: skip


def test_shape_and_order_of_ratios():
    law = LAWS["3-4-5"]
    found = residual_spectrum(law, [[3.1, 0.62], [1.5, 40.0]])
    assert found.shape == (2, 2)
    alone = [[float(residual_spectrum(law, r)) for r in row] for row in [[3.1, 0.62], [1.5, 40.0]]]
    np.testing.assert_allclose(found, alone, rtol=0, atol=1e-13)
    assert residual_spectrum(law, []).shape == (0,)


def test_decay_rate_for_large_ratios(record, fitted_order):
    """The acceleration of 3-4-5 begins at a slope of 60, so the residual decreases as ratio^-3."""
    ratios = np.array([40.25, 80.25, 160.25])
    amplitude = residual_spectrum(LAWS["3-4-5"], ratios)
    record(source=SOURCE, case="3-4-5", quantity="power of the ratio, 40 to 160", unit="1", reference=-3.0,
           computed=round(fitted_order(ratios, amplitude), 6), tolerance=0.02, absolute=True,
           reason="next term is ratio^-4")  # fmt: skip


@pytest.mark.parametrize("ratio", [0.0, -1.0, math.nan, math.inf])
def test_invalid_ratios_raise_error(ratio):
    with pytest.raises(ValueError, match=r"above zero"):
        residual_spectrum(LAWS["3-4-5"], [1.0, ratio])


FOLLOWER = """
format = 1
nodes = {{ cam = [0, 0, 0], follower = ["0 mm", "30 mm", "0 mm"] }}
supports = {{ cam = ["ux", "uy", "uz", "rx", "ry"], follower = ["ux", "uz"] }}
masses.follower = {{ at = "follower", mass = 2.0 }}
contacts.cam = {{ cam = "plate", follower = "follower", model = "bilateral", direction = "uy", stiffness = {k} }}
output.probes = ["follower"]
run = {{ speed = "60 rpm", revolutions = 0.5, steps_per_revolution = 7200 }}
[cams.plate]
at = "cam"
axis = [1, 0, 0]
law = "{law}"
lift = "10 mm"
rise = "60 deg"
dwell = "240 deg"
return = "60 deg"
"""


@pytest.mark.parametrize("law", ["cycloidal", "parabolic"])
def test_compared_run_has_residual_vibration_of_spectrum(law, record, tmp_path):
    """A mass on an elastic contact, in the dwell after a rise of 1.3 of its periods; the run ends in this dwell."""
    case = tmp_path / "follower.toml"
    frequency = 2.0 * math.pi * 1.3 * 6.0  # a rise takes a sixth of a second
    case.write_text(FOLLOWER.format(law=law, k=2.0 * frequency**2), encoding="utf-8")
    read = read_case(case)
    found = compare(run(read), run(read, rigid=True), "follower.uy", 60.0)
    record(source=SOURCE, case=f"{law}, run of an oscillator", quantity="residual amplitude / lift", unit="1",
           reference=float(residual_spectrum(LAWS[law], 1.3)), computed=found.residual / 0.01, tolerance=1e-3,
           reason="extremes between steps; collocation")  # fmt: skip
