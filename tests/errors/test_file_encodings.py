"""What files may hold besides plain letters: marks of byte order, decimal commas, commands to terminals, any script."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure

from flexcam import InputError, prepare, read_case, solve
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


def test_a_mark_of_byte_order_is_no_part_of_a_case(case):
    """Editors of Windows write it."""
    assert read_case(case(encoding="utf-8-sig")).record == read_case(case()).record


@pytest.mark.parametrize("given", ["40,5 kN/m", "40,5"])
def test_a_decimal_comma_is_named(case, given):
    with pytest.raises(InputError) as refused:
        read_case(case(("40 kN/m", given)))
    (fault,) = refused.value.faults
    assert fault.where.startswith("springs.hold.stiffness")
    assert "comma" in fault.remedy


@pytest.fixture
def ended(capsys):
    """Return what a command prints, on either stream, and its exit code."""

    def run(*words):
        with pytest.raises(SystemExit) as stop:
            main([str(word) for word in words])
        captured = capsys.readouterr()
        return captured.out + captured.err, stop.value.code

    return run


COMMAND = "\\u001b]0;owned\\u0007\\u009b31m :bug: [bold]"
"""A title that would name the window, colour what follows, and be drawn as a picture or bold."""


def test_a_title_commands_no_terminal(case, ended, tmp_path):
    path = case(("TITLE", COMMAND))
    ready = prepare(read_case(path))
    file = open_result_file(ready, tmp_path)
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[file]).status.ok
    for words in (("check", path), ("info", file.path), ("run", path, "-o", tmp_path / "results")):
        told, code = ended(*words)
        assert code == 0, told
        assert r"\x1b]0;owned\x07\x9b31m :bug: [bold]" in told
        assert not set(told) & {"\x1b", "\x07", "\x9b"}


def test_a_refusal_commands_no_terminal(case, ended):
    told, code = ended("check", case(("hold =", '"a\\u001b[31mb" =')))
    assert code == 2
    assert r"a\x1b[31mb" in told
    assert "\x1b" not in told


def test_letters_that_a_font_lacks_are_drawn_in_silence(tmp_path):
    """Warnings are errors in these tests; on the command line they would be lines of Python."""
    figure = Figure()
    figure.subplots().set_title("\u52d5\u5f01 \u001b")
    assert save_figure(figure, tmp_path / "drawn.png").stat().st_size > 0


def test_the_line_in_which_two_cases_differ():
    """Counted as an editor does, whatever letters a comment holds."""
    then = "# a\x85b\u2028c\nformat = 1\nspeed = 3\n"
    (fault,) = find_differences({"case": then.replace("3", "4")}, {"case": then})
    assert fault.where == "--resume: the text of the case, line 3"
    assert (fault.given, fault.allowed) == ("speed = 4", "speed = 3")
