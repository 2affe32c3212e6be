"""README keeps its word: every command and line of Python in it runs, and prints what it shows.

A newcomer copies the commands from above to below, so they run in that order in one folder that has the cases. Commands
that take many seconds run there with fewer steps or variants, and as they stand in the slow test.
"""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
FENCES = re.findall(r"^```(\w*)\n(.*?)^```", README, re.S | re.M)
SHELL = [line for kind, block in FENCES if kind == "sh" for line in block.splitlines()]
COMMANDS = [shlex.split(line, comments=True)[1:] for line in SHELL if line.startswith("flexcam ")]
TARGETS = [shlex.split(line, comments=True)[1] for line in SHELL if line.startswith("make ")]

FEWER = {
    "run": ("--set", "run.steps_per_revolution=720", "--set", "run.revolutions=1"),
    "trade": ("--set", "run.steps_per_revolution=60", "--repeats", "1"),
    "campbell": ("--count", "2"),
    "sweep": ("--set", "run.speed=1000,2000rpm", "--workers", "0"),
    "stability": ("--set", "run.steps_per_revolution=180"),
}
"""What a command that takes long gets besides its own words, to take less."""

LONG = ("limits", "selftest")
"""Commands that nothing shortens: the slow test runs them, and CI runs that."""


@pytest.fixture
def clone(tmp_path, flexcam):
    """Return the command, in a folder with the cases, as a fresh clone has them."""
    for name in ("cases", "meshes"):
        shutil.copytree(ROOT / name, tmp_path / name)
    return flexcam


def test_every_line_of_shell_is_looked_at():
    assert len(COMMANDS) > 15
    assert len(COMMANDS) + len(TARGETS) == len([line for line in SHELL if line.strip()])


@pytest.mark.slow  # CI runs the slow tests of this file
def test_commands_from_above_to_below(clone):
    """And the first of them prints what README shows."""
    printed = []
    for words in (words for words in COMMANDS if words[0] not in LONG):
        done = clone(*words, *FEWER.get(words[0], ()))
        assert done.code == 0, f"{' '.join(words)}: {done.err}"
        printed.append([line.rstrip() for line in done.out.splitlines()])
    (shown,) = [block.splitlines() for kind, block in FENCES if not kind]
    assert COMMANDS[0][0] not in FEWER
    assert printed[0][: len(shown)] == shown


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [words for words in COMMANDS if words[0] in (*FEWER, *LONG)], ids=lambda words: words[0]
)
def test_command_as_it_stands(clone, words):
    done = clone(*words)
    assert done.code == 0, done.err


@pytest.mark.usefixtures("clone")
def test_lines_of_python(capsys):
    (block,) = [block for kind, block in FENCES if kind == "python"]
    exec(block, {})  # noqa: S102 - what users copy
    assert float(capsys.readouterr().out) == pytest.approx(0.02149, abs=5e-6)


def test_what_is_said_of_speed_is_what_was_measured():
    measured = json.loads((ROOT / "docs/performance-peers.json").read_text(encoding="utf-8"))["solvers"]
    took = {one["title"].partition(" (")[0]: one.get("us_per_step") for one in measured}
    words = " ".join(README.split())
    assert "flexcam's two solvers in modal coordinates are the fastest and Exudyn's tuned solver is third" in words
    assert "flexcam's direct solver takes about as long as the scipy loop" in words
    others = {title: one for title, one in took.items() if one and not title.startswith("flexcam")}
    assert max(took["flexcam"], took["flexcam, kernel solver"]) < min(others.values()) == others["Exudyn, tuned"]
    assert took["flexcam, direct solver"] == pytest.approx(others["scipy `splu`, Python loop"], rel=0.2)


def test_what_is_said_of_contact_is_what_was_measured():
    spec = importlib.util.spec_from_file_location("make_performance", ROOT / "docs/make_performance.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    methods = maker.group_methods(maker.read(maker.PEERS)["train"])
    took = {method: maker.time_at(settings, 1e-3) for method, settings in methods.items()}
    own = took["flexcam, `collocation`"]
    words = " ".join(README.split())
    assert (
        "To compute its cam force to 0.1 %, only diffrax needs less time than flexcam. CVODES takes 1.0 to 1.4" in words
    )
    assert "times as long as flexcam; Exudyn, MuJoCo and scipy take longer." in words
    for method, time in took.items():
        if method.startswith("diffrax"):
            assert time < own
        elif method.startswith("CVODES"):
            assert 0.95 * own < time < 1.45 * own
        elif not method.startswith("flexcam"):
            assert time > 1.4 * own


def test_targets_stand_in_the_makefile():
    known = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    assert {"demo", "test"} == set(TARGETS) <= known
