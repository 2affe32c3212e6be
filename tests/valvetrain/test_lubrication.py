"""Channels of a lubricated contact: values from force and cam angle, and invalid input."""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run
from flexcam.analysis.run_metrics import compute_metrics

DATA = Path(__file__).parents[1] / "data/every-contact.toml"
FINGER = Path(__file__).parents[2] / "cases/direct-acting/finger.toml"
OIL = 'viscosity="10 mPa s",pressure_viscosity="15 1/GPa"'
THERMAL = 'conductivity="46 W/m/K",specific_heat="470 J/kg/K"'
WEAR = 'wear_coefficient="2e-18 m^2/N"'
FRICTION = "contacts.intake.friction=0.1"


def lubrication_override(*keys):
    return f"contacts.intake.lubrication={{{','.join([OIL, *keys])}}}"


@pytest.fixture(scope="module", params=["beams", "rigid"])
def flat_follower_run(request):
    """Return the prepared case of a flat follower and its response over a lift."""
    model = f"fidelity.model={request.param}"
    engine = ["run.engine=kernel"] * (request.param == "beams")
    case = read_case(DATA, [FRICTION, model, *engine, lubrication_override('roughness="0.4 um"', THERMAL, WEAR)])
    ready = prepare(case)
    return ready, run(case)


def test_film_follows_from_force_and_curvature(flat_follower_run):
    """Independent formulas for a translating flat face; lambda is the film thickness over the roughness."""
    ready, response = flat_follower_run
    event, speed = ready.model.cams["intake"].event, ready.case.speed
    s, bend = event(response.angle), event(response.angle, 2)
    velocity = -0.5 * speed * (0.028 + s + 2.0 * bend)
    seen = {name.rpartition(".")[2]: one for name, one in response.channels.items() if name.startswith("contacts.in")}
    np.testing.assert_allclose(seen["entrainment"], velocity, rtol=1e-9, atol=1e-12)
    radius, modulus = 0.028 + s + bend, 207e9 / (1.0 - 0.29**2)
    load = np.maximum(seen["force"], 0.0) / 0.012
    U, W = 0.01 * np.abs(velocity) / (modulus * radius), np.maximum(load / (modulus * radius), 1e-6)
    for name, (factor, u, g, w) in {"film": (2.65, 0.7, 0.54, 0.13), "central_film": (3.06, 0.69, 0.56, 0.1)}.items():
        expected = factor * U**u * (15e-9 * modulus) ** g * W**-w * radius
        np.testing.assert_allclose(seen[name], expected, rtol=1e-3)  # the radius is interpolated from a table
    np.testing.assert_allclose(seen["lambda"], seen["film"] / 0.4e-6, rtol=1e-12)


def test_flash_temperature_and_wear_follow_from_friction(flat_follower_run):
    ready, response = flat_follower_run
    event, speed = ready.model.cams["intake"].event, ready.case.speed
    s, bend = event(response.angle), event(response.angle, 2)
    seen = {name.rpartition(".")[2]: one for name, one in response.channels.items() if name.startswith("contacts.in")}
    radius, load = 0.028 + s + bend, np.maximum(seen["force"], 0.0) / 0.012
    width = np.sqrt(8.0 * load * radius * (1.0 - 0.29**2) / (math.pi * 207e9))
    heat = np.abs(seen["friction"] * speed * (0.028 + s)) / 0.012
    both = np.sqrt(speed * radius) + np.sqrt(speed * np.abs(bend))
    expected = 0.786 * heat / (math.sqrt(46.0 * 7800.0 * 470.0) * np.sqrt(np.maximum(width, 1e-12)) * both)
    np.testing.assert_allclose(seen["flash_temperature"], expected, rtol=1e-3)
    assert seen["flash_temperature"].max() > 1.0
    np.testing.assert_allclose(seen["wear"], 1e6 * 2e-18 * load * (0.028 + s) / radius, rtol=1e-9)


