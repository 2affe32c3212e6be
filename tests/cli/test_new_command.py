"""Starter cases: list, comments of keys, check and run, and no overwriting of existing files."""

import re
import tomllib
from importlib.resources import files

import pytest

from flexcam.case.starters import templates
from tests.thinning import slow_if

NAMES = sorted(templates())
KEY = re.compile(r"^[A-Za-z_][\w-]* = ")


def test_new_lists_all_starters(flexcam):
    wanted = {
        "published-model", "pushrod-engine", "direct-acting", "exhaust-valve", "finger-follower", "lumped-train",
        "measured-lift", "dohc-16-valve", "v8-bank", "packaging-cam", "desmodromic", "roller-tappet", "valve-bridge",
        "gear-drive", "cam-phaser", "solid-rocker",
    }  # fmt: skip
    assert set(NAMES) == wanted
    assert flexcam("new", "--json").json["templates"] == templates()
    for words in (("new",), ("new", "--list")):
        output = flexcam(*words).out
        assert all(name in output for name in wanted)
    assert "--list alone" in flexcam("new", "v8-bank", "--list").err


@pytest.mark.parametrize("name", NAMES)
def test_every_key_of_starter_has_comment(name):
    text = (files("flexcam") / "templates" / f"{name}.toml").read_text(encoding="utf-8")
    bare = [line for line in text.splitlines() if KEY.match(line) and " # " not in line]
    assert not bare
    assert text.startswith("# ")
    assert tomllib.loads(text)["title"]


QUICK = ("published-model", "desmodromic")
"""`tests/errors/test_input_warnings.py` also checks the others."""


@pytest.mark.parametrize("name", slow_if(lambda name: name not in QUICK, NAMES))
def test_starter_passes_check_and_run(name, flexcam):
    """The first case of a beginner must not begin with a warning."""
    created = flexcam("new", name, "-o", "cases/mine.toml", "--json").json
    assert created["files"][0] == "cases/mine.toml"
    checked = flexcam("check", "cases/mine.toml", "--json")
    assert checked.code == 0
    assert checked.json["warnings"] == []
    oil = name in ("finger-follower", "v8-bank", "roller-tappet")  # the revolutions of the starter, up to steady state
    short = () if oil else ("--set", f"run.revolutions={0.02 if name == 'dohc-16-valve' else 0.6}")
    run = flexcam("run", "cases/mine.toml", "--json", *short)
    assert run.code == 0
    assert run.json["status"] == "done"
    assert run.json["warnings"] == []


def test_check_shows_loads_and_friction(flexcam):
    flexcam("new", "exhaust-valve", "-o", "mine.toml")
    shown = " ".join(flexcam("check", "mine.toml").out.split())
    assert "friction guide 5 N at stem-top" in shown
    assert "load gas -18.45 to 3382 N at head along (0, 1, 0), table every 360 deg of cam angle" in shown


def test_measured_lift_starter_includes_table(flexcam, tmp_path):
    created = flexcam("new", "measured-lift", "-o", "mine.toml", "--json").json
    assert created["files"] == ["mine.toml", "measured-lift.csv"]
    assert (tmp_path / "measured-lift.csv").read_text(encoding="utf-8").startswith("crank_deg, lift_mm")


def test_superelement_starter_includes_matrices(flexcam):
    created = flexcam("new", "solid-rocker", "-o", "mine.toml", "--json").json
    assert created["files"] == ["mine.toml", "rocker-stiffness.mtx", "rocker-mass.mtx"]


def test_new_does_not_overwrite_files(flexcam, tmp_path):
    (tmp_path / "measured-lift.csv").write_text("mine")
    refused = flexcam("new", "measured-lift")
    assert refused.code == 2
    assert "measured-lift.csv" in refused.err
    assert "Use --overwrite, or give another output name" in refused.err
    assert not (tmp_path / "measured-lift.toml").exists()
    assert (tmp_path / "measured-lift.csv").read_text() == "mine"
    assert flexcam("new", "measured-lift", "--overwrite").code == 0


def test_misspelled_starter_is_refused_with_suggestion(flexcam):
    refused = flexcam("new", "pushrod-engin")
    assert refused.code == 2
    assert "Did you mean 'pushrod-engine'" in refused.err


def test_case_name_without_toml_suffix_is_refused(flexcam, tmp_path):
    assert flexcam("new", "pushrod-engine", "-o", "mine").code == 2
    assert not list(tmp_path.iterdir())
