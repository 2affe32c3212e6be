"""A massless beam with a body at an offset: two bending modes and one axial mode."""

import math

import numpy as np
import pytest

from flexcam import modes, read_case, run

BEAM = """
format = 1
[nodes]
root = [0, 0, 0]
tip = ["300 mm", 0, 0]
[materials.light]
E = "207 GPa"
nu = 0.29
density = 0
[sections]
rod = {{ shape = "circle", diameter = "10 mm" }}
[members]
rod = {{ nodes = ["root", "tip"], material = "light", section = "rod", elements = {elements} }}
[supports]
root = ["ux", "uy", "uz", "rx", "ry", "rz"]
[masses]
body = {{ at = "tip", mass = "0.5 kg", offset = ["20 mm", 0, 0] }}
[loads.pull]
at = "tip"
direction = "uy"
force = "10 N"
[run]
speed = "60 rpm"
revolutions = 0.05
step = "50 us"
[output]
probes = ["tip"]
"""


@pytest.fixture
def beam(tmp_path):
    """Return a function for the case of the beam with a number of elements."""

    def make(elements):
        path = tmp_path / "case.toml"
        path.write_text(BEAM.format(elements=elements), encoding="utf-8")
        return read_case(path)

    return make


@pytest.mark.parametrize("elements", [1, 3, 120])
def test_frequencies_of_massless_beam(beam, elements):
    """Bending of m on a rigid arm c: omega^2 = 1/(m (L^3/3 + L^2 c + L c^2)/EI), twice; axial EA/(L m).

    120 elements leave rounding eps n^4 = 4e-8 in K.
    """
    case = beam(elements)
    EI, A, L, c, m = 207e9 * math.pi * 0.01**4 / 64.0, math.pi * 0.01**2 / 4.0, 0.3, 0.02, 0.5
    bending = math.sqrt(EI / (m * (L**3 / 3.0 + L**2 * c + L * c**2)))
    found = modes(case).modes
    assert found.rigid == 0
    assert found.omegas == pytest.approx([bending, bending, math.sqrt(207e9 * A / L / m)], rel=1e-6)


@pytest.mark.parametrize("elements", [1, 3, pytest.param(120, marks=pytest.mark.slow)])
def test_motion_under_sudden_load(beam, elements):
    """The tip oscillates about the static deflection, up to twice its value."""
    response = run(beam(elements))
    assert response.status.ok
    static = 10.0 * 0.3**3 / (3.0 * 207e9 * math.pi * 0.01**4 / 64.0)
    assert np.isfinite(response["tip"].displacement).all()
    assert np.abs(response["tip"].displacement[:, 1]).max() == pytest.approx(2.0 * static, rel=0.05)


def test_model_without_mass_has_no_modes(tmp_path):
    path = tmp_path / "massless.toml"
    path.write_text(BEAM.format(elements=2).replace("0.5 kg", "0 kg"), encoding="utf-8")
    found = modes(read_case(path))
    assert found.modes.shapes.shape[1] == 0
    assert found.shares == ()