def test_lubrication_metrics(flat_follower_run):
    """The film metric is that at full lift; the film is zero where the entrainment velocity changes sign."""
    ready, response = flat_follower_run
    found = {one.name: one.value for one in compute_metrics(ready, response)}
    top = int(np.argmax(ready.model.cams["intake"].event(response.angle)))
    for name in ("film", "lambda"):
        assert found[f"contacts.intake.{name}.nose"] == response.channels[f"contacts.intake.{name}"][top]
    for name in ("flash_temperature", "wear"):
        assert found[f"contacts.intake.{name}.largest"] == response.channels[f"contacts.intake.{name}"].max()


def test_run_ending_before_nose_has_no_nose_metrics():
    case = read_case(DATA, [lubrication_override(), "run.revolutions=0.1"])
    names = [one.name for one in compute_metrics(prepare(case), run(case))]
    assert "contacts.intake.force.largest" in names
    assert not [name for name in names if name.endswith("nose")]


def test_optional_channels_need_their_keys():
    short = ["run.revolutions=0.01"]
    plain, oiled = (run(read_case(DATA, [*short, *more])).channels for more in ([], [lubrication_override()]))
    assert set(oiled) - set(plain) == {f"contacts.intake.{one}" for one in ("entrainment", "film", "central_film")}
    for name, values in plain.items():
        np.testing.assert_array_equal(values, oiled[name])


def test_entrainment_of_roller():
    response = run(read_case(FINGER, [lubrication_override(), "run.revolutions=0.05"]))
    assert response.status.ok
    assert (np.abs(response.channels["contacts.intake.entrainment"]) > 0.0).all()
    assert "contacts.intake.sliding" not in response.channels


INVALID_KEYS = {
    "one of two thermal properties": (
        [FRICTION, lubrication_override('conductivity="46 W/m/K"')],
        "lubrication",
        "conductivity",
    ),
    "flash temperature without friction": ([lubrication_override(THERMAL)], "lubrication.conductivity", "friction"),
    "viscosity without unit": ([lubrication_override().replace("10 mPa s", "10")], "viscosity", "10 mPa s"),
    "a coefficient in 1/GPa as SI": (
        [lubrication_override().replace('"15 1/GPa"', "15")],
        "pressure_viscosity",
        "Check the unit",
    ),
    "bilateral": ([lubrication_override().replace("intake", "other", 1)], "contacts.other", "lubrication"),
}


@pytest.mark.parametrize("fault", INVALID_KEYS)
def test_invalid_lubrication_raises_error(fault):
    overrides, where, expected = INVALID_KEYS[fault]
    with pytest.raises(InputError) as refusal:
        prepare(read_case(DATA, overrides))
    text = str(refusal.value)
    assert where in text
    assert expected in text


def test_lubrication_without_width_or_profile_raises_error(tmp_path):
    text = DATA.read_text(encoding="utf-8").replace('stiffness = "hertz"', 'stiffness = "100 MN/m"')
    path = tmp_path / "case.toml"
    for key in ('width = "12 mm"\n', 'base_radius = "28 mm"\nwidth = "12 mm"\nfollower = { type = "flat" }\n'):
        assert key in text
        path.write_text(text.replace(key, ""), encoding="utf-8")
        with pytest.raises(InputError, match=r"contacts\.intake\.lubrication.*follower and width.*leave lubrication"):
            prepare(read_case(path, [lubrication_override()]))


def test_wear_coefficient_of_roller_raises_error():
    with pytest.raises(InputError, match=r"contacts\.intake\.lubrication\.wear_coefficient.*roller"):
        prepare(read_case(FINGER, [lubrication_override(WEAR)]))


def test_model_contains_lubrication():
    contact = build_model(read_case(DATA, [lubrication_override(WEAR)])).contacts["intake"]
    assert contact.lubrication.viscosity == 0.01
    assert contact.lubrication.wear_coefficient == 2e-18
