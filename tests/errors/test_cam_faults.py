"""Faults of cams (laws, lift tables, ramps, followers) in cam files, in full cases and through the command."""

# ruff: noqa: E501 - tables, a row to a line

import json
import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam import InputError, read_case
from flexcam.cams import lift_table
from flexcam.case.reader import read_cams
from flexcam.io import read_lift
from tests.errors.fault_helpers import LIBRARY_WORDS, is_at
from tests.thinning import mostly_slow

EVENT = 'law = "3-4-5"\nlift = "6 mm"\nrise = "100 deg"\nreturn = "100 deg"\n'
CAM = EVENT + 'base_radius = "18 mm"\nfollower = { type = "roller", radius = "9 mm" }\n'
LAW, ROLLER = 'law = "3-4-5"', '{ type = "roller", radius = "9 mm" }'
SWING = '{{ type = "swing", arm = "40 mm", distance = "45 mm", {} }}'
ROWS = [(angle, 3.0 - 3.0 * math.cos(math.radians(angle))) for angle in range(0, 361, 5)]


def table(rows=ROWS, head="cam_deg, lift_mm"):
    return "\n".join([head, *(f"{angle}, {lift}" for angle, lift in rows)]) + "\n"


FILES = {
    "good.csv": table(), "lift.toml": "[lift]\nmean = 0.003\ncosine = [-0.003]\nsine = [0.0]\n",
    "split.toml": '[law]\nid = "fb2"\nsplit = 7\n',
    "nohead.csv": table(head=""), "kg.csv": table(head="crank_kg, lift_mm"), "nounit.csv": table(head="cam_deg, lift"), "noshaft.csv": table(head="angle_deg, lift_mm"),
    "back.csv": table(ROWS[:9] + ROWS[7:]), "gap.csv": table(ROWS[:20] + ROWS[30:]), "few.csv": table(ROWS[::9]),
    "below.csv": table([(angle, lift - 1.0) for angle, lift in ROWS]), "twice.csv": table([*ROWS, (365, 0.1)]),
    "word.csv": table([*ROWS[:9], (45, "open"), *ROWS[10:]]),
    "comma.csv": "cam_deg, lift_mm\n90,5, 1,25\n", "nans.csv": table([*ROWS[:9], (45, math.nan), (50, 1), (55, math.nan), *ROWS[12:]]),
    "open.csv": table(ROWS[:30]), "flat.csv": table([(angle, 0) for angle, _ in ROWS]), "empty.csv": "",
    "radians.csv": table([(math.radians(angle), lift) for angle, lift in ROWS], "crank_deg, lift_mm"),
    "many.csv": table([(0.01 * i, 1.0) for i in range(30_000)]), "long.csv": table([(angle, 1e300 * lift) for angle, lift in ROWS]),
}  # fmt: skip


def cam_text(*pairs):
    """Return the text of the cam with replaced parts; each old part must be in it."""
    block = CAM
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in block
        block = block.replace(old, new)
    return block


def cam_with_lift_table(value):
    return cam_text(EVENT, f"lift_table = {value}\n")


