"""Tutorials, topics and how-to pages: code runs, commands end with the stated exit code, outputs are as shown."""

import contextlib
import io
import shlex
import shutil
import signal

import pytest

from flexcam.cli.app import run_state
from flexcam.cli.main import main
from tests.docs.pages import PAGES, ROOT, assert_shown, blocks, changes_package, page_name, write_block

EXTERNAL_COMMANDS = ("cd", "dask", "paraview", "pip", "pvbatch", "python")
"""Commands on pages that this test does not run."""

RUN_PAGES = [page for page in PAGES if not changes_package(page)]
"""Pages that change no file of flexcam."""

LONG = ("measured-lift.md", "published-cam.md", "pushrod-engine.md", "redesign.md")
"""Tutorials of more than a second each, which CI runs too."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with copies of the cases, in which commands have no terminal and set no signal handlers."""
    for name in ("cases", "meshes"):
        shutil.copytree(ROOT / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(run_state, "solving", False)
    return tmp_path


def run_command(line, code):
    """Run one line of a shell block in this process."""
    given = shlex.split(line, comments=True)
    if not given or given[0] in EXTERNAL_COMMANDS:
        return
    assert given[0] == "flexcam", f"no command of this project: {line}"
    run_state.solving = False
    with pytest.raises(SystemExit) as ended:
        main(given[1:])
    assert ended.value.code == code, line


def run_shell_block(text, code):
    for line in text.replace("\\\n", " ").splitlines():
        run_command(line, code)


def run_page(page, folder, slow):
    """Run the blocks of a page in order."""
    names, printed = {"__name__": "page"}, ""
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.slow and not slow:
            printed = None
        elif block.language == "text":
            if printed is not None:
                assert_shown(block.text, printed, where)
        elif block.caption:
            write_block(folder / block.caption, block)
        else:
            with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
                if block.language == "python":
                    exec(compile("\n" * block.line + block.text, str(page), "exec"), names)  # noqa: S102
                elif block.language == "sh":
                    run_shell_block(block.text, block.code)
            printed = out.getvalue()
            assert "Traceback" not in printed, where


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[pytest.mark.slow] * (page.name in LONG), id=page_name(page)) for page in RUN_PAGES],
)
def test_page_runs_as_shown(page, folder):
    run_page(page, folder, slow=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in RUN_PAGES if any(b.slow for b in blocks(p))], ids=page_name)
def test_page_with_slow_blocks_runs_as_shown(page, folder):
    run_page(page, folder, slow=True)


def test_number_of_pages():
    assert len(PAGES) >= 15


def test_all_pages_are_in_their_index():
    for page in PAGES:
        index = (page.parent / "index.md").read_text(encoding="utf-8")
        assert page.stem == "index" or f"\n{page.stem}\n" in index, f"{page_name(page)} is in no index"


def test_wrong_output_is_detected(tmp_path, folder):
    page = tmp_path / "page.md"
    page.write_text("```python\nprint(2 + 2)\n```\n\n```text\n5\n```\n")
    with pytest.raises(AssertionError, match="the page shows"):
        run_page(page, folder, slow=False)
