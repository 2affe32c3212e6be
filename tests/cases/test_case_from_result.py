"""The case stored in a result gives the same model on the same mesh, even if the files of the case are gone."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case, run
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.case.builder import build_model
from flexcam.case.reader import case_from_result
from flexcam.case.starters import new_case
from flexcam.io import read_result
from flexcam.plotting.scene.motion import result_motion
from flexcam.valvetrain import build_structure
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
CASES = ["tayeb/model-3-shm", "pushrod-engine/lever", "li/valve-train", "petrescu/valve-spring", "checks/cantilever"]


def solve_and_read(path, folder, *overrides):
    """Run a case for a few steps; return case, response and stored result."""
    case = read_case(path, ["run.revolutions=0.05", "output.field_every=5", *overrides])
    sink = open_result_file(prepare(case), folder)
    response = run(case, sinks=[sink])
    return case, response, read_result(sink.path)


@pytest.mark.parametrize("name", mostly_slow(CASES, 2))
def test_model_and_motion_from_result_equal_those_of_run(name, tmp_path):
    """The cases have unknowns of nodes, of points with lash and of spring elements."""
    shutil.copytree(ROOT / "meshes", tmp_path / "meshes")
    (tmp_path / "cases" / name).parent.mkdir(parents=True)
    source = shutil.copy(ROOT / f"cases/{name}.toml", tmp_path / f"cases/{name}.toml")
    case, response, result = solve_and_read(source, tmp_path / "results")
    shutil.rmtree(tmp_path / "meshes")
    Path(source).unlink()
    model, restored = build_model(case) if "mesh" not in case.text else None, build_model(case_from_result(result))
    if model is not None:
        assert np.array_equal(model.mesh.nodes, restored.mesh.nodes)
        assert {n: line.tolist() for n, line in model.mesh.lines.items()} == {
            n: line.tolist() for n, line in restored.mesh.lines.items()
        }
    structure = build_structure(restored)
    motion = result_motion(structure, result, case.speed)
    drawn = motion.rigid + motion.elastic
    assert structure.dofs.names == response.outline.unknowns
    assert np.allclose(drawn, response.fields.displacement, rtol=1e-12, atol=1e-18)


def test_case_from_result_has_overrides(tmp_path):
    _, _, result = solve_and_read(ROOT / "cases/petrescu/valve-spring.toml", tmp_path, "cams.valve.lift=4 mm")
    assert case_from_result(result).record.cams["valve"].lift == pytest.approx(0.004)


@pytest.mark.slow
def test_case_from_result_has_lift_table(tmp_path):
    """The original file is not read: another one replaces it."""
    new_case("measured-lift", tmp_path / "case.toml")
    case, _, result = solve_and_read(tmp_path / "case.toml", tmp_path)
    lift = next(iter(build_model(case).cams.values())).event
    angle = np.linspace(0.0, 6.3, 100)
    (tmp_path / "measured-lift.csv").write_text("cam_deg, lift_mm\n0, 0\n1, 1\n")
    for _ in range(2):
        restored = next(iter(build_model(case_from_result(result)).cams.values())).event
        assert np.array_equal(restored(angle), lift(angle))
        (tmp_path / "measured-lift.csv").unlink(missing_ok=True)


def test_case_from_result_has_force_table_and_law_file(tmp_path):
    shutil.copy(ROOT / "cases/pushrod-engine/intake.toml", tmp_path / "case.toml")
    (tmp_path / "spring.csv").write_text("travel_mm, force_N\n0, 200\n8, 500\n20, 1100\n")
    (tmp_path / "law.toml").write_text('[law]\nid = "cycloidal"\n')
    changes = ("springs.valve.stiffness=0", "springs.valve.force_table=spring.csv", "cams.intake.law=law.toml")
    case, _, result = solve_and_read(tmp_path / "case.toml", tmp_path, *changes)
    (tmp_path / "spring.csv").unlink()
    (tmp_path / "law.toml").unlink()
    restored = case_from_result(result).record
    assert restored.springs["valve"] == case.record.springs["valve"]
    assert restored.cams["intake"].law == case.record.cams["intake"].law
