"""flexcam plot: what is drawn of results and cases, what is refused, and how the pictures look."""

from __future__ import annotations

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

SEEN_ALWAYS = ("motion",)
LOOKS = {
    "motion": "b3cee631e6087386",
    "force": "b13131a1cecc6e5e",
    "energy": "e5ac7ea9a6598618",
    "svaj": "a5e7f6a064866639",
    "profile": "ab707424a32c8faf",
    "modes": "a1036617671b3767",
}
"""Perceptual hash (64 bits) of every kind of picture."""

SAME = 10
"""Bits by which a picture may differ: other fonts and versions of matplotlib move labels; others differ by 22."""


def words_of(path):
    """Return the comments of an SVG file, in which matplotlib keeps the texts it draws."""
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))  # noqa: S314 - our own file
    tree = ET.parse(path, parser)  # noqa: S314
    return [str(one.text).strip() for one in tree.iter() if one.tag is ET.Comment]


def look(path):
    with Image.open(path) as image:
        return imagehash.phash(image)


def test_motion_of_a_result_with_its_rigid_train(flexcam, result, tmp_path):
    done = flexcam("plot", result, "--rigid", "-o", "a.svg", "--json")
    assert (done.code, done.err, done.json["files"]) == (0, "", ["a.svg"])
    words = words_of(tmp_path / "a.svg")
    wanted = ["valve lift", "mm", "valve velocity", "m/s", "valve acceleration", "m/s²", "intake force", "N",
              "cam angle, deg", "rigid", "flexible", "Nodes in the file, camshaft 3000 rpm"]  # fmt: skip
    assert [word for word in wanted if word not in words] == []


@pytest.mark.slow
def test_a_probe_is_drawn_with_the_force_of_its_own_train(flexcam, tmp_path):
    """A probe of the exhaust, with its name at the axis, over the force of the exhaust; the intake is the first cam."""
    case = ROOT / "cases/camshaft-4cyl/camshaft.toml"
    few = ["--set", "run.revolutions=0.02", "--set", 'output.probes=["intake-1-follower", "exhaust-1-follower"]']
    assert flexcam("plot", case, *few, "--probe", "exhaust-1-follower", "-o", "a.svg").code == 0
    words = words_of(tmp_path / "a.svg")
    assert {"exhaust-1-follower", "lift", "exhaust-1 force"} <= set(words)
    assert "intake-1 force" not in words
    assert flexcam("plot", case, *few, "--probe", "exhaust-1-follower.uy", "-o", "b.svg").code == 0
    assert {"exhaust-1-follower.uy", "displacement", "exhaust-1 force"} <= set(words_of(tmp_path / "b.svg"))


def test_what_a_drawn_rigid_train_cannot_know_is_told(flexcam, tmp_path):
    few = ["--set", "run.revolutions=0.02", "--set", "contacts.lash.gap=0"]
    case = tmp_path / "intake.toml"
    shutil.copy(ENGINE, case)
    done = flexcam("plot", case, "--what", "force", "--rigid", *few, "-o", "a.svg")
    assert "both share the 640 N of the springs" in " ".join(done.out.split())
    drawn = flexcam("plot", case, "--what", "force", "--rigid", *few[:2], "-o", "b.svg", "--json")
    assert drawn.json["warnings"] == []


def test_a_rigid_train_lacks_some_forces_and_a_long_title_has_lines(flexcam, tmp_path):
    """It has no adjuster: what only the flexible one has is drawn alone."""
    case = Path(__file__).parents[2] / "cases/direct-acting/finger.toml"
    few = ("--set", "run.revolutions=0.02", "--set", "run.steps_per_revolution=360")
    done = flexcam("plot", case, "--what", "force", "--rigid", *few, "-o", "a.svg", "--json")
    assert (done.code, done.err, done.json["files"]) == (0, "", ["a.svg"])
    words = words_of(tmp_path / "a.svg")
    assert {"rigid", "flexible", "intake force", "adjuster force"} <= set(words)
    assert "Roller finger follower with hydraulic lash adjuster, crankshaft 6000 rpm" in words
    assert "(camshaft 3000 rpm)" in words


