"""README commands and Python lines run and print the output that the README shows.

A new user copies the commands from top to bottom, so they run in this order in one folder with the cases. Commands
that take many seconds run there with fewer steps or variants, and unchanged in the slow test.
"""

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
"""Additional options that shorten slow commands."""

LONG = ("limits", "selftest")
"""Slow commands without an option that shortens them: only the slow test, which CI runs, executes them."""


@pytest.fixture
def clone(tmp_path, flexcam):
    """Return the command in a folder with the cases and meshes, as in a fresh clone."""
    for name in ("cases", "meshes"):
        shutil.copytree(ROOT / name, tmp_path / name)
    return flexcam


def test_every_shell_line_is_parsed():
    assert len(COMMANDS) > 15
    assert len(COMMANDS) + len(TARGETS) == len([line for line in SHELL if line.strip()])


@pytest.mark.slow  # CI runs the slow tests of this file
def test_commands_run_in_order(clone):
    """The first command prints the output that the README shows."""
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
def test_unchanged_slow_command(clone, words):
    done = clone(*words)
    assert done.code == 0, done.err


@pytest.mark.usefixtures("clone")
def test_python_lines(capsys):
    (block,) = [block for kind, block in FENCES if kind == "python"]
    exec(block, {})  # noqa: S102 - what users copy
    assert float(capsys.readouterr().out) == pytest.approx(0.02149, abs=5e-6)


def test_readme_speed_claims_match_measurements():
    measured = json.loads((ROOT / "docs/performance-peers.json").read_text(encoding="utf-8"))["solvers"]
    took = {solver["title"].partition(" (")[0]: solver.get("us_per_step") for solver in measured}
    words = " ".join(README.split())
    assert "flexcam's two solvers in modal coordinates are the fastest and Exudyn's tuned solver is third" in words
    assert "flexcam's direct solver takes 1.2 times as long as the scipy loop" in words
    others = {title: time for title, time in took.items() if time and not title.startswith("flexcam")}
    assert max(took["flexcam"], took["flexcam, kernel solver"]) < min(others.values()) == others["Exudyn, tuned"]
    assert round(took["flexcam, direct solver"] / others["scipy `splu`, Python loop"], 1) == 1.2


def test_readme_contact_claims_match_measurements():
    spec = importlib.util.spec_from_file_location("make_performance", ROOT / "docs/make_performance.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    methods = maker.group_methods(maker.read(maker.PEERS)["train"])
    took = {method: maker.time_at(settings, 1e-3) for method, settings in methods.items()}
    own = took["flexcam, `collocation`"]
    words = " ".join(README.split())
    assert "accurate to 0.1 % in this benchmark, diffrax needs less time than flexcam. CVODES takes the same" in words
    assert "time as flexcam or up to 40 % more; Exudyn, MuJoCo and scipy take longer." in words
    for method, time in took.items():
        if method.startswith("diffrax"):
            assert time < own
        elif method.startswith("CVODES"):
            assert 0.95 * own < time < 1.45 * own
        elif not method.startswith("flexcam"):
            assert time > 1.4 * own


def test_make_targets_exist():
    known = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    assert {"demo", "test"} == set(TARGETS) <= known
