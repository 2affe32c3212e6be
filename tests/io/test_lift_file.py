"""Lift tables as text: separators, headers and given options; laws and lifts as TOML."""

import math

import numpy as np
import pytest

from flexcam.cams import KINDS, LAWS, BSplineLaw, HarmonicLift
from flexcam.case.curves import read_harmonic_lift, read_law
from flexcam.core.errors import InputError
from flexcam.io import read_lift, write_law, write_lift

ROWS = [(0.0, 0.0), (30.0, 1.25), (60.5, 6.0), (90.0, 2.5), (1.2e2, 0.125)]
ANGLES, LIFTS = np.array(ROWS).T
ONE_ROUNDING = {"rtol": 4e-16, "atol": 0.0}
"""Tolerance of one rounded factor and one multiplication."""


OTHER_ENDS = "\x0b\x0c\x1c\x85\u2028\u2029"
"""Characters that end lines in Python but not in editors."""


@pytest.fixture
def read(tmp_path):
    """Return a function that reads a table from bytes or text."""

    def read_content(content, **given):
        path = tmp_path / "lift.csv"
        path.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)
        return read_lift(path, **given)

    return read_content


@pytest.fixture
def refusal(read):
    """Return a function that gives the faults of an invalid table."""

    def find_faults(content, **given):
        with pytest.raises(InputError) as refused:
            read(content, **given)
        assert all(fault.where and fault.given and fault.allowed for fault in refused.value.faults)
        return refused.value.faults

    return find_faults


def rows(separator=", ", values=ROWS):
    return "\n".join(separator.join(map(repr, row)) for row in values) + "\n"


def equals_rows(columns):
    np.testing.assert_allclose(columns.angle, np.radians(ANGLES), **ONE_ROUNDING)
    np.testing.assert_allclose(columns.lift, 1e-3 * LIFTS, **ONE_ROUNDING)
    return True


def test_separators_are_recognized(read):
    for separator in (",", ", ", ";", " ; ", "\t", " ", "   ", " \t "):
        for head in (f"cam_deg{separator}lift_mm\n", ""):
            assert equals_rows(read(head + rows(separator), angle="cam", unit="mm")), repr(separator)


