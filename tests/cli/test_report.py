"""flexcam report: complete, failed and several results; without the case file; malicious strings; refusals."""

import json
import re
from pathlib import Path

import h5py
import pytest

from flexcam.io import write_digest, write_text
from flexcam.io.hdf5 import write_texts
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
MAX_PAGE_SIZE = 6_000_000
"""Maximum size of a page in bytes."""


def page_data(text):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])


def remove_scripts(page):
    return re.sub(r"<(script|style)>.*?</\1>", "", page, flags=re.S)


def page_text(page):
    """Return the visible text of a page, without scripts and tags."""
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", remove_scripts(page)))


@pytest.mark.slow
def test_report_content_without_case_file(flexcam, result, case):
    """The report from the result alone, after the case file is deleted, is identical."""
    done = flexcam("report", result, "--json")
    assert (done.code, done.err) == (0, "")
    assert done.json["file"] == str(result.with_suffix(".html"))
    assert done.json["warnings"] == {str(result): []}
    page = result.with_suffix(".html").read_text(encoding="utf-8")
    assert len(page.encode()) < MAX_PAGE_SIZE
    text = page_text(page)
    wanted = [
        "Nodes in the file, camshaft 3000 rpm", "The flexible result differs significantly", "deviates by up to",
        "Modelled with flexible beams: 2 members, 3 masses, 1 spring, 1 rocker, 1 cam, 1 contact",
        "Run at camshaft 3000 rpm for 1 revolution of the camshaft, in 720 steps (720 per revolution)",
        "Inactive: ",
        "published load", "buckling load of pushrod is", "Stresses at 37 saved instants", "Energy over the run",
        "what moves", "numpy", "members]", "[contacts.intake]",
    ]  # fmt: skip
    assert [words for words in wanted if words not in text] == []
    data = page_data(page)
    assert [album["title"] for album in data["albums"]] == ["Motion", "Forces and more", "Energy"]
    assert data["albums"][0]["charts"][0]["name"] == "valve"
    assert [shape["name"] for shape in data["scenes"][0]["shapes"]][-1] == "the run"
    assert list(data["scenes"][0]["lines"]) == ["camshaft", "pushrod"]
    case.unlink()
    write_text(result.with_suffix(".html"), "another", overwrite=True)
    assert flexcam("report", result, "--overwrite").code == 0
    assert result.with_suffix(".html").read_text(encoding="utf-8") == page


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text"), mostly_slow([("overrides", "[3]"), ("files", "no JSON"), ("files", '{"a.csv": null}')])
)
def test_damaged_case_texts_of_result_are_refused(flexcam, case, name, text, tmp_path):
    assert flexcam("run", case, "--set", "run.revolutions=0.02").code == 0
    path = tmp_path / "results/case.vtkhdf"
    with h5py.File(path, "r+") as file:
        del file[f"about/{name}"]
        write_texts(file["about"], {name: text})
        write_digest(file)
    for words in (("info", path), ("plot", path), ("report", path)):
        refused = flexcam(*words)
        assert (refused.code, "a result that keeps its case" in refused.err) == (2, True), refused.err


@pytest.mark.slow
def test_report_of_diverged_run(flexcam, case, tmp_path):
    run = flexcam("run", "case.toml", "-o", "out", "--set", "run.integrator.beta=0.01")
    assert run.code == 3
    assert "Fewer than two revolutions" not in run.out, "its status says how to complete it"
    assert flexcam("report", "out/case.partial.vtkhdf", "-o", "early.html").code == 0
    text = page_text((tmp_path / "early.html").read_text(encoding="utf-8"))
    assert "The run did not reach its end. not-finite" in text
    assert "The flexible result" not in text, "no verdict of half a run"


