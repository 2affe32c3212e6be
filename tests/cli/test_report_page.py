"""A report in a browser: nothing fetched, no fault, a curve zoomed, a probe switched, a mode animated, by keys alone.

Debian's Chromium, driven by playwright. Set FLEXCAM_REQUIRE_PARAVIEW=1 where it must run.
"""

from __future__ import annotations

import os
import shutil

import pytest

from flexcam import prepare, read_case, solve
from flexcam.analysis.run import open_result_file
from flexcam.report.content import load_subject
from flexcam.report.page import build_report, render_page

NAMES = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser():
    """Return a browser that has no network."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None and os.environ.get("FLEXCAM_REQUIRE_PARAVIEW") == "1":
        pytest.fail("FLEXCAM_REQUIRE_PARAVIEW=1, but chromium cannot be found")
    if found is None:
        pytest.skip("NO BROWSER WAS TRIED: no chromium; apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def written(tmp_path_factory, tayeb):
    """Return the page of two results of a published case."""
    folder = tmp_path_factory.mktemp("report")
    paths = []
    for speed in (3000, 3300):
        ready = prepare(read_case(tayeb(1), [f"run.speed={speed}rpm", "run.steps_per_revolution=720"]))
        sink = open_result_file(ready, folder / str(speed))
        assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink]).status.ok
        paths.append(sink.path)
    file = folder / "report.html"
    file.write_text(render_page(build_report([load_subject(path) for path in paths])), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def opened(browser, written):
    """Open the page; at the end it has fetched nothing but itself and complained of nothing."""
    tab = browser.new_page(viewport={"width": 1280, "height": 900})
    said, fetched = [], []
    tab.on("console", lambda one: said.append(one.text))
    tab.on("pageerror", lambda fault: said.append(str(fault)))
    tab.on("request", lambda one: fetched.append(one.url))
    tab.goto(written.as_uri())
    tab.wait_for_selector("#chart-0 .main-svg")
    yield tab, said, fetched
    tab.close()


@pytest.fixture
def seen(opened, written):
    """Return the page as it opens; after a test it has fetched nothing but itself and complained of nothing."""
    tab, said, fetched = opened
    tab.select_option("#pick-0", index=0)
    tab.check("#rigid")
    tab.click("#whole")
    yield tab
    tab.emulate_media(media="screen")
    tab.set_viewport_size({"width": 1280, "height": 900})
    assert said == []
    assert [url for url in fetched if not url.startswith(("data:", "blob:"))] == [written.as_uri()]


def until(seen, question):
    """Wait until an expression is true; the page's policy lets playwright itself evaluate no text that stays."""
    for _ in range(200):
        if seen.evaluate(question):
            return
        seen.wait_for_timeout(25)
    pytest.fail(f"not within 5 s: {question}")


def shown(seen, chart="chart-0"):
    """Return the cam angles that a chart shows, deg."""
    return [round(end, 3) for end in seen.evaluate(f"document.getElementById('{chart}')._fullLayout.xaxis.range")]


def curve(seen):
    """Return the name of the vertical axis and the largest value of the first curve of the first chart."""
    return seen.evaluate(
        "(() => { const c = document.getElementById('chart-0');"
        " return [c._fullLayout.yaxis.title.text, Math.max(...c._fullData[0].y)]; })()"
    )


def drawn(seen):
    return seen.evaluate("document.querySelector('canvas').toDataURL()")


def test_a_curve_is_zoomed(seen):
    """By numbers, by buttons and by mouse; all charts follow."""
    assert shown(seen) == [0, 720]
    seen.fill("#from", "90")
    seen.fill("#to", "270")
    seen.press("#to", "Enter")
    assert shown(seen) == shown(seen, "chart-1") == [90, 270]
    seen.click("#last")
    assert shown(seen) == [360, 720]
    box = seen.locator("#chart-0 .nsewdrag").first.bounding_box()
    y = box["y"] + box["height"] / 2
    seen.mouse.move(box["x"] + box["width"] / 4, y)
    seen.mouse.down()
    seen.mouse.move(box["x"] + box["width"] / 2, y, steps=5)
    seen.mouse.up()
    until(seen, "document.getElementById('chart-1')._fullLayout.xaxis.range[0] > 440")
    first, last = shown(seen)
    assert (first, last) == pytest.approx((450, 540), abs=2)
    assert float(seen.input_value("#from")) == pytest.approx(first, abs=1e-2)
    seen.click("#whole")
    assert shown(seen) == [0, 720]


