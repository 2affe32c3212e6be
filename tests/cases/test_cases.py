"""All cases of the repository run; the published ones reproduce the 3000 rpm column of their table."""

from pathlib import Path

import numpy as np
import pytest

from flexcam import prepare, read_case
from flexcam.analysis.cam_analysis import cam_facts, load_cams
from flexcam.analysis.comparison import deviation
from tests.thinning import mostly_slow, slow_if

ROOT = Path(__file__).parents[2]
CASES = sorted(str(path.relative_to(ROOT)) for path in (ROOT / "cases").rglob("*.toml"))
PUBLISHED = [name for name in CASES if "/tayeb/" in name]
AT_3000_RPM = {"shm": 1.238, "parabolic": 1.319, "cycloidal": 1.437}
"""Peak deviation of the valve relative to its lift, after two revolutions (published-systems, section T)."""


def test_nine_published_cases_exist():
    assert [
        f"cases/tayeb/model-{k}-{law}.toml" for k in (1, 2, 3) for law in ("cycloidal", "parabolic", "shm")
    ] == PUBLISHED


@pytest.mark.parametrize("name", mostly_slow(PUBLISHED, 2))
def test_published_deviation_at_3000_rpm(name):
    """The tolerance is half a unit of the third decimal of the table."""
    case = read_case(ROOT / name)
    law = name.removesuffix(".toml").rpartition("-")[2]
    assert case.record.cams["intake"].law.given == law
    found = deviation(case, "valve")
    assert found.status.ok
    assert found.speed_rpm == pytest.approx(3000.0, rel=1e-12)
    assert found.peak_deviation == pytest.approx(AT_3000_RPM[law], abs=5.1e-4)


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_numbers_of_elements_and_unknowns(name):
    model = int(name.split("model-")[1][0])
    ready = prepare(read_case(ROOT / name))
    assert (len(ready.model.mesh.elements()), ready.problem.system.size) == {1: (4, 21), 2: (8, 25), 3: (10, 47)}[model]


@pytest.mark.parametrize("name", CASES)
def test_case_head_states_source_and_expectation(name):
    text = (ROOT / name).read_text(encoding="utf-8")
    assert text.startswith("#")
    assert "must show" in text or "Expected: " in text


CAMS = [name for name in CASES if "/cams/" in name]


def case_param(name):
    """Cases with contacts of a train are slow; `test_large_cases.py` runs them, too."""
    folders = ("camshaft-4cyl", "direct-acting", "pushrod-engine")
    return pytest.param(name, marks=[pytest.mark.slow] * (name.split("/")[1] in folders))


@pytest.mark.parametrize(
    "name", mostly_slow([case_param(name) for name in CASES if name not in (*PUBLISHED, *CAMS)], 2)
)
def test_case_runs(name, run_case):
    response, _ = run_case(name.removeprefix("cases/").removesuffix(".toml"))
    assert response.status.ok


SMOOTH = {"li-fb2": 3, "li-swing": 3, "petrescu-cos": 2, "roussev-single-dwell": 4}
"""Number of continuous derivatives, including the lift, as stated in the head of each file."""


@pytest.mark.parametrize("name", slow_if(lambda name: "petrescu-cos" not in name, CAMS))
def test_cam_files_are_continuous_as_stated(name):
    cams = load_cams(ROOT / name)
    for cam in cams.cams.values():
        found = cam_facts(cam)
        steps = np.array([one.steps for one in found.joints])
        smooth = SMOOTH[Path(name).stem]
        assert not steps[:, :smooth].any()
        assert smooth == 4 or steps[:, smooth].any()
        assert not any("undercut" in one.what for one in found.findings)


@pytest.mark.parametrize(("rpm", "shm"), [(1000, 0.0615), (2000, 0.322), (4000, 2.730)])
def test_published_deviation_at_other_speeds(rpm, shm):
    """The tolerance is half a unit of the last printed digit: the third, or the fourth at 4000 rpm."""
    case = read_case(ROOT / "cases/tayeb/model-2-shm.toml", [f"run.speed={rpm}rpm"])
    assert deviation(case, "valve").peak_deviation == pytest.approx(shm, abs=5.1e-4 if shm > 0.1 else 5.1e-5)