@pytest.mark.slow
def test_report_of_several_results(flexcam, case, result, tmp_path):
    assert flexcam("run", "case.toml", "-o", "fast", "--set", "run.speed=4000rpm").code == 0
    assert flexcam("report", result, "fast/case.vtkhdf", "--probe", "cam.rx", "-o", "both.html").code == 0
    page = (tmp_path / "both.html").read_text(encoding="utf-8")
    assert len(page.encode()) < MAX_PAGE_SIZE
    first = page_data(page)["albums"][0]["charts"][0]
    assert first["name"] == "cam.rx"
    names = [curve["name"] for curve in first["panels"][0]["curves"]]
    assert [name for name in names if "rigid" not in name] == ["case, camshaft 3000 rpm", "case, camshaft 4000 rpm"]
    assert "run.speed=4000rpm" in page_text(page)


@pytest.mark.slow
def test_report_escapes_scripts_in_case(flexcam, case, tmp_path):
    """The title and a comment of the case contain scripts."""
    text = case.read_text(encoding="utf-8")
    script = "</title><script>alert(1)</script>"
    text = text.replace('title = "Nodes in the file"', f"title = '{script}'") + f"\n# </pre></script>{script}\n"
    case.write_text(text, encoding="utf-8")
    assert flexcam("run", "case.toml", "-o", "out").code == 0
    assert flexcam("report", "out/case.vtkhdf").code == 0
    page = (tmp_path / "out/case.html").read_text(encoding="utf-8")
    assert script not in page
    visible = remove_scripts(page)
    assert visible.count("</title>") == visible.count("</pre>") == visible.count("</script>") == 1
    assert visible.count("&lt;script&gt;alert(1)") >= 3


@pytest.mark.slow
@pytest.mark.parametrize("model", ["rigid", "sdof"])
def test_report_of_reduced_models(model, flexcam, case, tmp_path):
    assert flexcam("run", "case.toml", "-o", "out", "--set", f"fidelity.model={model}").code == 0
    done = flexcam("report", "out/case.vtkhdf", "--json")
    assert done.code == 0
    assert {"rigid": "no stresses", "sdof": "no stresses and section forces"}[model] in str(done.json["warnings"])
    text = page_text((tmp_path / "out/case.html").read_text(encoding="utf-8"))
    assert ("The flexible result" in text) == (model != "rigid")
    assert "saved instants" not in text


@pytest.mark.slow
def test_report_with_errors_trade_and_limits(flexcam, case, tmp_path):
    """Errors, trade and limits run the case again, here with few steps.

    A published load has no contact loss: buckling is the only limit, and it is not reached.
    """
    assert flexcam("run", "case.toml", "-o", "out", "--set", "run.steps_per_revolution=60").code == 0
    assert flexcam("report", "out/case.vtkhdf", "--errors", "--trade", "--limits").code == 0
    page = (tmp_path / "out/case.html").read_text(encoding="utf-8")
    text = page_text(page)
    wanted = ["Estimated errors", "±", "Cost and error of models", "Best models in both",
              "No speed limit was found up to twice the speed"]  # fmt: skip
    assert [words for words in wanted if words not in text] == []
    assert remove_scripts(page).count('src="data:image/png') == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nosuch.vtkhdf"], "no such file"),
        (["case.toml"], "a result file of flexcam"),
        (["out/case.vtkhdf", "--probe", "valv"], "Did you mean 'valve'"),
        (["out/case.vtkhdf", "--probe", "cam"], "cam.uy"),
        (["out/case.vtkhdf", "-o", "a.pdf"], ".html"),
        (["out/case.vtkhdf", "-o", "case.toml/a.html"], "a folder with write permission"),
        (["out/case.vtkhdf", "-o", "taken.html"], "--overwrite"),
        ([], "results"),
    ],
)
def test_report_refuses_invalid_arguments(words, message, flexcam, result, tmp_path):
    write_text(tmp_path / "taken.html", "mine")
    before = sorted(tmp_path.rglob("*"))
    done = flexcam("report", *words)
    assert done.code == 2
    assert message in done.err
    assert sorted(tmp_path.rglob("*")) == before, "nothing is written"


@pytest.mark.slow
def test_report_needs_no_display(spawn, result, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    done = spawn("report", result)
    assert (done.code, done.err) == (0, "")
