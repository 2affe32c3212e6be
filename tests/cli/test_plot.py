"""flexcam plot: content of figures of results and cases, refusals and appearance."""

import shutil
import xml.etree.ElementTree as ET  # the files are our own
from pathlib import Path

import imagehash
import numpy as np
import pytest
from PIL import Image

from flexcam import prepare, read_case, read_result, solve
from flexcam.analysis.run import member_strength, open_result_file, reload_result, strength_sink
from flexcam.case.reader import case_from_result
from flexcam.io import write_text
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"

FAST_KINDS = ("motion",)
REFERENCE_HASHES = {
    "motion": "b3cee631e6087386",
    "force": "b13131a1cecc6e5e",
    "energy": "e5ac7ea9a6598618",
    "svaj": "a5e7f6a064866639",
    "profile": "ab707424a32c8faf",
    "modes": "a1036617671b3767",
}
"""Perceptual hash (64 bits) of every kind of figure."""

MAX_HASH_DISTANCE = 10
"""Permitted differing bits: fonts and versions of matplotlib move labels; different figures differ by 22 bits."""


def svg_texts(path):
    """Return the comments of an SVG file, which contain the texts that matplotlib draws."""
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))  # noqa: S314 - our own file
    tree = ET.parse(path, parser)  # noqa: S314
    return [str(comment.text).strip() for comment in tree.iter() if comment.tag is ET.Comment]


def image_hash(path):
    with Image.open(path) as image:
        return imagehash.phash(image)


@pytest.mark.slow
def test_motion_plot_with_rigid_train(flexcam, result, tmp_path):
    done = flexcam("plot", result, "--rigid", "-o", "a.svg", "--json")
    assert (done.code, done.err, done.json["files"]) == (0, "", ["a.svg"])
    words = svg_texts(tmp_path / "a.svg")
    wanted = ["valve lift", "mm", "valve velocity", "m/s", "valve acceleration", "m/s²", "intake force", "N",
              "cam angle, deg", "rigid", "flexible", "Nodes in the file, camshaft 3000 rpm"]  # fmt: skip
    assert [word for word in wanted if word not in words] == []


@pytest.mark.slow
def test_probe_is_plotted_with_force_of_its_train(flexcam, tmp_path):
    """A probe of the exhaust, labelled at the axis, above the force of the exhaust; the intake is the first cam."""
    case = ROOT / "cases/camshaft-4cyl/camshaft.toml"
    few = ["--set", "run.revolutions=0.02", "--set", 'output.probes=["intake-1-follower", "exhaust-1-follower"]']
    assert flexcam("plot", case, *few, "--probe", "exhaust-1-follower", "-o", "a.svg").code == 0
    words = svg_texts(tmp_path / "a.svg")
    assert {"exhaust-1-follower", "lift", "exhaust-1 force"} <= set(words)
    assert "intake-1 force" not in words
    assert flexcam("plot", case, *few, "--probe", "exhaust-1-follower.uy", "-o", "b.svg").code == 0
    assert {"exhaust-1-follower.uy", "displacement", "exhaust-1 force"} <= set(svg_texts(tmp_path / "b.svg"))


@pytest.mark.slow
def test_rigid_force_plot_warns_of_shared_seat_load(flexcam, tmp_path):
    few = ["--set", "run.revolutions=0.02", "--set", "contacts.lash.gap=0"]
    case = tmp_path / "intake.toml"
    shutil.copy(ENGINE, case)
    done = flexcam("plot", case, "--what", "force", "--rigid", *few, "-o", "a.svg")
    assert "both share the 640 N of the springs" in " ".join(done.out.split())
    with_lash = flexcam("plot", case, "--what", "force", "--rigid", *few[:2], "-o", "b.svg", "--json")
    assert with_lash.json["warnings"] == []


def test_force_plot_of_adjuster_and_wrapped_title(flexcam, tmp_path):
    """The rigid train has no adjuster: only the flexible train has an adjuster force."""
    case = Path(__file__).parents[2] / "cases/direct-acting/finger.toml"
    few = ("--set", "run.revolutions=0.02", "--set", "run.steps_per_revolution=360")
    done = flexcam("plot", case, "--what", "force", "--rigid", *few, "-o", "a.svg", "--json")
    assert (done.code, done.err, done.json["files"]) == (0, "", ["a.svg"])
    words = svg_texts(tmp_path / "a.svg")
    assert {"rigid", "flexible", "intake force", "adjuster force"} <= set(words)
    assert "Roller finger follower with hydraulic lash adjuster, crankshaft 6000 rpm" in words
    assert "(camshaft 3000 rpm)" in words