FAULTS = {  # the cam, the key that must be reported, a part of `given`, a part of the message
    "no law": (cam_text(LAW, ""), "law", "nothing", "add 'law'"),
    "law beside a lift table": (cam_text(LAW, f'{LAW}\nlift_table = "good.csv"'), "law", "law", "remove one"),
    "ramps beside a lift table": (cam_with_lift_table('"good.csv"\nramps = { height = "1 mm", duration = "9 deg" }'), "ramps", "ramps", "the lift table defines"),
    "unknown id": (cam_text(LAW, 'law = { id = "sccaa", b = 1 }'), "law", "sccaa", "did you mean 'scca'"),
    "no id": (cam_text(LAW, "law = { b = 1 }"), "law", "", "the kind of law is required"),
    "parameter that is missing": (cam_text(LAW, 'law = { id = "scca", b = 0.2 }'), "law.c", "nothing", "the law scca requires c, d"),
    "parameter that does not exist": (cam_text(LAW, 'law = { id = "fb2", splitt = 0.2 }'), "law.splitt", "0.2", "did you mean 'split'"),
    "parameter out of range": (cam_text(LAW, 'law = { id = "fb2", split = 2 }'), "law.split", "2", "between 0 and 1"),
    "parameters that do not fit": (cam_text(LAW, 'law = { id = "scca", b = 1, c = 1, d = 1 }'), "law", "1", "sum to 1"),
    "parameter that is no number": (cam_text(LAW, 'law = { id = "cosine", coefficients = [nan] }'), "law", "nan", "coefficients"),
    "law that begins elsewhere": (cam_text(LAW, 'law = { id = "cosine", coefficients = [1, 2] }'), "law", "s(0) = 3", "from 0 to 1"),
    "law of the return": (cam_text(LAW, f'{LAW}\nreturn_law = "cycloid"'), "return_law", "'cycloid'", "did you mean 'cycloidal'"),
    "no law file": (cam_text("3-4-5", "none.toml"), "law", "a missing file", "correct its path"),
    "law file misspelt": (cam_text("3-4-5", "splitt.toml"), "law", "", "did you mean 'split.toml'"),
    "angle below zero of a swinging follower": (cam_text("6 mm", "-6 deg", ROLLER, SWING.format('radius = "9 mm"')), "lift", "-6 deg", "an angle"),
    "decimal commas": (cam_with_lift_table('"comma.csv"'), "lift_table", "cam_deg, lift_mm", "use decimal points"),
    "two numbers that are none": (cam_with_lift_table('"nans.csv"'), "lift_table", "'45, nan'", "line 11"),
    "law file with a lift": (cam_text("3-4-5", "lift.toml"), "law", "lift", "[law]"),
    "law file with a bad parameter": (cam_text("3-4-5", "split.toml"), "law", "7", "split.toml"),
    "key of a lift table": (cam_with_lift_table('{ file = "good.csv", angel = "cam" }'), "lift_table.angel", "cam", "did you mean 'angle'"),
    "lift table without a file": (cam_with_lift_table('{ angle = "cam" }'), "lift_table.file", "nothing", "add file"),
    "tolerance in kg": (cam_with_lift_table('{ file = "good.csv", tolerance = "2 kg" }'), "lift_table", "2 kg", "a length"),
    "no head": (cam_with_lift_table('"nohead.csv"'), "lift_table", "no header line", 'write lift_table = { file = ..., angle = "cam", unit = "mm" }'),
    "no unit": (cam_with_lift_table('"nounit.csv"'), "lift_table", "cam_deg, lift", 'unit = "mm"'),
    "angle in kg": (cam_with_lift_table('"kg.csv"'), "lift_table", "crank_kg", "crank_deg or crank_rad"),
    "no shaft": (cam_with_lift_table('"noshaft.csv"'), "lift_table", "angle_deg", "it does not say to which shaft the angles belong"),
    "angles that run back": (cam_with_lift_table('"back.csv"'), "lift_table", "40 deg of cam angle, then 35", "angle, line 11"),
    "gap": (cam_with_lift_table('"gap.csv"'), "lift_table", "between 95 and 150 deg", "measure there"),
    "few points": (cam_with_lift_table('"few.csv"'), "lift_table", "9 points", "12 or more"),
    "many points": (cam_with_lift_table('"many.csv"'), "lift_table", "30000 points", "up to 20000"),
    "radians said to be degrees": (cam_with_lift_table('"radians.csv"'), "lift_table", "3.14159 deg of cam angle", "check the unit"),
    "a lift beyond any length": (cam_with_lift_table('"long.csv"'), "lift_table", "6e+297 m as the largest lift", "1e-09 to 100000 m"),
    "lift below zero": (cam_with_lift_table('"below.csv"'), "lift_table", "-1 mm at 0 deg", "subtract"),
    "cam beyond 360 deg": (cam_with_lift_table('"twice.csv"'), "lift_table", "365 deg", "360 deg"),
    "word": (cam_with_lift_table('"word.csv"'), "lift_table", "45, open", "line 11"),
    "open end": (cam_with_lift_table('"open.csv"'), "lift_table", "mm at 145 deg", "measure the whole lift"),
    "no lift at all": (cam_with_lift_table('"flat.csv"'), "lift_table", "0 m as the largest lift", "check the column, its sign"),
    "empty file": (cam_with_lift_table('"empty.csv"'), "lift_table", "", "empty.csv"),
    "lift in kg": (cam_text("6 mm", "6 kg"), "lift", "6 kg", "is not a unit of length"),
    "lift in kg of a swinging follower": (cam_text("6 mm", "6 kg", ROLLER, SWING.format('radius = "9 mm"')), "lift", "6 kg", "a length"),
    "rise in crank angles": (cam_text("100 deg", "200 deg"), "", "400 deg in all", "if these are crank angles, halve them"),
    "rise without a unit": (cam_text('rise = "100 deg"', "rise = 100"), "", "deg in all", "write '100 deg'"),
    "ramps without a unit": (CAM + 'ramps = { height = "0.3 mm", duration = 25 }\n', "", "deg in all", "write '25 deg'"),
    "steep ramps": (CAM + 'ramps = { height = "3 mm", duration = "5 deg" }\n', "ramps", "", "mm/rad"),
    "ramps beyond the revolution": (CAM + 'ramps = { height = "0.3 mm", duration = "90 deg" }\n', "", "380 deg", "ramps included"),
    "high dwell beside a low one": (CAM + 'single_dwell = "high"\n', "", "200 deg", "no lower dwell"),
    "low dwell beside a high one": (CAM + 'single_dwell = "low"\ndwell = "9 deg"\n', "dwell", "9 deg", "no upper dwell"),
    "high dwell with ramps": (CAM + 'single_dwell = "high"\ndwell = "140 deg"\nramps = { height = "1 um", duration = "10 deg" }\n', "ramps", "", "to ramp from"),
    "another dwell": (CAM + 'single_dwell = "middle"\n', "single_dwell", "middle", "'high' or 'low'"),
    "follower as a word": (cam_text(ROLLER, '"flat"'), "follower", "'flat'", "write it as { type = 'flat' }"),
    "roller without a radius": (cam_text(', radius = "9 mm"', ""), "follower", "nothing", "add 'radius'"),
    "key of a follower": (cam_text('"9 mm" }', '"9 mm", ofset = 1 }'), "follower", "ofset", "did you mean 'offset'"),
    "triangle that does not close": (cam_text(ROLLER, SWING.format('radius = "1 um"'), "18 mm", "1 mm"), "follower", "base_radius + radius", "form a triangle"),
    "angle beside base_radius": (cam_text(ROLLER, SWING.format('radius = "9 mm", angle = "40 deg"')), "follower.angle", "40 deg", "base_radius"),
    "face out of reach": (cam_text(ROLLER, SWING.format('face = "-40 mm"')), "follower.face", "", "touch the base circle"),
    "offset too large": (cam_text('"9 mm" }', '"9 mm", offset = "30 mm" }'), "follower.offset", "30 mm", "27 mm"),
    "key of the cam": (cam_text("rise", "rize"), "rize", "rize", "did you mean 'rise'"),
}  # fmt: skip


