"""Pictures, movies and pages of mechanisms, and the messages if rendering is impossible.

The tests compare pictures with small reference pictures by perceptual hash (16 x 16 bits, without the text at the
top). Measured distances: 0 between Mesa's EGL and GLX, 0 after softening by resampling, up to 4 at 90 % of the
brightness; 14 and more for cam angles 30 deg apart, 60 and more for another case. The limit is 8 bits.
"""

import base64
import io
import json
import math
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import read_case, read_result
from flexcam.case.builder import build_model
from flexcam.dynamics import RunFailedError
from flexcam.plotting import rendering
from flexcam.plotting.scene.mechanism import build_mechanism
from flexcam.plotting.scene.motion import case_motion
from flexcam.plotting.solid_files import collect_parts
from flexcam.valvetrain import build_structure
from tests.thinning import slow_if

imagehash = pytest.importorskip("imagehash")
Image = pytest.importorskip("PIL.Image")
pytest.importorskip("pyvista")

ROOT = Path(__file__).parents[2]
INTAKE, FINGER = (ROOT / f"cases/{name}.toml" for name in ("pushrod-engine/intake", "direct-acting/finger"))
PICTURES = {
    "finger": (FINGER, "--at", "236deg"),
    "intake": (INTAKE, "--at", "180deg"),
    "camshaft": (ROOT / "cases/camshaft-4cyl/camshaft.toml", "--at", "20deg"),
    "mode": (INTAKE, "--mode", "3", "--color", "displacement"),
}
TITLE = "Roller finger follower with hydraulic lash adjuster: rigid mechanism"
SIZE = ("--size", "400x300")
TEXT_HEIGHT = 30
"""Pixels of the text at the top: fonts differ between machines."""
MAX_HASH_DISTANCE = 8
"""Permitted differing bits, of 256, between pictures of one scene."""


@pytest.fixture(scope="module")
def drawing():
    """Skip the test if rendering is impossible, unless FLEXCAM_REQUIRE_PARAVIEW=1."""
    try:
        rendering.select_renderer(off_screen=True)
    except RunFailedError as failure:
        if os.environ.get("FLEXCAM_REQUIRE_PARAVIEW") == "1":
            pytest.fail(f"FLEXCAM_REQUIRE_PARAVIEW=1, but {failure}")
        pytest.skip(f"NOTHING WAS DRAWN: {failure}")


def open_picture(path, mode="L"):
    with Image.open(path) as picture:
        return picture.convert(mode)


def image_hash(path):
    picture = open_picture(path)
    return imagehash.phash(picture.crop((0, TEXT_HEIGHT, *picture.size)), hash_size=16)


@pytest.mark.usefixtures("drawing")
@pytest.mark.parametrize("name", slow_if(lambda n: n != "finger", PICTURES))
def test_picture_matches_reference(name, flexcam):
    done = flexcam("view", *PICTURES[name], *SIZE, "--save", "made.png")
    assert done.code == 0, done.err
    assert "Sizes chosen for the drawing:" in done.out
    assert open_picture("made.png").size == (400, 300)
    assert image_hash("made.png") - image_hash(ROOT / f"tests/data/pictures/{name}.png") <= MAX_HASH_DISTANCE


@pytest.mark.usefixtures("drawing")
def test_hash_distinguishes_angles_and_cases(flexcam):
    flexcam("view", INTAKE, "--at", "150deg", *SIZE, "--save", "made.png")
    assert image_hash("made.png") - image_hash(ROOT / "tests/data/pictures/intake.png") > MAX_HASH_DISTANCE
    assert image_hash("made.png") - image_hash(ROOT / "tests/data/pictures/finger.png") > 5 * MAX_HASH_DISTANCE


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_result_is_drawn_at_full_lift(flexcam, intake):
    read = read_result(intake)
    displacement = read.response["valve"].displacement
    full_lift = math.degrees(read.response.angle[np.argmax(np.abs(displacement))])
    assert flexcam("view", intake, *SIZE, "--save", "plain.png").code == 0
    assert flexcam("view", intake, *SIZE, "--at", f"{full_lift}deg", "--save", "top.png").code == 0
    assert flexcam("view", intake, *SIZE, "--at", "0deg", "--save", "start.png").code == 0
    assert np.array_equal(open_picture("plain.png"), open_picture("top.png"))
    assert not np.array_equal(open_picture("plain.png"), open_picture("start.png"))