@pytest.mark.slow
def test_several_results_over_time(flexcam, case, result, tmp_path):
    """Files of one name are told apart by their speeds."""
    assert flexcam("run", "case.toml", "-o", "fast", "--set", "run.speed=4000rpm").code == 0
    assert flexcam("plot", result, "fast/case.vtkhdf", "--over", "time", "--probe", "cam.rx", "-o", "b.svg").code == 0
    words = words_of(tmp_path / "b.svg")
    assert [
        word
        for word in ("case, camshaft 3000 rpm", "case, camshaft 4000 rpm", "time, s", "deg", "rad/s")
        if word not in words
    ] == []


def test_a_case_is_run(flexcam, case, tmp_path):
    done = flexcam("plot", "case.toml", "--set", "run.speed=3500rpm")
    assert (done.code, done.out.strip()) == (0, "case-motion.svg")
    assert "Nodes in the file, camshaft 3500 rpm" in words_of(tmp_path / "case-motion.svg")


@pytest.mark.parametrize("ending", ["png", "pdf"])
def test_endings(ending, flexcam, result, tmp_path):
    assert flexcam("plot", result, "--what", "energy", "-o", f"deep/e.{ending}").code == 0
    begin = {"png": b"\x89PNG", "pdf": b"%PDF"}[ending]
    assert (tmp_path / f"deep/e.{ending}").read_bytes().startswith(begin)


@pytest.mark.slow
def test_a_result_whose_case_is_gone(flexcam, result, case):
    """Its rigid train, cams and modes come out of what the result keeps."""
    case.unlink()
    for what, more in (("motion", ["--rigid"]), ("svaj", []), ("modes", ["--count", "2"])):
        assert flexcam("plot", result, "--what", what, *more, "-o", f"{what}.png").code == 0


@pytest.mark.slow
def test_a_profile_coloured_by_a_channel(flexcam, intake, tmp_path):
    shutil.copy(intake, tmp_path / "intake.vtkhdf")
    coloured = ["plot", "intake.vtkhdf", "--what", "profile", "--channel"]
    assert flexcam(*coloured, "contacts.intake.pressure", "-o", "profile.svg").code == 0
    assert {"intake pressure, MPa", "base circle"} <= set(words_of(tmp_path / "profile.svg"))
    for words, said in (
        (["contacts.seat.force"], "one channel of a cam's contact, such as contacts.intake.force"),
        (["contacts.intake.force", "--channel", "contacts.intake.gap"], "one channel of a cam's contact"),
        (["contacts.intake.presure"], "Did you mean 'contacts.intake.pressure'"),
        (["contacts.intake.force", "--cam", "exhaust"], "It is the cam of the channel"),
    ):
        done = flexcam(*coloured, *words, "-o", "none.svg")
        assert done.code == 2
        assert said in done.err
    alone = Path(__file__).parents[2] / "cases/cams/li-swing.toml"
    assert "A file of cams is not run" in flexcam("plot", alone, *coloured[2:], "contacts.intake.force").err


@pytest.mark.parametrize(("what", "said"), [("svaj", "Swinging roller follower of Li (2014)"), ("profile", "pivot")])
def test_cams_alone(what, said, flexcam, tmp_path):
    """A file of cams without a mechanism has lifts and profiles, as for `flexcam cam`."""
    path = Path(__file__).parents[2] / "cases/cams/li-swing.toml"
    assert flexcam("plot", path, "--what", what, "-o", "cams.svg").code == 0
    assert said in words_of(tmp_path / "cams.svg")
    assert flexcam("plot", path, "-o", "motion.svg").code == 2


def test_what_a_run_that_ended_early_left(flexcam, case, tmp_path):
    """It is drawn as far as it came; the command ends as the run did."""
    done = flexcam("plot", "case.toml", "--set", "run.integrator.beta=0.01", "-o", "early.svg")
    assert done.code == 3
    assert "not-finite" in done.err
    assert "valve lift" in words_of(tmp_path / "early.svg")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "said"), [("campbell", "natural frequency, Hz"), ("waterfall", "order of the camshaft")]
)
def test_orders_over_speed(what, said, flexcam, case, tmp_path):
    """The figures of `flexcam campbell` without and with --response, from half to 1.5 times the case's speed."""
    assert flexcam("plot", "case.toml", "--what", what, "--count", "2", "-o", "orders.svg").code == 0
    assert said in words_of(tmp_path / "orders.svg")