def test_no_button_sends_a_chart_anywhere(seen):
    """plotly.js would offer to upload it."""
    titles = seen.evaluate("[...document.querySelectorAll('.modebar-btn')].map(b => b.dataset.title || b.ariaLabel)")
    assert titles
    assert not [one for one in titles if any(word in one.lower() for word in ("share", "cloud", "upload", "edit"))]


def test_a_probe_is_switched(seen):
    assert curve(seen)[0] == "displacement<br>mm"
    before = curve(seen)[1]
    seen.select_option("#pick-0", label="cam.rx")
    assert curve(seen)[0] == "displacement<br>deg"
    assert curve(seen)[1] != before
    seen.get_by_text("In words").first.click()
    assert "deg at" in seen.inner_text("#words-0")


def test_the_rigid_train_comes_and_goes(seen):
    count = "document.getElementById('chart-0').data.length"
    both = seen.evaluate(count)
    seen.uncheck("#rigid")
    assert seen.evaluate(count) == both / 2


def test_a_mode_is_animated_by_keys_alone(seen):
    """Tab leads to the drawing; space plays it, arrows turn it."""
    seen.focus("figure.scene .size")
    for _ in range(9):
        if seen.evaluate("document.activeElement.tagName") == "CANVAS":
            break
        seen.keyboard.press("Tab")
    assert seen.evaluate("document.activeElement.tagName") == "CANVAS"
    still = drawn(seen)
    seen.keyboard.press("ArrowLeft")
    turned = drawn(seen)
    assert turned != still
    seen.keyboard.press("Space")
    assert seen.get_attribute("figure.scene .play", "aria-pressed") == "true"
    until(seen, f"document.querySelector('canvas').toDataURL() !== '{turned}'")
    seen.keyboard.press("Space")
    halted = seen.get_attribute("figure.scene", "data-phase")
    seen.wait_for_timeout(100)
    assert seen.get_attribute("figure.scene", "data-phase") == halted


def test_the_run_is_animated(seen):
    seen.locator("figure.scene .shape").first.select_option(label="the run")
    assert "Drawn" in seen.locator("figure.scene .words").first.inner_text()
    before = drawn(seen)
    seen.locator("figure.scene .play").first.click()
    until(seen, "Number(document.querySelector('figure.scene').dataset.phase) > 0.02")
    seen.locator("figure.scene .play").first.click()
    assert drawn(seen) != before


@pytest.mark.parametrize("width", [360, 1280])
def test_nothing_hangs_over(width, seen):
    """Only tables and the case scroll by themselves."""
    seen.set_viewport_size({"width": width, "height": 800})
    seen.wait_for_timeout(300)
    assert seen.evaluate("document.documentElement.scrollWidth") <= width


def test_paper(seen):
    """The still picture stands for the charts, and nothing that only works on a screen is printed."""
    seen.emulate_media(media="print")
    visible = "e => e.getClientRects().length > 0"
    assert seen.eval_on_selector(".still", visible)
    assert seen.eval_on_selector_all(".controls, .album, nav", f"all => all.filter({visible}).length") == 0
    assert seen.eval_on_selector("pre", "e => e.scrollHeight <= e.clientHeight + 1")


@pytest.mark.slow
def test_without_scripts(browser, written):
    """What is left says everything but the curves, of which a picture remains."""
    context = browser.new_context(java_script_enabled=False)
    bare = context.new_page()
    bare.goto(written.as_uri())
    assert bare.locator(".still img").is_visible()
    assert not bare.locator("canvas").first.is_visible()
    assert "scripts switched off" in bare.inner_text("#curves")
    context.close()