@pytest.mark.parametrize(
    ("first", "title"), [(0.0, "cam angle 10.0 deg"), (1080.0, "cam angle 10.0 deg of the last revolution")]
)
def test_title_shows_angle_within_revolution(first, title):
    motion = case_motion(build_structure(build_model(read_case(FINGER))), 100.0, count=36)
    later = replace(motion, angle=motion.angle + np.radians(first))
    assert later.words(1, "A title", 2.0) == f"A title\n{title}\nelastic part x 2"


@pytest.mark.usefixtures("drawing")
def test_colour_range_of_still_picture():
    """A movie has the range of the complete motion; a picture has the range up to the maximum at its instant."""
    from flexcam.plotting.rendering import MechanismView

    structure = build_structure(build_model(read_case(INTAKE)))
    motion = case_motion(structure, 100.0, "displacement", count=36)
    still_maximum, motion_maximum = float(motion.values[12].max()), float(motion.values.max())
    assert 0.0 < still_maximum < 0.7 * motion_maximum
    stage = MechanismView(build_mechanism(structure), motion, off_screen=True, size=(200, 150))
    (bar,) = stage.plotter.scalar_bars.values()
    for show, maximum in ((stage.show, motion_maximum), (stage.show_alone, still_maximum)):
        show(12)
        assert bar.lookup_table.GetTableRange() == pytest.approx((0.0, maximum), rel=1e-12)  # VTK stores doubles
    stage.plotter.close()


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_result_coloured_by_stress(flexcam, intake, tmp_path):
    """The picture shows the same scene at the given angle, with coloured members."""
    copied_result = shutil.copy(intake, tmp_path / "elsewhere.vtkhdf")
    plain = ("view", copied_result, *SIZE, "--at", "180deg")
    assert flexcam(*plain, "--save", "plain.png").code == 0
    report = flexcam(*plain, "--save", "stress.png", "--color", "stress_von_mises", "--json").json
    assert report["files"] == ["stress.png"]
    assert any("valve head" in line for line in report["drawn"])
    assert image_hash("plain.png") - image_hash(ROOT / "tests/data/pictures/intake.png") <= MAX_HASH_DISTANCE
    assert count_colours("plain.png", members=False) > 500
    assert count_colours("stress.png", members=True) > 500


def count_colours(path, *, members):
    """Count the pixels in green and purple of viridis right of its middle, or in the orange of the lobe."""
    pixels = np.asarray(open_picture(path, "RGB")).reshape(-1, 3).astype(int).tolist()
    if members:
        return sum(g > r + 40 or b > g + 25 for r, g, b in pixels)
    return sum(r > 100 and r > 2 * b and g < 0.6 * r for r, g, b in pixels)


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_movie_shows_motion_of_cam(flexcam, intake, monkeypatch):
    monkeypatch.setattr("flexcam.plotting.rendering.FRAMES", 5)
    for name in ("train.gif", "train.mp4"):
        done = flexcam("view", intake, "--size", "320x240", "--save", name)
        assert done.code == 0, done.err
    with Image.open("train.gif") as film:
        assert (film.n_frames, film.size) == (5, (320, 240))
        for i in range(5):
            film.seek(i)
            film.save(f"{i}.png")
    hashes = [image_hash(f"{i}.png") for i in range(5)]
    assert any(frame_hash - hashes[0] > 0 for frame_hash in hashes)
    assert Path("train.mp4").read_bytes()[4:8] == b"ftyp"
    assert Path("train.mp4").stat().st_size > 2000


