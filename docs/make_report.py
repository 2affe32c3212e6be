"""Make docs/pictures/report.png: a screenshot of the top of a report in Chromium."""

from __future__ import annotations

import io
import shutil
import tempfile
from pathlib import Path

from flexcam import prepare, read_case, solve
from flexcam.analysis.run import open_result_file
from flexcam.report.content import load_subject
from flexcam.report.page import build_report, render_page

ROOT = Path(__file__).parents[1]
SIZE = {"width": 1100, "height": 1330}
COLOURS = 64


def main() -> None:
    """Run the pushrod engine, write its report and take a screenshot."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        ready = prepare(read_case(ROOT / "cases/pushrod-engine/intake.toml"))
        sink = open_result_file(ready, folder)
        solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
        path = Path(folder) / "report.html"
        path.write_text(render_page(build_report([load_subject(sink.path)])), encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        tab = browser.new_page(viewport=SIZE)
        tab.goto(path.as_uri())
        tab.wait_for_selector("#chart-0 .main-svg")
        with Image.open(io.BytesIO(tab.screenshot())) as image:
            image.convert("RGB").quantize(COLOURS).save(ROOT / "docs/pictures/report.png", optimize=True)
        browser.close()


if __name__ == "__main__":
    main()
