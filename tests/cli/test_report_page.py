"""A report in a browser: no network access, no errors, zoomed curves, changed probes, animation of modes, keyboard use.

The browser is Debian's Chromium, controlled by playwright. FLEXCAM_REQUIRE_PARAVIEW=1 makes a missing browser an error.
"""

import os
import shutil

import pytest

from flexcam import prepare, read_case, solve
from flexcam.analysis.run import open_result_file
from flexcam.report.content import load_subject
from flexcam.report.page import build_report, render_page

BROWSERS = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser():
    """Return a browser without network access."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None and os.environ.get("FLEXCAM_REQUIRE_PARAVIEW") == "1":
        pytest.fail("FLEXCAM_REQUIRE_PARAVIEW=1, but chromium cannot be found")
    if found is None:
        pytest.skip("NO BROWSER WAS TRIED: no chromium; apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def report_file(tmp_path_factory, tayeb):
    """Return the report of two results of a published case."""
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
def open_page(browser, report_file):
    """Open the report and record its messages and requests."""
    tab = browser.new_page(viewport={"width": 1280, "height": 900})
    messages, fetched = [], []
    tab.on("console", lambda event: messages.append(event.text))
    tab.on("pageerror", lambda fault: messages.append(str(fault)))
    tab.on("request", lambda event: fetched.append(event.url))
    tab.goto(report_file.as_uri())
    tab.wait_for_selector("#chart-0 .main-svg")
    yield tab, messages, fetched
    tab.close()


@pytest.fixture
def page(open_page, report_file):
    """Return the open report in its initial state; check afterwards that it loaded only itself and raised no error."""
    tab, messages, fetched = open_page
    tab.select_option("#pick-0", index=0)
    tab.check("#rigid")
    tab.click("#whole")
    yield tab
    tab.emulate_media(media="screen")
    tab.set_viewport_size({"width": 1280, "height": 900})
    assert messages == []
    assert [url for url in fetched if not url.startswith(("data:", "blob:"))] == [report_file.as_uri()]


def wait_until(page, question):
    """Wait until an expression is true; the page's policy forbids the evaluation of text by playwright itself."""
    for _ in range(200):
        if page.evaluate(question):
            return
        page.wait_for_timeout(25)
    pytest.fail(f"not within 5 s: {question}")


def visible_range(page, chart="chart-0"):
    """Return the range of the cam angle in a chart, deg."""
    return [round(end, 3) for end in page.evaluate(f"document.getElementById('{chart}')._fullLayout.xaxis.range")]


def first_curve(page):
    """Return the label of the vertical axis and the maximum of the first curve in the first chart."""
    return page.evaluate(
        "(() => { const c = document.getElementById('chart-0');"
        " return [c._fullLayout.yaxis.title.text, Math.max(...c._fullData[0].y)]; })()"
    )


def canvas_image(page):
    return page.evaluate("document.querySelector('canvas').toDataURL()")


@pytest.mark.slow
def test_zoom_applies_to_all_charts(page):
    """By numbers, buttons and mouse."""
    assert visible_range(page) == [0, 720]
    page.fill("#from", "90")
    page.fill("#to", "270")
    page.press("#to", "Enter")
    assert visible_range(page) == visible_range(page, "chart-1") == [90, 270]
    page.click("#last")
    assert visible_range(page) == [360, 720]
    box = page.locator("#chart-0 .nsewdrag").first.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 4, y)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, y, steps=5)
    page.mouse.up()
    wait_until(page, "document.getElementById('chart-1')._fullLayout.xaxis.range[0] > 440")
    first, last = visible_range(page)
    assert (first, last) == pytest.approx((450, 540), abs=2)
    assert float(page.input_value("#from")) == pytest.approx(first, abs=1e-2)
    page.click("#whole")
    assert visible_range(page) == [0, 720]


def test_charts_have_no_upload_button(page):
    """The default buttons of plotly.js include an upload."""
    titles = page.evaluate("[...document.querySelectorAll('.modebar-btn')].map(b => b.dataset.title || b.ariaLabel)")
    assert titles
    assert not [
        title for title in titles if any(word in title.lower() for word in ("share", "cloud", "upload", "edit"))
    ]


def test_selected_probe_is_drawn(page):
    assert first_curve(page)[0] == "displacement<br>mm"
    before = first_curve(page)[1]
    page.select_option("#pick-0", label="cam.rx")
    assert first_curve(page)[0] == "displacement<br>deg"
    assert first_curve(page)[1] != before
    page.get_by_text("In words").first.click()
    assert "deg at" in page.inner_text("#words-0")


def test_rigid_curves_can_be_hidden(page):
    count = "document.getElementById('chart-0').data.length"
    both = page.evaluate(count)
    page.uncheck("#rigid")
    assert page.evaluate(count) == both / 2


def test_mode_animation_by_keyboard(page):
    """Tab moves the focus to the drawing; space starts the animation, arrow keys rotate the view."""
    page.focus("figure.scene .size")
    for _ in range(9):
        if page.evaluate("document.activeElement.tagName") == "CANVAS":
            break
        page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.tagName") == "CANVAS"
    initial = canvas_image(page)
    page.keyboard.press("ArrowLeft")
    rotated = canvas_image(page)
    assert rotated != initial
    page.keyboard.press("Space")
    assert page.get_attribute("figure.scene .play", "aria-pressed") == "true"
    wait_until(page, f"document.querySelector('canvas').toDataURL() !== '{rotated}'")
    page.keyboard.press("Space")
    phase = page.get_attribute("figure.scene", "data-phase")
    page.wait_for_timeout(100)
    assert page.get_attribute("figure.scene", "data-phase") == phase


def test_animation_of_run(page):
    page.locator("figure.scene .shape").first.select_option(label="the run")
    assert "Drawn" in page.locator("figure.scene .words").first.inner_text()
    before = canvas_image(page)
    page.locator("figure.scene .play").first.click()
    wait_until(page, "Number(document.querySelector('figure.scene').dataset.phase) > 0.02")
    page.locator("figure.scene .play").first.click()
    assert canvas_image(page) != before


@pytest.mark.parametrize("width", [360, 1280])
def test_page_fits_into_window_width(width, page):
    """Only tables and the case have scroll bars."""
    page.set_viewport_size({"width": width, "height": 800})
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_printed_page_has_static_figure(page):
    """The printed page shows the static figure in place of the charts and no interactive controls."""
    page.emulate_media(media="print")
    visible = "e => e.getClientRects().length > 0"
    assert page.eval_on_selector(".still", visible)
    assert page.eval_on_selector_all(".controls, .album, nav", f"all => all.filter({visible}).length") == 0
    assert page.eval_on_selector("pre", "e => e.scrollHeight <= e.clientHeight + 1")


@pytest.mark.slow
def test_page_without_scripts_shows_static_figure(browser, report_file):
    """Without scripts, a static figure replaces the curves; the other content remains."""
    context = browser.new_context(java_script_enabled=False)
    bare = context.new_page()
    bare.goto(report_file.as_uri())
    assert bare.locator(".still img").is_visible()
    assert not bare.locator("canvas").first.is_visible()
    assert "scripts switched off" in bare.inner_text("#curves")
    context.close()