@pytest.mark.slow
def test_plot_of_several_results_over_time(flexcam, case, result, tmp_path):
    """Speeds distinguish files of the same name."""
    assert flexcam("run", "case.toml", "-o", "fast", "--set", "run.speed=4000rpm").code == 0
    assert flexcam("plot", result, "fast/case.vtkhdf", "--over", "time", "--probe", "cam.rx", "-o", "b.svg").code == 0
    words = svg_texts(tmp_path / "b.svg")
    assert [
        word
        for word in ("case, camshaft 3000 rpm", "case, camshaft 4000 rpm", "time, s", "deg", "rad/s")
        if word not in words
    ] == []


@pytest.mark.slow
def test_plot_runs_case(flexcam, case, tmp_path):
    done = flexcam("plot", "case.toml", "--set", "run.speed=3500rpm")
    assert (done.code, done.out.strip()) == (0, "case-motion.svg")
    assert "Nodes in the file, camshaft 3500 rpm" in svg_texts(tmp_path / "case-motion.svg")


@pytest.mark.parametrize("ending", ["png", pytest.param("pdf", marks=pytest.mark.slow)])
def test_plot_file_formats(ending, flexcam, result, tmp_path):
    assert flexcam("plot", result, "--what", "energy", "-o", f"deep/e.{ending}").code == 0
    begin = {"png": b"\x89PNG", "pdf": b"%PDF"}[ending]
    assert (tmp_path / f"deep/e.{ending}").read_bytes().startswith(begin)


@pytest.mark.slow
def test_plot_of_result_without_case_file(flexcam, result, case):
    """The result contains the data of its rigid train, cams and modes."""
    case.unlink()
    for what, more in (("motion", ["--rigid"]), ("svaj", []), ("modes", ["--count", "2"])):
        assert flexcam("plot", result, "--what", what, *more, "-o", f"{what}.png").code == 0


@pytest.mark.slow
def test_profile_plot_coloured_by_channel(flexcam, intake, tmp_path):
    shutil.copy(intake, tmp_path / "intake.vtkhdf")
    coloured = ["plot", "intake.vtkhdf", "--what", "profile", "--channel"]
    assert flexcam(*coloured, "contacts.intake.pressure", "-o", "profile.svg").code == 0
    assert {"intake pressure, MPa", "base circle"} <= set(svg_texts(tmp_path / "profile.svg"))
    for words, expected in (
        (["contacts.seat.force"], "one channel of a cam's contact, such as contacts.intake.force"),
        (["contacts.intake.force", "--channel", "contacts.intake.gap"], "one channel of a cam's contact"),
        (["contacts.intake.presure"], "Did you mean 'contacts.intake.pressure'"),
        (["contacts.intake.force", "--cam", "exhaust"], "It is the cam of the channel"),
    ):
        done = flexcam(*coloured, *words, "-o", "none.svg")
        assert done.code == 2
        assert expected in done.err
    cams_file = Path(__file__).parents[2] / "cases/cams/li-swing.toml"
    assert "A file of cams is not run" in flexcam("plot", cams_file, *coloured[2:], "contacts.intake.force").err


@pytest.mark.parametrize(("what", "message"), [("svaj", "Swinging roller follower of Li (2014)"), ("profile", "pivot")])
def test_plot_of_file_with_cams_only(what, message, flexcam, tmp_path):
    """A file of cams without a mechanism has lifts and profiles, as for `flexcam cam`."""
    path = Path(__file__).parents[2] / "cases/cams/li-swing.toml"
    assert flexcam("plot", path, "--what", what, "-o", "cams.svg").code == 0
    assert message in svg_texts(tmp_path / "cams.svg")
    assert flexcam("plot", path, "-o", "motion.svg").code == 2


def test_plot_of_run_that_ended_early(flexcam, case, tmp_path):
    """The plot shows the computed part; the command has the exit code of the run."""
    done = flexcam("plot", "case.toml", "--set", "run.integrator.beta=0.01", "-o", "early.svg")
    assert done.code == 3
    assert "not-finite" in done.err
    assert "valve lift" in svg_texts(tmp_path / "early.svg")


