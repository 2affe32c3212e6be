"""Topology of trains: lash, moved nodes, ratios and opposed contacts of each cam."""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case, run
from flexcam.case.builder import build_model
from flexcam.case.starters import new_case
from flexcam.valvetrain import (
    build_chain,
    largest_lashes,
    main_lift,
    opposed_contacts,
    spring_held_contacts,
    train_metric_names,
    valve_ratio,
)
from flexcam.valvetrain.rigid_kinematics import moved_nodes

ROOT = Path(__file__).parents[2]
TWO_CAMS = """
format = 1
[nodes]
shaft = [0, 0, 0]
tappet = [0, 0.02, 0]
tip = [0, 0.05, 0]
other = [0, 0.02, 0.04]
[supports]
tappet = ["ux", "uz"]
tip = ["ux", "uz"]
other = ["ux", "uz"]
[masses]
tappet = { at = "tappet", mass = "0.1 kg" }
tip = { at = "tip", mass = "0.1 kg" }
other = { at = "other", mass = "0.1 kg" }
[springs]
light = { at = "tappet", direction = "uy", stiffness = "1 kN/m", installed_force = "10 N" }
valve = { at = "tip", direction = "uy", stiffness = "20 kN/m", installed_force = "200 N" }
straight = { at = "other", direction = "uy", stiffness = "20 kN/m", installed_force = "200 N" }
[cams]
one = { at = "shaft", axis = [0, 0, 1], law = "4-5-6-7", lift = "6 mm", rise = "80 deg", return = "80 deg" }
two = { at = "shaft", axis = [0, 0, 1], law = "4-5-6-7", lift = "6 mm", rise = "80 deg", return = "80 deg" }
[contacts]
first = { cam = "one", follower = "tappet", direction = "uy", model = "unilateral", stiffness = "20 MN/m" }
second = { cam = "two", follower = "other", direction = "uy", model = "unilateral", stiffness = "20 MN/m" }
play = { from = "tappet", to = "tip", direction = "uy", model = "lash", gap = "0.3 mm", stiffness = "20 MN/m" }
[run]
speed = "600 rpm"
revolutions = 0.1
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO_CAMS, encoding="utf-8")
    return prepare(read_case(path)).model


def test_lash_belongs_to_its_train(model):
    assert largest_lashes(model)["one"] == pytest.approx(0.3e-3)
    assert largest_lashes(model)["two"] == 0.0
    assert main_lift(model, "one") == pytest.approx(0.05 * 6e-3 + 0.3e-3)
    assert main_lift(model, "two") == pytest.approx(0.05 * 6e-3)


def test_follower_moves_nodes_behind_lash(model):
    names = {
        name: [model.mesh.node_name(node) for node in moved_nodes(model, model.cam_contacts[name])]
        for name in ("first", "second")
    }
    assert names == {"first": ["tappet", "tip"], "second": ["other"]}


NEAR = 'near = { from = "tappet", to = "tip", direction = "uy", model = "lash", gap = "0.3 mm", stiffness = "20 MN/m" }'
FAR = 'far = { from = "tip", to = "other", direction = "uy", model = "lash", gap = "0.2 mm", stiffness = "20 MN/m" }'


@pytest.fixture(params=[(NEAR, FAR), (FAR, NEAR)], ids=["near first", "far first"])
def lashes_in_series(request, tmp_path):
    """Return the case of a train with two lashes in series, in either order."""
    path = tmp_path / "series.toml"
    lines = [one for one in TWO_CAMS.splitlines() if not one.startswith(("play", "second", "two"))]
    text = "\n".join(lines).replace("[run]", "\n".join([*request.param, "[run]"]))
    text = text.replace('"600 rpm"', '"60 rpm"') + '\n[output]\nprobes = ["tappet", "tip", "other"]\n'
    path.write_text(text, encoding="utf-8")
    return read_case(path)


def test_moved_nodes_behind_lashes_in_series(lashes_in_series):
    model = prepare(lashes_in_series).model
    reached = [model.mesh.node_name(node) for node in moved_nodes(model, model.cam_contacts["first"])]
    assert reached == ["tappet", "tip", "other"]
    found = build_chain(model, 60.0, 3)
    assert found.points == ("tappet", "tip", "other")
    np.testing.assert_allclose(found.masses, 0.1, rtol=1e-9)


SEATS = [f"contacts.{one}-seat={{ at = '{one}', direction = 'uy', model = 'seat', stiffness = '1 GN/m' }}"
         for one in ("tip", "other")]  # fmt: skip


@pytest.mark.parametrize("seats", [SEATS, []], ids=["seats", "no seats"])
def test_lashes_in_series_add_up(lashes_in_series, seats):
    """With seats, the last body lags by both lashes; without seats its spring closes them before the lift starts.

    In both cases the cam carries all three spring forces at the nose.
    """
    model = prepare(lashes_in_series).model
    assert largest_lashes(model)["one"] == pytest.approx(0.5e-3)
    more = ["run.revolutions=1", "run.steps_per_revolution=360", *seats]
    response = run(read_case(lashes_in_series.path, more), rigid=True)
    lifts = [response[f"{name}.uy"].displacement for name in ("tappet", "tip", "other")]
    for lift, gap in zip(lifts, (0.0, 0.3e-3, 0.5e-3), strict=True):
        np.testing.assert_allclose(lift, np.maximum(lifts[0] - gap, 0.0 if seats else -gap), atol=1e-12)
    at = int(np.argmax(lifts[0]))
    springs = 10.0 + 1e3 * 6e-3 + 200.0 + 20e3 * 5.7e-3 + 200.0 + 20e3 * 5.5e-3
    inertia = (
        0.3 * 7.52 * 6e-3 * (2.0 * math.pi / math.radians(80.0)) ** 2
    )  # the maximum acceleration of the law is 7.51
    assert abs(response.channels["contacts.first.force"][at] - springs) <= inertia


def test_valve_ratio_behind_adjuster(tmp_path):
    """A hydraulic element between two nodes drives the rocker."""
    model = build_model(read_case(new_case("roller-tappet", tmp_path / "case.toml")[0]))
    assert valve_ratio(model, "intake") == pytest.approx(40.0 / 25.0, rel=1e-12)


def test_opposed_contacts_of_desmodromic_train(tmp_path):
    """No spring loads the followers of a desmodromic pair, so that contact loss is not a result of the train."""
    model = build_model(read_case(new_case("desmodromic", tmp_path / "case.toml")[0]))
    assert opposed_contacts(model) == {"opening": "closing", "closing": "opening"}
    assert spring_held_contacts(model) == []
    assert not [name for name in train_metric_names(model, []) if "open_on_the_lift" in name]


@pytest.mark.parametrize(
    ("case", "ratio", "lash"),
    [
        ("cases/calculix-rocker/rocker.toml", 40.0 / 25.0, 0.15e-3 / 1.6),
        ("flexcam/templates/valve-bridge.toml", 42.0 / 30.0, 0.3e-3 / 1.4),
        ("cases/pushrod-engine/lever.toml", 40.0 / 25.0, 0.2e-3 / 1.6),
    ],
)
def test_valve_ratio_and_lash_of_rocker_models(case, ratio, lash):
    """A superelement, rigid bodies and a lever: ratio of the arms, and valve lash reduced to the cam."""
    model = build_model(read_case(ROOT / case))
    assert valve_ratio(model, "intake") == pytest.approx(ratio, rel=1e-9)
    assert largest_lashes(model)["intake"] == pytest.approx(lash, rel=1e-9)