READERS = ["cams alone", "whole case", "command"]
COMMAND_FAULTS = list(FAULTS)[::8]
"""Faults that are also tested through the command, which prints the same report as reading the cam file."""


@pytest.fixture(params=READERS)
def faults_of(request, tmp_path, text, flexcam):
    """Return a function that gives the text of a file with this cam and its faults, found by one of three readers."""
    full_case, path = request.param == "whole case", tmp_path / "file.toml"
    for name, content in FILES.items():
        (tmp_path / name).write_text(content, encoding="utf-8")

    def find(block):
        around = text.partition('law = "shm"\nlift = "6 mm"\nrise = "180 deg"\nreturn = "180 deg"\n')
        case_text = "".join([around[0], block, around[2]]) if full_case else f"format = 1\n[cams.intake]\n{block}"
        path.write_text(case_text, encoding="utf-8")
        if request.param != "command":
            with pytest.raises(InputError) as refusal:
                (read_case if full_case else read_cams)(path)
            return case_text, [fault.as_dict() for fault in refusal.value.faults]
        done = flexcam("cam", path, "--json")
        assert (done.code, done.err, done.json["status"]) == (2, "", "refused")
        return case_text, done.json["errors"]

    return find


@pytest.mark.parametrize(
    ("faults_of", "name"),
    mostly_slow(
        [(source, name) for source in READERS for name in FAULTS if source != "command" or name in COMMAND_FAULTS], 2
    ),
    indirect=["faults_of"],
)
def test_fault_names_key_line_and_remedy(name, faults_of):
    block, key, what, said = FAULTS[name]
    case_text, found = faults_of(block)
    full = f"cams.intake.{key}".rstrip(".")
    reported = [one for one in found if is_at(one["where"], full)]
    assert reported, f"no fault at {full}: {[one['where'] for one in found]}"
    assert [one for one in reported if what in one["given"] and said in " ".join(one.values())], reported
    assert all(
        list(one) == ["where", "given", "allowed", "why", "remedy"] and (one["allowed"] or one["why"]) for one in found
    )
    assert [word for word in LIBRARY_WORDS if word in json.dumps(found)] == []
    lines = [
        case_text.splitlines()[int(n) - 1] for one in reported for n in re.findall(r"\(line (\d+)\)", one["where"])
    ]
    assert [line for line in lines if re.match(rf"{key.partition('.')[0]}\b|\[cams\.intake\]", line)], lines


