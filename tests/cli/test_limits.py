"""The command limits: speeds of contact loss, bounce, coil clash and buckling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case, solve
from flexcam.analysis.limits import Search, search_limits
from flexcam.valvetrain import separation_by_flank

TESTS = Path(__file__).resolve().parents[1]
CASE = TESTS.parent / "cases/pushrod-engine/intake.toml"
ONE_MASS = (TESTS / "data/limits/one-mass.toml").read_text(encoding="utf-8")
QUICK = ("--set", "run.steps_per_revolution=360")

pytestmark = pytest.mark.usefixtures("machine_code")


def test_limits_as_json(flexcam):
    told = ("--lowest", "3000rpm", "--highest", "3050rpm", "--accuracy", "2500rpm", *QUICK)
    answer = flexcam("limits", CASE, *told, "--json").json
    assert {"loss_of_contact_rpm", "bounce_rpm", "buckling_rpm", "spring_margin"} <= set(answer)
    assert (answer["shaft"], answer["first"]) == ("crank", None)
    assert answer["buckling_margins"]["pushrod"] > 1.0


def test_limits_name_every_limit_and_the_rigid_speed(flexcam, tmp_path):
    """Without seat, coils and members nothing of these is met; a stiff train parts where inertia meets its spring."""
    case = tmp_path / "one.toml"
    case.write_text(ONE_MASS, encoding="utf-8")
    answer = flexcam("limits", case, "--lowest", "3000rpm", "--highest", "5000rpm", "--json").json
    assert answer["first"] == "loss_of_contact"
    assert [answer[f"{name}_rpm"] for name in ("bounce", "coil_clash", "buckling")] == [None] * 3
    z = np.linspace(0.0, 1.0, 20001)
    rise = np.radians(63.0)
    lift, bend = 6e-3 * (z - np.sin(2 * np.pi * z) / (2 * np.pi)), 6e-3 / rise**2 * 2 * np.pi * np.sin(2 * np.pi * z)
    falls = bend < 0.0
    rigid = np.sqrt(((300.0 + 40e3 * lift[falls]) / (0.1 * -bend[falls])).min()) * 30.0 / np.pi
    assert answer["rigid_loss_of_contact_rpm"] == pytest.approx(rigid, rel=1e-5)
    assert answer["loss_of_contact_rpm"] == pytest.approx(rigid, rel=0.06)  # it swings a little on its contact


def test_limits_do_not_depend_on_the_range(flexcam, tmp_path):
    """Nor on the revolution in which contact is lost; what is lost is lost over the nose, and remains so."""
    case = tmp_path / "one.toml"
    case.write_text(ONE_MASS, encoding="utf-8")
    one, other = (
        flexcam("limits", case, "--lowest", low, "--highest", high, "--json").json
        for low, high in (("3000rpm", "5000rpm"), ("3170rpm", "4400rpm"))
    )
    for name in ("loss_of_contact", "float"):
        assert one[f"{name}_rpm"] == other[f"{name}_rpm"] == one[f"{name}_lasting_rpm"]
    assert one["loss_of_contact_rpm"] == one["float_rpm"]
    said = " ".join(flexcam("limits", case, "--lowest", "3170rpm", "--highest", "4400rpm").out.split())
    assert "the follower leaves its cam for over 0.5 deg above 0.3 mm of lift (k, nose)" in said


@pytest.mark.parametrize(
    ("part", "begin", "end"), [("opening flank", 50, 60), ("nose", 90, 100), ("closing flank", 145, 155)]
)
def test_contact_loss_is_told_apart_by_flanks(tmp_path, part, begin, end):
    """The cycloidal rise from 34 to 97 deg and the return to 172 deg have their maximum velocities at half."""
    (tmp_path / "one.toml").write_text(ONE_MASS, encoding="utf-8")
    ready = prepare(read_case(tmp_path / "one.toml", ["run.steps_per_revolution=3600", "run.revolutions=1"]))
    response = solve(ready.problem, ready.scheme)
    force = response.channels["contacts.k.force"]
    force[:] = 1.0
    force[(np.degrees(response.angle) > begin) & (np.degrees(response.angle) <= end)] = 0.0
    lost = separation_by_flank(ready.model, response, "k", np.ones(len(force), dtype=bool))
    assert {name for name, angle in lost.items() if angle} == {part}
    assert lost[part] == pytest.approx(np.radians(10.0), rel=0.02)  # a step at an end


@pytest.mark.parametrize(("lift", "told"), [("6 mm", "0.1 mm"), ("0.2 mm", "0.004 mm")])
def test_a_small_valve_bounces_from_less(lift, told, tmp_path):
    """From 0.1 mm, or from 2 % of a small lift."""
    seat = 'seat = { at = "mass", direction = "-uz", model = "seat", stiffness = "50 MN/m" }\n[run]'
    text = ONE_MASS.replace('lift = "6 mm"', f'lift = "{lift}"').replace("[run]", seat)
    (tmp_path / "one.toml").write_text(text, encoding="utf-8")
    search = Search(100.0, 101.0, tolerance=10.0, spacing=1.0)
    found = search_limits(read_case(tmp_path / "one.toml", QUICK[1:2]), search, among=("bounce",))
    assert found["bounce"].words.startswith(f"the valve leaves its seat again by more than {told}")
