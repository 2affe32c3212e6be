"""Encodings and special characters in case files: byte order marks, decimal commas, control characters, Unicode."""

import pytest
from matplotlib.figure import Figure

from flexcam import prepare, read_case, solve
from flexcam.analysis.run import find_differences, open_result_file
from flexcam.cli.main import main
from flexcam.plotting.figures import save_figure

SMALL = """
format = 1
title = "TITLE"
nodes = { free = ["0 mm", "0 mm", "0 mm"] }
masses = { body = { at = "free", mass = "0.1 kg" } }
springs = { hold = { at = "free", direction = "uy", stiffness = "40 kN/m" } }
run = { speed = "3000 rpm", revolutions = 0.1, steps_per_revolution = 360 }
output = { probes = ["free"] }
"""


@pytest.fixture
def case(tmp_path):
    def write(*changes, encoding="utf-8"):
        text = SMALL
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "case.toml"
        path.write_text(text, encoding=encoding)
        return path

    return write


def test_byte_order_mark_is_ignored(case):
    """Editors on Windows write a byte order mark."""
    assert read_case(case(encoding="utf-8-sig")).record == read_case(case()).record


@pytest.fixture
def run_command(capsys):
    """Return a function that runs a command and returns its output on both streams and its exit code."""

    def run(*words):
        with pytest.raises(SystemExit) as stop:
            main([str(word) for word in words])
        captured = capsys.readouterr()
        return captured.out + captured.err, stop.value.code

    return run


CONTROL_TITLE = "\\u001b]0;owned\\u0007\\u009b31m :bug: [bold]"
"""Title that would rename the terminal window, set a colour, and be rendered as an emoji or in bold."""


def test_control_characters_of_title_are_escaped(case, run_command, tmp_path):
    path = case(("TITLE", CONTROL_TITLE))
    ready = prepare(read_case(path))
    file = open_result_file(ready, tmp_path)
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[file]).status.ok
    for words in (("check", path), ("info", file.path), ("run", path, "-o", tmp_path / "results")):
        printed, code = run_command(*words)
        assert code == 0, printed
        assert r"\x1b]0;owned\x07\x9b31m :bug: [bold]" in printed
        assert not set(printed) & {"\x1b", "\x07", "\x9b"}


def test_control_characters_in_error_message_are_escaped(case, run_command):
    printed, code = run_command("check", case(("hold =", '"a\\u001b[31mb" =')))
    assert code == 2
    assert r"a\x1b[31mb" in printed
    assert "\x1b" not in printed


def test_missing_glyphs_cause_no_warning(tmp_path):
    """Warnings are errors in these tests; on the command line they would be Python output."""
    figure = Figure()
    figure.subplots().set_title("\u52d5\u5f01 \u001b")
    assert save_figure(figure, tmp_path / "drawn.png").stat().st_size > 0


def test_difference_of_cases_names_line():
    """Lines are counted as in an editor, whatever characters a comment contains."""
    then = "# a\x85b\u2028c\nformat = 1\nspeed = 3\n"
    (fault,) = find_differences({"case": then.replace("3", "4")}, {"case": then})
    assert fault.where == "--resume: the text of the case, line 3"
    assert (fault.given, fault.allowed) == ("speed = 4", "speed = 3")