@pytest.mark.slow
def test_page_is_self_contained(flexcam, tmp_path):
    """The page contains the motion, to 1/65535 of its box; it loads no other file, and the title is escaped."""
    case = tmp_path / "case.toml"
    text = FINGER.read_text(encoding="utf-8").replace('title = "Roller finger', 'title = "<b>&Roller finger')
    case.write_text(text, encoding="utf-8")
    assert flexcam("view", case, "--at", "236deg", "--save", "page.html").code == 0
    page = Path("page.html").read_text(encoding="utf-8")
    assert "<title>&lt;b&gt;&amp;Roller finger follower" in page
    assert not re.search(r"https?://|<script[^>]+src=|<link[^>]+href=", page)
    data = json.loads(re.search(r'id="data">(.*)</script>', page)[1])
    assert len(data["labels"]) == 73  # and the instant of --at
    assert data["labels"][data["still"]].endswith("cam angle 236.0 deg")
    structure = build_structure(build_model(read_case(FINGER)))
    motion = case_motion(structure, 100.0)
    parts = collect_parts(build_mechanism(structure), motion.at([motion.nearest(math.radians(236.0))]))
    points = np.concatenate([part.points[0] for part in parts])
    shown = []
    for part in data["parts"]:
        rows = np.frombuffer(base64.b64decode(part["points"]), "<u2").reshape(-1, part["count"], 4)[:, :, :3]
        shown.append(rows[data["still"] % len(rows)])
    assert len(data["parts"]) == len(parts) >= 8
    box = np.array(data["low"]) + np.array(data["span"]) * np.concatenate(shown) / 65535.0
    size = np.ptp(points, axis=0)
    assert np.ptp(box, axis=0) / np.ptp(box[:, 0]) == pytest.approx(size / size[0], abs=0.02)
    away = np.ptp(points[:, 1]) / np.ptp(box[:, 1]) * box - points
    assert np.ptp(away, axis=0).max() < 2e-2 * size.max()


@pytest.mark.slow
def test_page_animation_in_browser(flexcam):
    """In Chromium, without errors: another instant and a rotation by the arrow keys change the picture."""
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("NO BROWSER WAS TRIED: no chromium; apt-get install chromium")
    from playwright.sync_api import sync_playwright

    assert flexcam("view", INTAKE, "--save", "page.html").code == 0
    messages, drawn = [], []
    software = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=found, args=software)
        tab = chromium.new_page(viewport={"width": 400, "height": 300})
        tab.on("console", lambda event: messages.append(event.text))
        tab.on("pageerror", lambda fault: messages.append(str(fault)))
        tab.goto(Path("page.html").resolve().as_uri())
        tab.click("#play")
        for i in (0, 36):
            tab.evaluate(f"() => {{ slide.value = {i}; slide.oninput(); }}")
            drawn.append(Image.open(io.BytesIO(tab.screenshot())))
        tab.focus("#canvas")
        for _ in range(5):
            tab.keyboard.press("ArrowLeft")
        drawn.append(Image.open(io.BytesIO(tab.screenshot())))
        chromium.close()
    assert messages == []
    colour_counts = [len(screenshot.crop((0, 40, 400, 260)).convert("RGB").getcolors(100000)) for screenshot in drawn]
    assert min(colour_counts) > 100
    first, second, rotated = (np.asarray(screenshot.convert("L"), dtype=float) for screenshot in drawn)
    assert np.abs(second - first).max() > 50
    assert np.abs(rotated - second).max() > 50


def test_view_does_not_overwrite_picture(flexcam, tmp_path):
    (tmp_path / "made.png").write_text("mine")
    refused = flexcam("view", FINGER, "--save", "made.png")
    assert refused.code == 2
    assert "Use --overwrite, or give another output name" in refused.err
    assert (tmp_path / "made.png").read_text() == "mine"


REFUSED = {
    ("--save", "made.bmp"): "a name that ends in one of .png, .gif, .mp4, .html",
    ("--save", "a.png", "--size", "big"): "WIDTHxHEIGHT",
    ("--save", "a.png", "--size", "10x100000"): "WIDTHxHEIGHT",
    ("--save", "a.mp4", "--size", "401x300"): "even numbers",
    ("--save", "a.png", "--mode", "0"): "as flexcam modes counts them",
    ("--save", "a.png", "--mode", "100000"): "as flexcam modes counts them",
    ("--save", "a.png", "--color", "stress_von_mises"): "Solve it with flexcam run",
    ("--save", "a.png", "--color", "velocity", "--mode", "1"): "The amplitude of a mode is arbitrary",
}


@pytest.mark.parametrize("words", REFUSED, ids=" ".join)
def test_view_refuses_unsuitable_options(words, flexcam, tmp_path):
    refused = flexcam("view", FINGER, *words)
    assert refused.code == 2
    assert REFUSED[words] in refused.err
    assert not list(tmp_path.iterdir())


def test_view_of_result_refuses_unknown_field_and_override(flexcam, intake):
    refused = flexcam("view", intake, "--color", "stress_von_mise", "--save", "a.png")
    assert refused.code == 2
    assert "Did you mean 'stress_von_mises'" in refused.err
    assert flexcam("view", intake, "--set", "run.speed=3rpm", "--save", "a.png").code == 2


