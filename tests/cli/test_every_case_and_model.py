"""Every case of the repository with every model: each command gives a result or a refusal, never an internal error.

Exit code 0 is a result, 2 a refusal with its reason (a chain for a train with one node), 3 a run that ended early.
"""

import json
from itertools import product
from pathlib import Path

import pytest

from tests.thinning import mostly_slow

ROOT = Path(__file__).resolve().parents[2]
CASES = sorted(path for path in (ROOT / "cases").glob("*/*.toml") if path.parent.name != "cams")
SIMILAR_CASES = [case for case in CASES if case.parent.name == "tayeb" and case.stem != "model-3-shm"]
"""Published models that are part of another model or have another lift law; `test_cases` runs them."""
QUICK = ("--set", "run.steps_per_revolution=180", "--set", "run.revolutions=0.25")
MODELS = ("model=beams", "model=rigid", "model=sdof", "model=chain", "modes=4")
FEW = [case for case in CASES if case.stem in ("intake", "mathieu")]


def parse_strict_json(text):
    def refuse(word):
        raise AssertionError(word)

    return json.loads(text, parse_constant=refuse)


def mark_slow(case):
    return pytest.param(case, marks=() if case in FEW else pytest.mark.slow)


@pytest.mark.parametrize("asked", mostly_slow(MODELS[1:], 2))
@pytest.mark.parametrize(
    "case", [mark_slow(case) for case in CASES if case not in SIMILAR_CASES], ids=lambda path: path.stem
)
def test_run_gives_result_or_refusal(flexcam, tmp_path, case, asked):
    done = flexcam("run", case, *QUICK, "--set", f"fidelity.{asked}", "-o", str(tmp_path), "--json")
    assert done.code in (0, 2, 3), done.err
    report = parse_strict_json(done.out)
    assert done.code != 2 or report["errors"]
    if done.code == 2:
        assert asked in ("model=sdof", "model=chain"), report


@pytest.mark.parametrize(
    ("command", "asked"),
    mostly_slow(product(["check", "modes", "stability"], ["model=rigid", "model=sdof", "model=beams"]), 2),
)
@pytest.mark.parametrize("case", FEW, ids=lambda path: path.stem)
def test_commands_give_result_or_refusal(flexcam, case, command, asked):
    done = flexcam(command, case, *QUICK, "--set", f"fidelity.{asked}", "--json")
    assert done.code in (0, 2, 3), done.err
    parse_strict_json(done.out)
