"""Error messages: format versions, name suggestions, and no Python terms."""

import re
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, read_case
from flexcam.case.curves import parse_law
from flexcam.case.reader import read_cams
from flexcam.core.errors import finite_array, refuse, suggest_name


def test_newer_format_version_is_refused(tmp_path):
    (tmp_path / "cams.toml").write_text('format = 2\n[cams.c]\nlaw = "shm"\nlift = "6 mm"\nrise = 1\nreturn = 1\n')
    with pytest.raises(InputError) as refusal:
        read_cams(tmp_path / "cams.toml")
    (fault,) = refusal.value.faults
    assert (fault.given, fault.allowed) == ("2", "1")
    assert "a newer flexcam" in fault.remedy


DISTANT = (("missing.toml", "direct-acting.toml"), ("missing.toml", "ns.toml"), ("none.vtkhdf", "nn.vtkhdf"),
           ("nothing", "motion"), ("rear", "roller"))  # fmt: skip
SIMILAR = (("splitt.toml", "split.toml"), ("shn", "shm"), ("rize", "rise"), ("SDOF", "sdof"),
           ("run.sped", "run.speed"), ("bwo.toml", "bow.toml"))  # fmt: skip


def test_similar_names_are_suggested():
    assert [pair for pair in DISTANT if suggest_name(pair[0], [pair[1]])] == []
    assert [pair for pair in SIMILAR if suggest_name(pair[0], [pair[1]]) != f"did you mean {pair[1]!r}?"] == []


def test_given_name_is_not_suggested():
    assert suggest_name("exponents", ["exponents", "conditions"]) == ""
    assert suggest_name("contacts.a.force", ["contacts.a.force", "contacts.b.force"]) == ""
    with pytest.raises(InputError) as refusal:
        parse_law({"id": "polynomial", "exponents": ["x"]})
    assert "did you mean" not in str(refusal.value)


@pytest.mark.parametrize(("name", "meant"), [
    ("contacts.exhaust.force", "'contacts.intake.force' or 'contacts.seat.force'"),  # 'seat' shares most letters
    ("contacts.intaek.force", "'contacts.intake.force'"),
])  # fmt: skip
def test_suggestions_compare_parts_of_dotted_names(name, meant):
    known = ["contacts.intake.force", "contacts.intake.torque", "contacts.seat.force", "springs.exhaust.force"]
    assert suggest_name(name, known) == f"did you mean {meant}?"


@pytest.mark.parametrize("harmonics", [[0.9, 0.1], 0.9, [[1, 0.9, 0.1]], [[1.5, 0.9]], {"1": 0.9}])
def test_message_shows_example_of_list_of_pairs(harmonics):
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


def test_messages_contain_no_python_terms():
    """Authors of case files need not know Python types."""
    messages = []
    for override in BAD:
        with pytest.raises(InputError) as refusal:
            read_case(INLINE, [override])
        messages += [str(fault).replace(f"--set {override}", "") for fault in refusal.value.faults]
    assert not [message for message in messages if PYTHON.search(message)]


def test_duplicate_table_is_refused(tmp_path):
    (tmp_path / "case.toml").write_text("[run.start]\n[run.start]\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"\[run\.start\] is given twice"):
        read_case(tmp_path / "case.toml")
    (tmp_path / "case.toml").write_text("[run.start]\n[run.start]   # a comment\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"got \[run\.start\], expected .* \[run\.start\] is given twice"):
        read_case(tmp_path / "case.toml")


def test_duplicate_inline_key_is_refused(tmp_path):
    (tmp_path / "case.toml").write_text("[masses]\nlobe = { mass = 1, mass = 2 }\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"line 2: got key 'mass', .*'mass' is given twice\. Delete one"):
        read_case(tmp_path / "case.toml")


def test_messages_show_plain_numbers_and_shapes():
    assert "got [0.5, 1.5]" in str(refuse("x", np.array([0.5, 1.5]), "one"))
    assert "got 0.5" in str(refuse("x", np.float64(0.5), "one"))
    with pytest.raises(InputError, match="got shape 2 x 3, expected shape any x 2"):
        finite_array("x", np.zeros((2, 3)), (None, 2))


@pytest.mark.parametrize("given", ["[]", "[1]", "[1, 2]", "[1, 2, 3, 4]"])
def test_fault_names_required_number_of_values(given):
    """The allowed number is reported once, whether values are missing or too many."""
    with pytest.raises(InputError) as refusal:
        read_case(INLINE, [f"run.gravity={given}"])
    assert [fault.allowed for fault in refusal.value.faults] == ["3 values"]
