"""All keys of the case format are in a case that runs."""

import shutil
from pathlib import Path

import pytest

from flexcam import read_case, run
from flexcam.analysis.cam_analysis import cam_facts, load_cams
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
EVERY = ROOT / "tests/data/every-key.toml"
EVERY_CAM = ROOT / "tests/data/every-cam.toml"
EVERY_CONTACT = ROOT / "tests/data/every-contact.toml"
MESH_CASE = ROOT / "cases/tayeb/model-1-shm.toml"

VARIANTS = {
    "as it stands": (EVERY, []),
    "hht": (EVERY, ['run.integrator={ method = "hht", alpha = -0.1 }']),
    "generalized-alpha": (EVERY, ['run.integrator={ method = "generalized-alpha", rho_inf = 0.8 }']),
    "given state": (EVERY, ['run.start={ displacement = { "cam.uy" = "1 um" }, velocity = { "cam.rx" = "1 rad/s" } }']),
    "other members": (EVERY, ["members.pushrod.section=flat", "members.camshaft.section=own"]),
    "true contacts": (EVERY_CONTACT, ["run.revolutions=0.2"]),
    "mesh file": (MESH_CASE, ["run.revolutions=0.1"]),
}


@pytest.mark.parametrize("variant", mostly_slow(VARIANTS, 2))
def test_case_with_all_keys_runs(variant):
    path, overrides = VARIANTS[variant]
    assert run(read_case(path, overrides)).status.ok


@pytest.mark.slow
def test_cam_file_with_all_keys_is_read():
    cams = load_cams(EVERY_CAM)
    assert set(cams.cams) == {"intake", "single", "swing", "measured"}
    assert all(cam_facts(cam).cam.event.height > 0.0 for cam in cams.cams.values())


def test_restart_from_result_with_step_in_seconds_runs(tmp_path):
    from flexcam.analysis.preparation import prepare
    from flexcam.analysis.run import open_result_file
    from flexcam.dynamics import solve

    ready = prepare(read_case(EVERY))
    sink = open_result_file(ready, tmp_path)
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    text = EVERY.read_text(encoding="utf-8").replace("steps_per_revolution = 720", 'step = "20 us"')
    text = text.replace('speed = "1000 rpm"', 'crank_speed = "2000 rpm"')
    (tmp_path / "next.toml").write_text(text, encoding="utf-8")
    shutil.copy(EVERY.with_name("lift.csv"), tmp_path)
    case = read_case(tmp_path / "next.toml", ['run.start={ result = "every-key.vtkhdf" }'])
    assert run(case).status.ok