PLAIN = "cam_deg, lift_mm\n" + rows()
LAYOUTS = {
    "byte order mark": "\ufeff" + PLAIN,
    "byte order mark before numbers": "\ufeff" + rows(),
    "lines of Windows": PLAIN.replace("\n", "\r\n"),
    "comments": "# measured on\n#\n" + PLAIN.replace("6.0\n", "6.0  # nose, 2nd of 3\n") + "# end\n",
    "empty lines": "\n\n" + PLAIN.replace("\n", "\n   \n"),
    "no last line end": PLAIN.rstrip("\n"),
    "signs and powers": PLAIN.replace("30.0", "+3.0e+1").replace("0.125", "1.25E-1"),
    "indented": PLAIN.replace("\n", "\n\t ").rstrip("\t "),
    "separator behind": PLAIN.replace("\n", ",\n"),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_layout_around_numbers_is_ignored(name, read):
    assert equals_rows(read(LAYOUTS[name], **({} if "cam_deg" in LAYOUTS[name] else {"angle": "cam", "unit": "mm"})))


HEADERS = {  # head, rad of the cam per angle as written, m per lift as written
    "cam_deg, lift_mm": (math.pi / 180, 1e-3),
    "cam_deg lift_um": (math.pi / 180, 1e-6),
    "cam_deg; lift_µm": (math.pi / 180, 1e-6),
    "cam_deg, lift_m": (math.pi / 180, 1.0),
    "cam_deg, lift_in": (math.pi / 180, 0.0254),
    "crank_deg, lift_mm": (math.pi / 360, 1e-3),
    "crank_rad, lift_in": (0.5, 0.0254),
    "cam_rad, lift_mm": (1.0, 1e-3),
    "Cam angle [deg], Lift [mm]": (math.pi / 180, 1e-3),
    "CRANK ANGLE (RAD); LIFT (IN)": (0.5, 0.0254),
    "camshaft angle in deg\tvalve lift in mm": (math.pi / 180, 1e-3),
    "crankshaft °, lift m": (math.pi / 360, 1.0),
}


@pytest.mark.parametrize("head", HEADERS)
def test_headers_define_shaft_and_units(head, read):
    to_rad, to_m = HEADERS[head]
    columns = read(f"{head}\n{rows()}")
    np.testing.assert_allclose(columns.angle, to_rad * ANGLES, **ONE_ROUNDING)
    np.testing.assert_allclose(columns.lift, to_m * LIFTS, **ONE_ROUNDING)
    assert columns.angle.shape == columns.lift.shape == (len(ROWS),)


@pytest.mark.parametrize(("head", "given", "half", "to_m"), [
    ("", {"angle": "cam", "unit": "mm"}, 1.0, 1e-3),
    ("", {"angle": "crank", "unit": "in"}, 0.5, 0.0254),
    ("cam_deg, lift_mm\n", {"angle": "crank"}, 0.5, 1e-3),
    ("crank_deg, lift_mm\n", {"angle": "cam"}, 1.0, 1e-3),
    ("cam_deg, lift_mm\n", {"unit": "um"}, 1.0, 1e-6),
    ("angle, lift_in\n", {"angle": "cam"}, 1.0, 0.0254),
    ("crank_deg, lift\n", {"unit": "m"}, 0.5, 1.0),
])  # fmt: skip
def test_given_options_override_header(head, given, half, to_m, read):
    columns = read(head + rows(), **given)
    np.testing.assert_allclose(columns.angle, half * np.radians(ANGLES), **ONE_ROUNDING)
    np.testing.assert_allclose(columns.lift, to_m * LIFTS, **ONE_ROUNDING)


TRADE_FILES = {  # file name, content, given options; all contain the rows
    "decimal commas": ("a.csv", "cam_deg; lift_mm\n" + rows("; ").replace(".", ","), {}),
    "decimal commas and tabs": ("a.txt", rows("\t").replace(".", ","), {"angle": "cam", "unit": "mm"}),
    "header lines": ("a.dvl", "Intake 276\n5\ncam, no. 3\n" + rows("  "), {"angle": "cam", "unit": "mm"}),
    "header lines, named columns": ("a.prn", "11/23/2026  Cam Doctor, 2\n\nCAM DEG  LIFT(MM)\n" + rows("  "), {}),
    "decimal commas below a date": (
        "a.csv", "Cam Doctor 2.1, 11.23.2026\ncam_deg; lift_mm\n" + rows("; ").replace(".", ","), {},
    ),
    "velocity and acceleration": (
        "a.svl", "\n".join(f"{a} {s} {0.1 * s} {-0.2 * s}" for a, s in ROWS), {"angle": "cam", "unit": "mm"},
    ),
    "named lift": (
        "a.csv", "cam_deg, velocity, valve lift [mm]\n" + "\n".join(f"{a}, 7, {s}" for a, s in ROWS), {},
    ),
    "chosen lift": (
        "a.csv", "cam_deg, lift_ex_mm, lift_in_mm\n" + "\n".join(f"{a}, 7, {s}" for a, s in ROWS),
        {"column": "lift_in_mm"},
    ),
    "engine-sim": (
        "a.mr", "function timing(10 * units.rpm)\ntiming.add_sample(0 * units.rpm, 25 * units.deg)\nfunction lobe(1)\n"
        "lobe\n" + "".join(f"    .add_sample({a} * units.deg, {s}* units.mm) // row\n" for a, s in ROWS), {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TRADE_FILES)
def test_common_file_formats_are_read(name, tmp_path):
    file, content, given = TRADE_FILES[name]
    (tmp_path / file).write_text(content, encoding="utf-8")
    assert equals_rows(read_lift(tmp_path / file, **given))


def test_symmetric_lobes_of_engine_sim(tmp_path):
    """Angles are cam angles from the lobe centre, lifts are in thousandths of an inch; one of two lobes is selected."""
    lobe = "function {}(10 * units.deg)\n{}\n    .add_sym_sample(0.0, {})\n    .add_sym_sample(60.0, 0.0)\n"
    (tmp_path / "a.mr").write_text(lobe.format("intake", "intake", 430.0) + lobe.format("other", "other", 400.0))
    columns = read_lift(tmp_path / "a.mr", column="intake")
    np.testing.assert_allclose(columns.angle, np.radians([-60.0, 0.0, 60.0]), **ONE_ROUNDING)
    np.testing.assert_allclose(columns.lift, [0.0, 0.010922, 0.0], rtol=1e-15)
    assert columns.lines == (4, 3, 4)
    for column, message in ((None, "Name one"), ("intak", "Did you mean 'intake'")):
        with pytest.raises(InputError, match=message):
            read_lift(tmp_path / "a.mr", column=column)
    (tmp_path / "a.mr").write_text("node\n.add_sym_sample(1.0.0, 2)\n")
    with pytest.raises(InputError, match="line 2"):
        read_lift(tmp_path / "a.mr")


def test_invalid_columns_are_refused(refusal):
    (fault,) = refusal("cam_deg, lift_ex_mm, lift_in_mm\n" + "1, 2, 3\n" * 4)
    assert "column = " in fault.remedy
    (fault,) = refusal("cam_deg, lift_mm, v\n" + "1, 2, 3\n" * 4, column="lift_m")
    assert "did you mean 'lift_mm'" in fault.remedy
    (fault,) = refusal("lift\n" + "1.5\n" * 4)
    assert (fault.where, fault.given) == ("lift.csv, line 2", "'1.5'")
    (fault,) = refusal("5 7\ncam_deg, lift_mm\n" + rows())
    assert (fault.where, fault.given) == ("lift.csv, line 2", "'cam_deg, lift_mm'")


UNDEFINED = {  # header, given options, missing option, a part of the remedy
    "no head": ("", {}, "angle", 'angle = "cam"'),
    "no head, shaft given": ("", {"angle": "cam"}, "unit", 'unit = "mm"'),
    "no head, unit given": ("", {"unit": "mm"}, "angle", 'angle = "cam"'),
    "no shaft": ("angle_deg, lift_mm\n", {}, "angle", "cam_deg, lift_mm"),
    "two shafts": ("cam crank, lift_mm\n", {}, "angle", "cam_deg, lift_mm"),
    "no unit": ("cam_deg, lift\n", {}, "unit", "cam_deg, lift_mm"),
    "unknown unit": ("cam_deg, lift_ft\n", {}, "unit", 'unit = "mm"'),
    "unknown unit given": ("cam_deg, lift_mm\n", {"unit": "ft"}, "unit", 'unit = "mm"'),
}


@pytest.mark.parametrize("name", UNDEFINED)
def test_missing_shaft_or_unit_is_refused(name, refusal):
    head, given, missing, remedy = UNDEFINED[name]
    (fault,) = refusal(head + rows(), **given)
    assert "lift.csv" in fault.where
    assert missing in fault.where
    assert remedy in fault.remedy
    assert head.strip() in fault.given or given.get("unit") in fault.given


BAD_ROWS = {
    "one number": "12.5", "three numbers": "1, 2, 3", "a word": "90, open", "a second head": "cam_deg, lift_mm",
    "nothing behind": "90,", "two separators": "90,,", "decimal commas": "90,5; 1,25", "hexadecimal": "0x10, 1",
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_ROWS)
def test_rows_that_are_not_pairs_are_refused(name, refusal):
    """The line number counts comments and empty lines."""
    lines = ["# by hand", *PLAIN.splitlines()]
    (fault,) = refusal("\n".join([*lines[:4], "", BAD_ROWS[name], *lines[4:]]))
    assert "lift.csv" in fault.where
    assert "line 6" in fault.where
    assert BAD_ROWS[name] in fault.given
    assert fault.remedy


def test_up_to_ten_invalid_rows_are_named(refusal):
    faults = refusal(PLAIN + "a, b\n" * 3)
    assert [fault.where for fault in faults] == [f"lift.csv, line {n}" for n in (7, 8, 9)]
    assert len(refusal(PLAIN + "a, b\n" * 300)) == 10


@pytest.mark.parametrize("content", [b"cam_\xb0, lift_mm\n1, 2\n", b"\xff\xfec\x00a\x00m\x00"])
def test_binary_files_are_refused(content, refusal):
    (fault,) = refusal(content)
    assert "lift.csv" in str(fault)


@pytest.mark.parametrize("name", ["none.csv", "."])
def test_missing_file_or_folder_is_refused(name, tmp_path):
    with pytest.raises(InputError) as refused:
        read_lift(tmp_path / name)
    assert str(tmp_path) in str(refused.value)


SAVED_LAWS = {name: law for name, law in LAWS.items() if type(law) in KINDS.values()}
SAVED_LAWS |= {
    "knots": BSplineLaw((0.0, 0.0, 0.0, 0.1 + 0.2, 1.0, 1.0, 1.0), 5, (1 / 3,)),
    "degree": BSplineLaw((0.0,) * 3 + (0.3,) + (1.0,) * 3, 6),
}


@pytest.mark.parametrize("name", SAVED_LAWS)
def test_law_round_trip_is_exact(name, tmp_path):
    assert read_law(write_law(SAVED_LAWS[name], tmp_path / "a.toml", about={"of": "a test"})).law == SAVED_LAWS[name]


def test_harmonic_lift_round_trip_is_exact(tmp_path):
    lift = HarmonicLift(1 / 300, (-1 / 300, 1e-300), (0.1 + 0.2, 0.0))
    assert read_harmonic_lift(write_lift(lift, tmp_path / "a.toml", about={})) == lift
    with pytest.raises(InputError, match="overwrite"):
        write_lift(lift, tmp_path / "a.toml", about={})
    with pytest.raises(InputError, match=r"\.toml"):
        write_lift(lift, tmp_path / "a.csv", about={})
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_numbers_are_those_of_editors(read, end):
    """Other line separators in comments do not change the line numbers of rows."""
    rows = [f"# cut{OTHER_ENDS}here", "cam_deg, lift_mm", "0, 0", f"# {OTHER_ENDS}", "10, 1", "20, 2"]
    assert read(end.join(rows)).lines == (3, 5, 6)
    with pytest.raises(InputError) as refused:
        read(end.join([*rows, "30; x"]))
    assert [fault.where for fault in refused.value.faults] == ["lift.csv, line 7"]


def test_decimal_commas_with_integer_angles(read):
    """Semicolons separate the columns, so that commas are decimal."""
    columns = read("cam_deg;lift_mm\n0;0,000\n1;0,004\n2;0,016\n3;0,036\n")
    np.testing.assert_allclose(columns.angle, np.radians([0.0, 1.0, 2.0, 3.0]), **ONE_ROUNDING)
    np.testing.assert_allclose(columns.lift, [0.0, 4e-6, 16e-6, 36e-6], **ONE_ROUNDING)
