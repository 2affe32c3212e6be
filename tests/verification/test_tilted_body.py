"""A body with products of inertia on equal rotational springs vibrates about its principal axes.

A thin bar of mass m and length L that is tilted by the angle a in the x-y plane has the moments m L^2/12 (sin^2 a,
cos^2 a, 1) and the product m L^2/12 sin a cos a about its centre: the integrals over its length. On the stiffness k
about all axes its frequencies are those of its principal moments, at any angle: sqrt(k/(m L^2/12)) about two axes. In a
guide it vibrates about x with the moment m L^2/12 sin^2 a.
"""

import math

import numpy as np
import pytest

from flexcam import InputError, build_model, read_case
from flexcam.valvetrain import build_structure
from flexcam.valvetrain.modes import model_modes

SOURCE = "Masses with products of inertia"
MOMENT, THIN, STIFFNESS = 0.3 * 0.12**2 / 12.0, 1e-5, 500.0
CASE = """
format = 1
[nodes]
centre = [0, 0, 0]
[supports]
centre = {held}
[masses]
bar = {{ at = "centre", mass = "300 g", inertia = {moments}, products = {products} }}
[springs]
about-x = {{ at = "centre", direction = "rx", stiffness = "500 N m/rad" }}
about-y = {{ at = "centre", direction = "ry", stiffness = "500 N m/rad" }}
about-z = {{ at = "centre", direction = "rz", stiffness = "500 N m/rad" }}
[run]
speed = "60 rpm"
revolutions = 0.01
"""
FREE_ROTATIONS = '["ux", "uy", "uz"]'


def tilted_bar_case(tmp_path, angle, held=FREE_ROTATIONS, factor=1.0):
    """Return the case of a bar with the moment THIN about its own axis."""
    s, c, more = math.sin(angle), math.cos(angle), MOMENT - THIN
    moments = [THIN + more * s * s, THIN + more * c * c, MOMENT]
    path = tmp_path / "bar.toml"
    path.write_text(
        CASE.format(held=held, moments=moments, products=[factor * more * s * c, 0.0, 0.0]), encoding="utf-8"
    )
    return read_case(path)


def natural_frequencies(case, count):
    return model_modes(build_structure(build_model(case)), count).modes.frequencies


@pytest.mark.parametrize("degrees", [0.0, 30.0, 75.0])
def test_frequencies_of_tilted_bar(record, tmp_path, degrees):
    found = natural_frequencies(tilted_bar_case(tmp_path, math.radians(degrees)), 3)
    expected = np.sqrt(STIFFNESS / np.array([MOMENT, MOMENT, THIN])) / (2.0 * math.pi)
    for i in (0, 2):
        record(source=SOURCE, case=f"bar tilted by {degrees:g} deg", quantity=f"frequency {i + 1}", unit="Hz",
               reference=expected[i], computed=found[i], tolerance=1e-12, reason="rounding")  # fmt: skip
    assert found[1] == pytest.approx(expected[1], rel=1e-12)


def test_frequency_of_guided_bar(record, tmp_path):
    found = natural_frequencies(tilted_bar_case(tmp_path, 0.5, '["ux", "uy", "uz", "ry", "rz"]'), 1)
    moment = THIN + (MOMENT - THIN) * math.sin(0.5) ** 2
    record(source=SOURCE, case="tilted bar guided about x", quantity="frequency", unit="Hz",
           reference=math.sqrt(STIFFNESS / moment) / (2.0 * math.pi), computed=found[0], tolerance=1e-12,
           reason="rounding")  # fmt: skip


def test_impossible_products_of_inertia_raise_error(tmp_path):
    with pytest.raises(InputError, match="principal moment"):
        build_model(tilted_bar_case(tmp_path, 0.5, factor=1.5))