EXTRAS = [("a.gif", "imageio", "movie"), ("a.mp4", "imageio_ffmpeg", "movie")]


@pytest.mark.parametrize(("name", "module", "extra"), EXTRAS)
def test_missing_extra_is_named(name, module, extra, flexcam, monkeypatch):
    from importlib.util import find_spec

    monkeypatch.setattr(
        "flexcam.core.errors.find_spec", lambda package: None if package == module else find_spec(package)
    )
    refused = flexcam("view", FINGER, "--save", name)
    assert refused.code == 2
    assert f"annot import {module}" in refused.err
    assert f"pip install 'flexcam[{extra}]'" in refused.err


def test_view_without_display_and_file_is_refused(flexcam, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(rendering.sys, "platform", "linux")
    refused = flexcam("view", FINGER)
    assert refused.code == 2
    assert "Add --save picture.png" in refused.err


@pytest.mark.parametrize("words", [("--save", "a.png"), ()], ids=["off-screen", "window"])
def test_crash_of_renderer_is_reported(words, flexcam, monkeypatch, tmp_path):
    """Without libEGL or libGL, VTK aborts its process; here a process that aborts replaces it."""
    monkeypatch.setattr(
        rendering, "_PROBE", "import os, sys; sys.stderr.write('(12s) [7F] x: 150 WARN| no GL\\n'); os.abort()"
    )
    monkeypatch.setenv("DISPLAY", ":0")
    rendering._test_renderer.cache_clear()
    failed = flexcam("view", FINGER, *words)
    rendering._test_renderer.cache_clear()
    assert failed.code == 3
    assert "no-rendering: rendering does not work on this system: no GL" in failed.err
    assert "apt-get install libgl1 libegl1" in failed.err
    assert not list(tmp_path.iterdir())


WINDOW = """
import functools
import sys
from flexcam import read_case
from flexcam.case.builder import build_model
from flexcam.plotting.scene.motion import case_motion
from flexcam.plotting.scene.mechanism import build_mechanism
from flexcam.valvetrain import build_structure
from flexcam.plotting.rendering import select_renderer
select_renderer(off_screen=False)
from flexcam.plotting.rendering import MechanismView
structure = build_structure(build_model(read_case(sys.argv[1])))
motion = case_motion(structure, 100.0)
stage = MechanismView(build_mechanism(structure), motion, off_screen=False, size=(400, 300), title=sys.argv[3])
stage.plotter.show = functools.partial(stage.plotter.show, interactive=False, auto_close=False)
stage.open_window(0, swings=False)
slider = stage.plotter.widgets.slider_widgets[0]
slider.GetRepresentation().SetValue(236.0)
slider.InvokeEvent("InteractionEvent")
slider.Off()
stage.plotter.render()
stage.plotter.screenshot(sys.argv[2])
"""


@pytest.mark.slow
def test_window_slider_sets_cam_angle(on_a_screen, tmp_path):
    """In a window on a virtual display, as if the user moves the slider."""
    if shutil.which("xvfb-run") is None:
        if os.environ.get("FLEXCAM_REQUIRE_PARAVIEW") == "1":
            pytest.fail("FLEXCAM_REQUIRE_PARAVIEW=1, but xvfb-run cannot be found")
        pytest.skip("NO WINDOW WAS OPENED: no xvfb-run; apt-get install xvfb xauth")
    made = tmp_path / "window.png"
    command = [*on_a_screen, sys.executable, "-c", WINDOW, FINGER, made, TITLE]
    environment = {name: value for name, value in os.environ.items() if name != "VTK_DEFAULT_OPENGL_WINDOW"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 0, done.stderr
    assert image_hash(made) - image_hash(ROOT / "tests/data/pictures/finger.png") <= MAX_HASH_DISTANCE


@pytest.mark.parametrize(
    ("option", "given", "message"),
    [("--at", "nan", "180 deg"), ("--scale", "inf", "finite"), ("--mode", "0", "at least 1")],
)
def test_view_refuses_invalid_numbers(flexcam, tmp_path, option, given, message):
    case = tmp_path / "train.toml"
    assert flexcam("new", "lumped-train", "-o", case).code == 0
    done = flexcam("view", case, option, given, "--save", tmp_path / "x.png")
    assert (done.code, option in done.err, message in done.err) == (2, True, True)
