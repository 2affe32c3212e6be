"""What refusals say: the version that is read, no hint at the key itself."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, read_case
from flexcam.case.curves import parse_law
from flexcam.case.reader import read_cams
from flexcam.core.errors import finite_array, refuse, suggest_name


def test_another_version_of_the_format(tmp_path):
    (tmp_path / "cams.toml").write_text('format = 2\n[cams.c]\nlaw = "shm"\nlift = "6 mm"\nrise = 1\nreturn = 1\n')
    with pytest.raises(InputError) as refusal:
        read_cams(tmp_path / "cams.toml")
    (fault,) = refusal.value.faults
    assert (fault.given, fault.allowed) == ("2", "1")
    assert "a newer flexcam" in fault.remedy


@pytest.mark.parametrize(("name", "known"), [
    ("missing.toml", "direct-acting.toml"), ("missing.toml", "ns.toml"), ("none.vtkhdf", "nn.vtkhdf"),
    ("nothing", "motion"), ("rear", "roller"),
])  # fmt: skip
def test_no_hint_at_distant_names(name, known):
    assert suggest_name(name, [known]) == ""


@pytest.mark.parametrize(("name", "known"), [
    ("splitt.toml", "split.toml"), ("shn", "shm"), ("rize", "rise"), ("SDOF", "sdof"), ("run.sped", "run.speed"),
    ("bwo.toml", "bow.toml"),
])  # fmt: skip
def test_hints_at_typing_errors(name, known):
    assert suggest_name(name, [known]) == f"did you mean {known!r}?"


def test_no_hint_at_what_was_written():
    assert suggest_name("exponents", ["exponents", "conditions"]) == ""
    assert suggest_name("contacts.a.force", ["contacts.a.force", "contacts.b.force"]) == ""
    with pytest.raises(InputError) as refusal:
        parse_law({"id": "polynomial", "exponents": ["x"]})
    assert "did you mean" not in str(refusal.value)


@pytest.mark.parametrize(("name", "meant"), [
    ("contacts.exhaust.force", "'contacts.intake.force' or 'contacts.seat.force'"),  # 'seat' has most letters of it
    ("contacts.intaek.force", "'contacts.intake.force'"),
])  # fmt: skip
def test_a_part_is_meant_by_its_name(name, meant):
    known = ["contacts.intake.force", "contacts.intake.torque", "contacts.seat.force", "springs.exhaust.force"]
    assert suggest_name(name, known) == f"did you mean {meant}?"


@pytest.mark.parametrize("harmonics", [[0.9, 0.1], 0.9, [[1, 0.9, 0.1]], [[1.5, 0.9]]])
def test_a_list_of_pairs_is_shown_as_one(harmonics):
    with pytest.raises(InputError, match=r"pairs, a whole number and a number each: \[\[1, 0.9\], \[3, 0.1\]\]"):
        parse_law({"id": "harmonic", "harmonics": harmonics})


INLINE = Path(__file__).parents[1] / "data/inline.toml"

PYTHON = re.compile(
    r"None|True|False|\(\S*,\)|\([\d.]+, |\{'|np\.|array\(|<class|Path\(|datetime|\[Errno|tuple|valid|dictionary"
)

BAD = [
    'cams.intake.law={ id = "harmonic", cosine = [1.0, 2.0], sine = [1.0] }',
    'cams.intake.law={ id = "scca", b = 1.0, c = 1.0, d = 1.0 }',
    'cams.intake.law={ id = "polynomial", exponents = [true] }',
    'cams.intake.law={ id = 3 }', "cams.intake.law={ b = 1 }", "cams.intake.law=true", "cams.intake.law=2024-05-01",
    "cams.intake.lift=true", "cams.intake.lift=[1, 2]", "cams.intake.at=3", "cams.intake.rise={ a = 1 }",
    "springs.valve.direction=[true, false, true]", "run.gravity=[1, 2]", "run.gravity=true", "nodes.cam=3",
    'nodes.cam=["a", true, {}]', "output.probes=valve", "output.probes=[1, true]", "output.field_every=2.5",
    "output.field_every=true", "contacts.intake.model={ a = 1 }", "run.integrator=3", "run.start=[1]",
    "sections={ a = 1 }", "members=3", "materials.steel={ E = true }", "rockers.rocker.arms=[1]",
    "rockers.rocker.to=true",
    "rockers.rocker.arms={ a = [1, { b = true }] }", "title=true", "format=true", "masses.valve.mass={}",
    "mesh=true", "supports.front=3", "supports.front=[true]", "fidelity.modes=true", "run.engine=3",
]  # fmt: skip


@pytest.mark.parametrize("override", BAD)
def test_no_python_in_what_is_told(override):
    """Who writes a case file need not know what a tuple is."""
    with pytest.raises(InputError) as refusal:
        read_case(INLINE, [override])
    for fault in refusal.value.faults:
        told = str(fault).replace(f"--set {override}", "")
        assert not PYTHON.search(told), told


def test_a_table_given_twice(tmp_path):
    (tmp_path / "case.toml").write_text("[run.start]\n[run.start]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"\[run\.start\] is given twice"):
        read_case(tmp_path / "case.toml")
    (tmp_path / "case.toml").write_text("[run.start]\n[run.start]   # a comment\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"got \[run\.start\], expected .* \[run\.start\] is given twice"):
        read_case(tmp_path / "case.toml")


def test_numbers_of_arrays():
    assert "got [0.5, 1.5]" in str(refuse("x", np.array([0.5, 1.5]), "one"))
    assert "got 0.5" in str(refuse("x", np.float64(0.5), "one"))
    with pytest.raises(InputError, match="got shape 2 x 3, expected shape any x 2"):
        finite_array("x", np.zeros((2, 3)), (None, 2))


@pytest.mark.parametrize("given", ["[]", "[1]", "[1, 2]", "[1, 2, 3, 4]"])
def test_rows_say_how_many_values_they_have(given):
    """However many are missing, or one is too many: the same number, told once."""
    with pytest.raises(InputError) as refusal:
        read_case(INLINE, [f"run.gravity={given}"])
    assert [fault.allowed for fault in refusal.value.faults] == ["3 values"]
