"""Every speed in rpm says of which shaft, and a case given for the crankshaft sees that first."""

import re
from pathlib import Path

import pytest

from flexcam import read_case, read_result

NAMED = re.compile(r"(crankshaft|camshaft) [\d.e+]+ rpm|(crank|camshaft) (speed, )?rpm")
SHORT = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=1")


@pytest.fixture
def cranked(case):
    """Let the case give the speed of its crankshaft: 6000 rpm."""
    text = case.read_text(encoding="utf-8")
    assert text.count("\nspeed = ") == 1
    case.write_text(re.sub(r'\nspeed = ".*?"', '\ncrank_speed = "6000 rpm"', text), encoding="utf-8")
    return case


def unnamed(told):
    """Return the lines that tell rpm of no shaft."""
    return [line for line in told.splitlines() if "rpm" in NAMED.sub("", line)]


@pytest.mark.parametrize("command", ["check", "run", "stability", "compare", "modes"])
def test_commands(command, flexcam, cranked):
    told = " ".join(flexcam(command, cranked, *SHORT).out.split("\n\n")[0].split())
    assert unnamed(told) == []
    if command != "modes":
        assert "crankshaft 6000 rpm (camshaft 3000 rpm)" in told


@pytest.mark.slow
def test_the_report(flexcam, cranked):
    flexcam("run", cranked, *SHORT)
    flexcam("report", "results/case.vtkhdf", "-o", "page.html")
    assert read_result("results/case.vtkhdf").response.status.ok
    page = Path("page.html").read_text(encoding="utf-8")
    assert "crankshaft 6000 rpm (camshaft 3000 rpm)" in page
    text = re.sub(r"<(script|style|pre)\b.*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL)
    assert unnamed("\n".join(re.findall(r".{0,40}rpm", text))) == []


def test_another_speed_counts_the_same_shaft(cranked):
    """So do messages about it."""
    other = read_case(cranked).at_speed(100.0)
    assert other.turns == 2.0
    assert other.speed == 100.0