@pytest.mark.parametrize(
    ("words", "said"),
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
                "--what motion or waterfall or work-precision",
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
def test_refusals(words, said, flexcam, result, tmp_path):
    write_text(tmp_path / "taken.svg", "mine")
    write_text(tmp_path / "text.vtkhdf", "no result")
    before = sorted(tmp_path.rglob("*"))
    done = flexcam("plot", *words)
    assert done.code == 2
    assert said in done.err
    assert sorted(tmp_path.rglob("*")) == before, "nothing is written"
    assert (tmp_path / "taken.svg").read_text() == "mine"


def test_every_wrong_option_is_told_at_once(flexcam, result):
    done = flexcam("plot", result, "--what", "modes", "--probe", "valve", "--over", "time", "--angle", "3 deg")
    assert [line.partition(":")[0] for line in done.err.splitlines()] == ["--probe", "--over", "--angle"]


@pytest.mark.parametrize(
    "what", [pytest.param(one, marks=() if one in SEEN_ALWAYS else pytest.mark.slow) for one in LOOKS]
)
def test_looks(what, flexcam, intake, tmp_path):
    shutil.copy(intake, tmp_path / "intake.vtkhdf")
    more = {"motion": ["--rigid"], "profile": ["--angle", "160 deg"], "modes": ["--count", "4"]}.get(what, [])
    assert flexcam("plot", "intake.vtkhdf", "--what", what, *more, "-o", "look.png").code == 0
    off = {other: look(tmp_path / "look.png") - imagehash.hex_to_hash(known) for other, known in LOOKS.items()}
    assert off[what] <= SAME, f"it looks otherwise now: {look(tmp_path / 'look.png')}"
    assert min(bits for other, bits in off.items() if other != what) > SAME, "and like no other"


@pytest.mark.slow
def test_work_precision(flexcam, tmp_path):
    """The same picture as that of flexcam trade."""
    shutil.copy(ROOT / "cases/li/valve-train.toml", tmp_path / "li.toml")
    few = ("--set", "run.steps_per_revolution=120", "--set", "run.revolutions=1")
    done = flexcam("plot", "li.toml", "--what", "work-precision", *few, "-o", "w.svg")
    assert (done.code, done.err) == (0, "")
    words = words_of(tmp_path / "w.svg")
    assert [word for word in ("unknowns times steps", "error of lift, %", "rigid") if word not in words] == []


@pytest.mark.parametrize(
    ("path", "overrides"),
    [("pushrod-engine/intake.toml", []), ("tayeb/model-1-shm.toml", ["members.pushrod.elements=3"])],
    ids=["nodes in the file", "a mesh with members divided further"],
)
def test_the_recalled_case_is_the_case(path, overrides, tmp_path):
    """Out of the result alone: the same matrices, names and loads."""
    own = read_case(ROOT / "cases" / path, [*overrides, "run.steps_per_revolution=90", "run.revolutions=0.1"])
    ready = prepare(own)
    sink = open_result_file(ready, tmp_path)
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    kept = case_from_result(read_result(sink.path))
    assert (kept.text, kept.overrides, kept.speed) == (own.text, own.overrides, own.speed)
    one, other = ready.problem.system, prepare(kept).problem.system
    assert one.names == other.names
    for name in ("mass", "stiffness", "damping"):
        assert (getattr(one, name).dense() == getattr(other, name).dense()).all(), name
    assert [load.name for load in one.loads] == [load.name for load in other.loads]


def test_a_reopened_result_is_the_run(tmp_path):
    """Its fields are the unknowns of the run, those that no node has among them, and so are its stresses."""
    ready = prepare(read_case(ENGINE, ["run.steps_per_revolution=360", "run.revolutions=0.2"]))
    sink, stressed = open_result_file(ready, tmp_path), strength_sink(ready)
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink, stressed])
    result = read_result(sink.path)
    again, found = reload_result(case_from_result(result), result)
    assert found.outline == response.outline
    for name, values in response.fields._asdict().items():
        np.testing.assert_allclose(getattr(found.fields, name), values, rtol=0.0, atol=0.0)
    assert member_strength(again, found).members() == stressed.members()
    assert member_strength(again, found).shares() == stressed.shares()