@pytest.mark.parametrize(
    ("words", "message"),
    mostly_slow(
        [
            (["nosuch.vtkhdf"], "no such file"),
            (["text.vtkhdf"], "a result file of flexcam"),
            (["out/case.vtkhdf", "--probe", "valv"], "Did you mean 'valve'"),
            (["out/case.vtkhdf", "--probe", "cam"], "cam.uy"),
            (["out/case.vtkhdf", "--channel", "contacts.intake.forc"], "Did you mean 'contacts.intake.force'"),
            (["out/case.vtkhdf", "-o", "a.jpg"], "one of .svg, .png, .pdf"),
            (["out/case.vtkhdf", "-o", "case.toml/a.svg"], "a folder with write permission"),
            (["out/case.vtkhdf", "-o", "taken.svg"], "--overwrite"),
            (["out/case.vtkhdf", "--set", "run.speed=1000rpm"], "A result cannot be changed"),
            (
                ["out/case.vtkhdf", "--what", "energy", "--probe", "valve", "--rigid"],
                "--what motion",
            ),
            (["case.toml", "--what", "profile"], "base_radius and follower"),
            (["case.toml", "--what", "svaj", "--cam", "intak"], "Did you mean 'intake'"),
            (["case.toml", "--what", "modes", "--count", "0"], "a whole number, at least 1"),
            (["case.toml", "out/case.vtkhdf", "--what", "modes"], "one file"),
            (["out/case.vtkhdf", "--what", "nosuch"], "motion"),
        ],
        2,
    ),
)
def test_plot_refuses_invalid_arguments(words, message, flexcam, result, tmp_path):
    write_text(tmp_path / "taken.svg", "mine")
    write_text(tmp_path / "text.vtkhdf", "no result")
    before = sorted(tmp_path.rglob("*"))
    done = flexcam("plot", *words)
    assert done.code == 2
    assert message in done.err
    assert sorted(tmp_path.rglob("*")) == before, "nothing is written"
    assert (tmp_path / "taken.svg").read_text() == "mine"


def test_all_wrong_options_are_reported(flexcam, result):
    done = flexcam("plot", result, "--what", "modes", "--probe", "valve", "--over", "time", "--angle", "3 deg")
    assert [line.partition(":")[0] for line in done.err.splitlines()] == ["--probe", "--over", "--angle"]


@pytest.mark.parametrize(
    "what", [pytest.param(one, marks=() if one in FAST_KINDS else pytest.mark.slow) for one in REFERENCE_HASHES]
)
def test_appearance_of_plots(what, flexcam, intake, tmp_path):
    shutil.copy(intake, tmp_path / "intake.vtkhdf")
    more = {"motion": ["--rigid"], "profile": ["--angle", "160 deg"], "modes": ["--count", "4"]}.get(what, [])
    assert flexcam("plot", "intake.vtkhdf", "--what", what, *more, "-o", "look.png").code == 0
    distances = {
        kind: image_hash(tmp_path / "look.png") - imagehash.hex_to_hash(reference)
        for kind, reference in REFERENCE_HASHES.items()
    }
    assert distances[what] <= MAX_HASH_DISTANCE, f"it looks otherwise now: {image_hash(tmp_path / 'look.png')}"
    assert min(bits for kind, bits in distances.items() if kind != what) > MAX_HASH_DISTANCE, "and like no other"


@pytest.mark.parametrize(
    ("path", "overrides"),
    [("pushrod-engine/intake.toml", []), ("tayeb/model-1-shm.toml", ["members.pushrod.elements=3"])],
    ids=["nodes in the file", "a mesh with members divided further"],
)
def test_case_from_result_equals_original_case(path, overrides, tmp_path):
    """The result alone gives the same matrices, names and loads."""
    original = read_case(ROOT / "cases" / path, [*overrides, "run.steps_per_revolution=90", "run.revolutions=0.1"])
    ready = prepare(original)
    sink = open_result_file(ready, tmp_path)
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    restored = case_from_result(read_result(sink.path))
    assert (restored.text, restored.overrides, restored.speed) == (original.text, original.overrides, original.speed)
    system, restored_system = ready.problem.system, prepare(restored).problem.system
    assert system.names == restored_system.names
    for name in ("mass", "stiffness", "damping"):
        assert (getattr(system, name).dense() == getattr(restored_system, name).dense()).all(), name
    assert [load.name for load in system.loads] == [load.name for load in restored_system.loads]


def test_reloaded_result_equals_run(tmp_path):
    """Fields include the unknowns that belong to no node; stresses are identical, too."""
    ready = prepare(read_case(ENGINE, ["run.steps_per_revolution=360", "run.revolutions=0.2"]))
    sink, strength = open_result_file(ready, tmp_path), strength_sink(ready)
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink, strength])
    result = read_result(sink.path)
    reloaded_ready, reloaded_response = reload_result(case_from_result(result), result)
    assert reloaded_response.outline == response.outline
    for name, values in response.fields._asdict().items():
        np.testing.assert_allclose(getattr(reloaded_response.fields, name), values, rtol=0.0, atol=0.0)
    assert member_strength(reloaded_ready, reloaded_response).members() == strength.members()
    assert member_strength(reloaded_ready, reloaded_response).shares() == strength.shares()
