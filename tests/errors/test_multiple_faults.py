"""Several faults of one file, whatever their kind, are in one report."""

# ruff: noqa: E501 - tables, a row to a line

import re
import time
from contextlib import suppress
from pathlib import Path

import pytest

from flexcam import InputError
from flexcam.case.fault_report import parse_toml
from flexcam.case.reader import CaseFile
from flexcam.io.cam_files import read_lift
from flexcam.studies.plan import parse_axis
from tests.thinning import slow_if

# changes, and the key paths that the report must contain
MANY = {
    "every table": (
        [("nu = 0.29", "nu = true"), ('diameter = "25 mm"', "diameter = -1"), ('section = "tube"', 'section = "tub"'),
         ('"0.15 kg"', '"0.15 mm"'), ("inertia =", "inerta ="), ('"40 kN/m"', '"40 kN"'), ('lift = "6 mm"', "lift = nan"),
         ('cam = "intake"', 'cam = "exhaust"'), ('"3000 rpm"', '"0 rpm"'), ("field_every = 20", "field_every = 0")],
        ["materials.steel.nu", "sections.shaft.diameter", "members.pushrod.section", "masses.lobe.mass", "rockers.rocker.inerta",
         "springs.valve.stiffness", "cams.intake.lift", "contacts.intake.cam", "run.speed", "output.field_every"],
    ),
    "geometry beside keys": (
        [("density =", "densty ="), ('rise = "180 deg"', 'rise = "200 deg"')], ["materials.steel.densty", "cams.intake"],
    ),
    "ranges in several parts": (
        [('inner_diameter = "5 mm"', 'inner_diameter = "9 mm"'), ('rise = "180 deg"', 'rise = "200 deg"'), ("nu = 0.29", "nu = 0.6"),
         ('"0.15 kg"', '"0.15 kg", inertia = [1, 0, 0]')],
        ["sections.tube", "cams.intake", "materials.steel", "masses.lobe"],
    ),
    "integrator beside references": (
        [('{ method = "newmark" }', '{ method = "hht", alpha = 3 }'), ('probes = ["valve"', 'probes = ["vale"')],
        ["run.integrator", "output.probes"],
    ),
    "table as text": (
        [('title = "Nodes in the file"', 'title = "x"\nmasses = "none"\nspringz = 3'),
         ('[masses]\nlobe = { at = "cam", mass = "0.15 kg" }\nfollower = { at = "tappet", mass = "0.10 kg" }\n', ""),
         ('valve = { at = "valve", mass = "0.10 kg" }\n', "")],
        ["masses", "springz"],
    ),
    "exclusive keys beside units": (
        [("[run]", '[run]\ncrank_speed = "6000 rpm"'), ('lift = "6 mm"', 'lift = "6 kg"')], ["run", "cams.intake.lift"],
    ),
    "names that lead nowhere": (
        [('material = "steel"', 'material = "stee"'), ('section = "tube"', 'section = "tub"'), ('lobe = { at = "cam"', 'lobe = { at = "cem"'),
         ('follower = "tappet"', 'follower = "tapet"'), ('probes = ["valve"', 'probes = ["valv"'), ('law = "shm"', 'law = "shn"')],
        ["members.camshaft.material", "members.pushrod.section", "masses.lobe.at", "contacts.intake.follower", "output.probes", "cams.intake.law"],
    ),
    "keys that are lacking": (
        [('E = "207 GPa"\n', ""), ('lift = "6 mm"\n', ""), ('law = "shm"\n', ""), ('arms = ["25 mm", "40 mm"]\n', "")],
        ["materials.steel.E", "cams.intake.lift", "cams.intake.law", "rockers.rocker.arms"],
    ),
    "variants": (
        [('shape = "circle"', 'shape = "disc"'), ('"newmark"', '"newmarc"'), ('start = "rest"', 'start = "rested"'), ('"published-load"', '"publish"')],
        ["sections.shaft", "run.integrator", "run.start", "contacts.intake.model"],
    ),
    "rows of the wrong length": (
        [('rear = ["180 mm", "0 mm", "0 mm"]', 'rear = ["180 mm"]'), ('arms = ["25 mm", "40 mm"]', 'arms = ["25 mm"]'), ('["tappet", "pushrod-top"]', '["tappet"]')],
        ["nodes.rear", "rockers.rocker.arms", "members.pushrod.nodes"],
    ),
    "supports": (
        [('front = ["uy", "uz"]', 'frunt = ["uy", "uzz"]'), ('tappet = ["ux", "uz", "ry"]', 'tappet = ["xx", "uz", "ry"]')],
        ["supports.frunt", "supports.tappet"],
    ),
    "directions": (
        [('direction = "uy"', 'direction = "up"'), ('model = "published-load"', 'model = "published-load"\ndirection = [0, 0, 0]')],
        ["springs.valve.direction", "contacts.intake.direction"],
    ),
    "two ways at once": (
        [("[run]", '[run]\ncrank_speed = "6000 rpm"\nstep = "20 us"'), ("[nodes]", 'mesh = "x.msh"\n[nodes]')], ["run", "case file"],
    ),
    "one follower for two cams": (
        [("[contacts.intake]", '[contacts.other]\ncam = "intake"\nfollower = "tappet"\nmodel = "published-load"\n\n[contacts.intake]'),
         ('rear = ["180 mm"', 'rear = ["181 mm"')], ["contacts.intake.follower"],
    ),
    "a range beside a missing key": (
        [("density =", "densty ="), ("nu = 0.29", "nu = 0.6")], ["materials.steel.densty", "materials.steel.nu"],
    ),
    "a spring between a point and itself beside a unit": (
        [("[springs.valve]", '[springs.own]\nat = "cam"\nto = "cam"\ndirection = "rx"\nstiffness = "1 kN"\n[springs.valve]')],
        ["springs.own.to", "springs.own.stiffness"],
    ),
    "geometry of members and bearings": (
        [('camshaft = { nodes', 'camshaft = { orientation = [2, 0, 0], nodes'), ("[nodes]", '[bearings]\nlost = { at = "lost", stiffness = "1 MN/m" }\n[nodes]\nlost = [0, 0, 1]')],
        ["members.camshaft.orientation (line ", "bearings.lost (line "],
    ),
    "nodes at one place beside a unit and a name": (
        [('front = ["60 mm"', 'front = ["0 mm"'), ('"207 GPa"', '"207 Gpa"'), ('section = "tube"', 'section = "tub"'),
         ('["drive", "front", "cam", "rear"]', '["drive", "front", "cam", "rear", "cam"]')],
        ["nodes.front (line ", "members.camshaft.nodes (line ", "materials.steel.E", "members.pushrod.section"],
    ),
    "points of rockers": (
        [('to = "valve"', 'to = "cam"'), ('from = "pushrod-top"', 'from = "pushrodtop"')], ["rockers.rocker.to", "rockers.rocker.from"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MANY)
def test_report_contains_all_faults(name, text, substitute, faults_of):
    changes, keys = MANY[name]
    wheres = [fault.where for fault in faults_of(substitute(text, *changes))]
    lacking = [key for key in keys if not any(where.startswith(key) for where in wheres)]
    assert not lacking, f"reported: {wheres}"


def test_all_unknown_names_of_initial_state_are_reported(text, substitute, faults_of):
    given = '{ displacement = { "cam.uu" = 1, "drive.uy" = 2 }, velocity = { "can.uy" = 3 } }'
    faults = faults_of(substitute(text, ('start = "rest"', f"start = {given}")))
    assert [fault.given for fault in faults] == ["'cam.uu'", "'drive.uy'", "'can.uy'"]


@pytest.mark.parametrize(
    ("old", "new", "allowed"),
    [
        ('start = "rest"', 'start = { displacement = { "cam.uy" = "1 kg" } }', "a length"),
        ('start = "rest"', "start = { velocities = {} }", "displacement"),
        ('model = "published-load"', 'model = "unilateral"\nstiffness = "hertzz"', "'hertz', or a stiffness"),
    ],
)
def test_value_of_no_allowed_type_is_one_fault(text, substitute, faults_of, old, new, allowed):
    (fault,) = faults_of(substitute(text, (old, new)))
    assert allowed in fault.allowed


def test_report_has_one_line_per_fault_and_no_fault_twice(text, substitute, faults_of):
    changes, keys = MANY["every table"]
    faults = faults_of(substitute(text, *changes))
    assert len({(fault.where, fault.given) for fault in faults}) == len(faults)
    assert len("\n".join(map(str, faults)).splitlines()) == len(faults) >= len(keys)


def test_faults_are_in_order_of_lines():
    """Faults of units, keys and references, which are found separately, are sorted by line."""
    path = Path(__file__).parents[1] / "data/inline.toml"
    text = path.read_text(encoding="utf-8")
    for old, new in (('"207 GPa"', '"207 kg"'), ('diameter = "25 mm"', 'diameter = "-25 mm", foo = 2'),
                     ('"40 kN/m"', '"40 kN"'), ('at = "valve"', 'at = "valv"'), ('"3000 rpm"', '"3000 kg"')):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(InputError) as refusal:
        CaseFile(path, text).read()
    lines = [int(re.search(r"\(line (\d+)", fault.where)[1]) for fault in refusal.value.faults]
    assert lines == sorted(lines)
    assert len(set(lines)) < len(lines)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_line_numbers_count_only_toml_line_ends(end, text, substitute, faults_of):
    """Comments and texts may contain other line separators, which editors do not count."""
    odd = '# next line \x85, line \u2028 and paragraph \u2029\ntitle = "a\u2028b"'
    case_text = substitute(text, ('title = "Nodes in the file"', odd), ("nu = 0.29", "nu = true")).replace("\n", end)
    number = case_text.split("\n").index("nu = true" + end[:-1]) + 1
    assert [fault.where for fault in faults_of(case_text)] == [f"materials.steel.nu (line {number})"]


def test_key_of_thousands_of_parts_is_refused():
    key = ".".join(['"\u2028"'] * 3000)
    with pytest.raises(ValueError, match="nested more than"):
        parse_toml(f"{key} = 1")


TITLE = 'format = 1\ntitle = """\n[{}\n"""\n'
LONG = {
    "a title of blanks": ("format = 1\n", TITLE.format(3000 * " " + "\n" + 3000 * " " + "x")),
    "unknown keys": ("[run]\n", "[run]\n" + "".join(f"key{i} = 1\n" for i in range(1000))),
    "tables with unknown keys": (
        "[masses]\n",
        "[masses]\n" + "".join(f"m{i} = {{ masss = 1 }}\n" for i in range(1000)),
    ),
    "digits of a number": ('"0.15 kg"', '"' + 20_000 * "1" + ' kg"'),
    "blanks in a unit": ('"0.15 kg"', '"0.15 kg' + 50_000 * " " + 'x"'),
}


@pytest.mark.parametrize("name", slow_if(lambda one: one == "tables with unknown keys", LONG))
def test_reading_time_is_proportional_to_length(name, text, substitute, tmp_path):
    """Regular expressions with backtracking would take minutes."""
    path = tmp_path / "long.toml"
    path.write_text(substitute(re.sub("title = .*\n", "", text), LONG[name]))
    start = time.process_time()
    with suppress(InputError):
        CaseFile.open(path).read()
    assert time.process_time() - start < 30.0


def test_long_range_and_long_lines_are_refused(tmp_path):
    """Regular expressions with backtracking would take minutes."""
    start = time.process_time()
    with pytest.raises(InputError):
        parse_axis("run.speed", 20_000 * "1" + " rpm:!")
    for line in (20_000 * ";", "angle" + 20_000 * " " + "[", 20_000 * "["):
        (tmp_path / "long.csv").write_text(f"{line}\n1,2\n2,3\n3,4\n", encoding="utf-8")
        with pytest.raises(InputError, match="lines of up to 10000"):
            read_lift(tmp_path / "long.csv")
    assert time.process_time() - start < 30.0


def test_long_value_is_shortened_in_message(text, substitute, faults_of):
    (fault,) = faults_of(substitute(text, ('"0.15 kg"', '"0.15 ' + 20_000 * "k" + '"')))
    assert len(str(fault)) < 4000


def test_line_break_in_name_is_escaped(text, substitute, faults_of):
    """A message is one line, so that a name cannot add a false message."""
    assert not [fault for fault in faults_of(substitute(text, ("shaft =", '"sha\\nft" ='))) if "\n" in str(fault)]


def test_limits_are_in_given_unit(text, substitute, faults_of):
    (fault,) = faults_of(substitute(text, ('lift = "6 mm"', 'lift = "6e20 mm"')))
    assert "between 1e-06 and 1e+08 mm" in fault.why


def test_fault_names_missing_quantity(text, substitute, faults_of):
    (fault,) = faults_of(substitute(text, (', diameter = "25 mm"', "")))
    assert fault.allowed.startswith("a length (such as '25 mm'): one value, or two")
