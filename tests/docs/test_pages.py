"""Tutorials, topics and how-to pages: their code runs, their commands end as they should, their output is true."""

from __future__ import annotations

import contextlib
import io
import shlex
import shutil
import signal

import pytest

from flexcam.cli.app import run_state
from flexcam.cli.main import main
from tests.docs.pages import PAGES, ROOT, adds, assert_shown, blocks, keep, name_of

OTHERS = ("cd", "dask", "paraview", "pip", "pvbatch", "python")
"""Commands that pages name and this test does not run."""

PLAIN = [page for page in PAGES if not adds(page)]
"""Pages that change no file of flexcam."""

LONG = ("measured-lift.md", "published-cam.md", "pushrod-engine.md", "redesign.md")
"""Tutorials of more than a second each, which CI follows too."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with the cases beside it, in which commands find no terminal and leave no signal handlers."""
    for name in ("cases", "meshes"):
        shutil.copytree(ROOT / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(run_state, "solving", False)
    return tmp_path


def command(line, code):
    """Run one line of a shell block in this process."""
    given = shlex.split(line, comments=True)
    if not given or given[0] in OTHERS:
        return
    assert given[0] == "flexcam", f"no command of this project: {line}"
    run_state.solving = False
    with pytest.raises(SystemExit) as ended:
        main(given[1:])
    assert ended.value.code == code, line


def shell(text, code):
    for line in text.replace("\\\n", " ").splitlines():
        command(line, code)


def follow(page, folder, slow):
    """Do what a page says, block by block."""
    names, printed = {"__name__": "page"}, ""
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.slow and not slow:
            printed = None
        elif block.language == "text":
            if printed is not None:
                assert_shown(block.text, printed, where)
        elif block.caption:
            keep(folder / block.caption, block)
        else:
            with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
                if block.language == "python":
                    exec(compile("\n" * block.line + block.text, str(page), "exec"), names)  # noqa: S102
                elif block.language == "sh":
                    shell(block.text, block.code)
            printed = out.getvalue()
            assert "Traceback" not in printed, where


@pytest.mark.parametrize(
    "page", [pytest.param(page, marks=[pytest.mark.slow] * (page.name in LONG), id=name_of(page)) for page in PLAIN]
)
def test_page(page, folder):
    follow(page, folder, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in PLAIN if any(b.slow for b in blocks(p))], ids=name_of)
def test_page_with_what_takes_long(page, folder):
    follow(page, folder, slow=True)


def test_there_are_pages():
    assert len(PAGES) >= 15


def test_every_page_stands_in_its_index():
    for page in PAGES:
        index = (page.parent / "index.md").read_text(encoding="utf-8")
        assert page.stem == "index" or f"\n{page.stem}\n" in index, f"{name_of(page)} stands in no index"


def test_a_false_output_is_found(tmp_path, folder):
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(2 + 2)\n```\n\n```text\n5\n```\n")
    with pytest.raises(AssertionError, match="the page shows"):
        follow(page, folder, slow=False)