def test_report_contains_all_faults(faults_of):
    names = ["law of the return", "lift in kg", "key of the cam", "another dwell", "key of a follower"]
    keys = [*(f"intake.{FAULTS[name][1]}" for name in names), "exhaust.lift_table", "third.law", "third.lift_table"]
    block = cam_text("6 mm", "6 kg", "rise", "rize", '"9 mm" }', '"9 mm", ofset = 1 }')
    block += 'return_law = "cycloid"\nsingle_dwell = "middle"\n[cams.exhaust]\nat = "cam"\nlift_table = "gap.csv"\n'
    block += '[cams.third]\nat = "cam"\nlaw = { id = "scca", b = 1 }\nlift_table = "none.csv"\n'
    _, found = faults_of(block)
    places = [one["where"] for one in found]
    assert [key for key in keys if not any(place.startswith(f"cams.{key}") for place in places)] == []
    assert len({(one["where"], one["given"]) for one in found}) == len(found), "no key is reported twice"


ODD_LINES = [
    "cam_deg, lift_mm",
    "crank",
    "10, 1",
    "20 2",
    "nan, 1",
    "1e400, 1",
    "-5, -5",
    "1e200, 1e200",
    ",",
    "# x",
    "\x00",
    "",
]


@settings(max_examples=80, deadline=None)
@given(odd=st.lists(st.tuples(st.integers(0, 74), st.sampled_from(ODD_LINES)), min_size=1, max_size=4))
def test_random_lift_table_is_read_or_refused(odd, tmp_path_factory):
    lines = table().splitlines()
    for at, line in odd:
        lines.insert(at, line)
    path = tmp_path_factory.mktemp("any") / "lift.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    try:
        columns = read_lift(path)
        event, _ = lift_table(columns.angle, columns.lift)
    except InputError:
        return
    assert 0.001 < event.height < 0.012


@pytest.mark.parametrize("value", ['"lift.csv"', '{ file = "lift.csv" }'])
def test_fault_of_file_named_like_key_is_reported_once(value, text, substitute, tmp_path):
    (tmp_path / "lift.csv").write_text(FILES["few.csv"], encoding="utf-8")
    path = tmp_path / "file.toml"
    edit = ('law = "shm"\nlift = "6 mm"\nrise = "180 deg"\nreturn = "180 deg"\n', f"lift_table = {value}\n")
    path.write_text(substitute(text, edit), encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        read_case(path)
    assert [re.sub(r"line \d+", "line", fault.where) for fault in refusal.value.faults] == [
        "cams.intake.lift_table (line): lift.csv: lift table"
    ]
