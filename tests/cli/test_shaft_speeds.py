"""Every speed in rpm is printed with the name of its shaft; a crank speed in the case is printed first."""

import re
from pathlib import Path

import pytest

from flexcam import read_case, read_result

NAMED_SPEED = re.compile(r"(crankshaft|camshaft) [\d.e+]+ rpm|(crank|camshaft) (speed, )?rpm")
SHORT = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=1")


@pytest.fixture
def crank_speed_case(case):
    """Specify the speed of the crankshaft in the case: 6000 rpm."""
    text = case.read_text(encoding="utf-8")
    assert text.count("\nspeed = ") == 1
    case.write_text(re.sub(r'\nspeed = ".*?"', '\ncrank_speed = "6000 rpm"', text), encoding="utf-8")
    return case


def speeds_without_shaft(text):
    """Return the lines that print a speed in rpm without a shaft."""
    return [line for line in text.splitlines() if "rpm" in NAMED_SPEED.sub("", line)]


@pytest.mark.parametrize(
    "command",
    [
        "check",
        pytest.param("run", marks=pytest.mark.slow),
        pytest.param("stability", marks=pytest.mark.slow),
        "compare",
        "modes",
    ],
)
def test_commands_name_shaft_of_speed(command, flexcam, crank_speed_case):
    output = " ".join(flexcam(command, crank_speed_case, *SHORT).out.split("\n\n")[0].split())
    assert speeds_without_shaft(output) == []
    if command != "modes":
        assert "crankshaft 6000 rpm (camshaft 3000 rpm)" in output


@pytest.mark.slow
def test_report_names_shaft_of_speed(flexcam, crank_speed_case):
    flexcam("run", crank_speed_case, *SHORT)
    flexcam("report", "results/case.vtkhdf", "-o", "page.html")
    assert read_result("results/case.vtkhdf").response.status.ok
    page = Path("page.html").read_text(encoding="utf-8")
    assert "crankshaft 6000 rpm (camshaft 3000 rpm)" in page
    text = re.sub(r"<(script|style|pre)\b.*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL)
    assert speeds_without_shaft("\n".join(re.findall(r".{0,40}rpm", text))) == []


def test_at_speed_keeps_reference_shaft(crank_speed_case):
    """Messages about the new case refer to the same shaft, too."""
    other = read_case(crank_speed_case).at_speed(100.0)
    assert other.turns == 2.0
    assert other.speed == 100.0
