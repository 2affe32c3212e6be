"""Model faults are in one report with those of keys, units and references."""

# ruff: noqa: E501 - tables, a row to a line

import re
from itertools import chain
from pathlib import Path

import pytest

from flexcam import InputError, prepare, read_case
from flexcam.case.reader import CaseFile
from flexcam.case.starters import new_case
from flexcam.io import format_toml
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]

# faults of the template pushrod-engine, with the key of each
DENSITY = (('density = "7800', 'densty = "7800'), ["materials.steel.densty"])
STIFFNESS = (('stiffness = "50 kN/m"', 'stiffness = "50 kN"'), ["springs.valve.stiffness"])
MASS = (('mass = "0.06 kg"', 'mass = "0.06 m"'), ["masses.follower.mass"])
ARMS = (('arms = ["25 mm", "40 mm"]', 'arms = ["25 mm"]'), ["rockers.rocker.arms"])
LIFT_EVENT = (('rise = "75 deg"', 'rise = "300 deg"'), ["cams.intake: rise + dwell + return"])
SPEED = (('"5000 rpm"', '"5000 kg"'), ["run.crank_speed"])
COMPONENT = (('rear = ["uy", "uz"]', 'rear = ["uy", "uzz"]'), ["supports.rear.1"])
PROBE = (('probes = ["valve"', 'probes = ["vavle"'), ["output.probes"])
FIDELITY = (("[run]", "[fidelity]\nmasses = 0\n[run]"), ["fidelity.masses"])
MATERIAL = (('material = "steel"', 'material = "stel"'), ["members.camshaft.material"])
UNDERCUT = (('lift = "6 mm"', 'lift = "40 mm"'), ["cams.intake.base_radius"])
INERTIA = (('mass = "0.09 kg"', 'mass = "0.09 kg", inertia = [1e-5, 1e-5, 1e-5]'), ["masses.valve"])
ACROSS = (
    ("[springs.tappet]", '[springs.more]\nat = "valve"\ndirection = "ux"\nstiffness = "1 N/m"\n[springs.tappet]'),
    ["springs.more.direction"],
)
STOP = (
    (
        "[contacts.seat]",
        '[contacts.stop]\nat = "tappet"\ndirection = "ux"\nmodel = "seat"\nstiffness = "1 MN/m"\n[contacts.seat]',
    ),
    ["contacts.stop"],
)
SLIDES = (
    (
        "[run]",
        '[friction]\nguide = { at = "tappet", direction = "ux", force = 1 }\nseal = { at = "pushrod-top", direction = "ux", force = 1 }\n[run]',
    ),
    ["friction.guide", "friction.seal"],
)
SHAFT = (
    ('"circle", diameter = "30 mm"', '"rectangle", width_y = "30 mm", width_z = "20 mm"'),
    ["members.camshaft.section"],
)

COMBINED_FAULTS = {
    "a key, a reference and two parts": (DENSITY, PROBE, INERTIA, UNDERCUT),
    "a unit of a spring": (STIFFNESS, UNDERCUT, STOP),
    "a unit of a mass": (MASS, ACROSS, UNDERCUT, SLIDES),
    "a rocker": (ARMS, INERTIA, ACROSS, UNDERCUT),
    "a cam": (LIFT_EVENT, SHAFT, STOP),
    "the speed": (SPEED, UNDERCUT, SHAFT),
    "the fidelity": (FIDELITY, STOP, UNDERCUT),
    "a support": (COMPONENT, UNDERCUT, SLIDES),
    "a material": (MATERIAL, INERTIA, UNDERCUT),
    "parts on their mesh and in their equations": (SHAFT, INERTIA, UNDERCUT, SLIDES),
}  # fmt: skip


@pytest.fixture
def starter(tmp_path):
    return new_case("pushrod-engine", tmp_path / "engine.toml")[0].read_text(encoding="utf-8")


@pytest.mark.parametrize("name", COMBINED_FAULTS)
def test_report_contains_exactly_the_faults(name, starter, substitute, faults_of):
    edits, places = zip(*COMBINED_FAULTS[name], strict=True)
    wheres = [fault.where for fault in faults_of(substitute(starter, *edits))]
    assert sorted(re.sub(r" \(line [^)]*\)", "", one) for one in wheres) == sorted(chain.from_iterable(places))
    lines = [int(re.search(r"line (\d+)", one)[1]) for one in wheres]
    assert lines == sorted(lines)


@pytest.mark.parametrize("command", ["check", "run"])
def test_commands_report_all_faults_with_exit_code_2(command, starter, substitute, flexcam, tmp_path):
    edits, places = zip(*COMBINED_FAULTS["a key, a reference and two parts"], strict=True)
    path = tmp_path / "case.toml"
    path.write_text(substitute(starter, *edits), encoding="utf-8")
    done = flexcam(command, path, "--json")
    assert done.code == 2
    assert all(place in done.out + done.err for place in chain.from_iterable(places))


@pytest.mark.parametrize(
    "template", mostly_slow(["published-model", "finger-follower", "valve-bridge", "desmodromic", "leak-down"], 5)
)
def test_fault_of_one_part_causes_no_fault_of_another(template, tmp_path):
    """Contacts, cams, supports, masses and springs are replaced by texts, rockers get an unknown key."""
    path = ROOT / "cases/checks/leak-down.toml"
    file = CaseFile.open(path if template == path.stem else new_case(template, tmp_path / "case.toml")[0])
    for kind in ("sections", "members", "supports", "masses", "bearings", "springs", "rockers", "cams", "contacts"):
        for name, part in list(file.raw.get(kind, {}).items())[:2]:
            wrong = {**part, "wrong": 1} if kind == "rockers" else "none"
            tables = {**file.raw, kind: {**file.raw[kind], name: wrong}}
            with pytest.raises(InputError) as refusal:
                CaseFile(file.path, format_toml(tables)).read()
            wheres = [fault.where for fault in refusal.value.faults]
            assert all(where.startswith(f"{kind}.{name}") for where in wheres), wheres


def test_templates_have_no_model_fault(tmp_path):
    for template in ("pushrod-engine", "roller-tappet", "gear-drive", "lumped-train", "published-model"):
        file = CaseFile.open(new_case(template, tmp_path / f"{template}.toml")[0])
        assert not file.complete_refusal(InputError(())).faults, template


# Independent faults of nodes, start, steps, equations, copies and bodies: a template, then for each fault
# the old text, the new text and the key of the fault.
NODE = ('rear = ["180 mm"', 'rear = ["180 kg"', "nodes.rear.0")
START = ("[output]", '[run.start.displacement]\n"nowhere.uy" = 0\n[output]', "run.start.displacement")
REST = ('start = "equilibrium"', "", "")
SMALLEST = ("[output]", '[run.adaptive]\nsmallest = "1 s"\n[output]', "run.adaptive.smallest")
SPRINGZ = ("[run]", "[springz]\n[run]", "springz")
FIXED_TAPPET = ('tappet = ["ux", "uz", "ry"]', 'tappet = ["ux", "uy", "uz", "ry"]', "contacts.intake.follower")
RIGID = (
    "[run]",
    '[fidelity]\nmodel = "rigid"\n[contacts.stop]\nat = "tappet"\ndirection = "-uy"\nmodel = "seat"\nstiffness = 1e7\n[run]',
    "contacts.intake",
)
INDEPENDENT = {
    "a node and a cam": ("pushrod-engine", NODE, (*UNDERCUT[0], *UNDERCUT[1])),
    "one place and a mass": ("pushrod-engine", ('front = ["60 mm"', 'front = ["0 mm"', "nodes.front"), (*INERTIA[0], *INERTIA[1])),
    "a start and a node": ("pushrod-engine", REST, START, NODE),
    "a start and adaptive steps": ("pushrod-engine", REST, START, SMALLEST),
    "a result and a unit": ("pushrod-engine", ('"equilibrium"', '{ result = "none.vtkhdf" }', "run.start.result"), (*STIFFNESS[0], *STIFFNESS[1])),
    "few steps and a part": ("pushrod-engine", ("steps_per_revolution = 3600", 'step = "1000 s"', "run"), (*STOP[0], *STOP[1])),
    "a period and a reference": (
        "pushrod-engine", ("steps_per_revolution = 3600", 'step = "1.37 ms"', "run.step"), ('"equilibrium"', '"periodic"', ""), (*PROBE[0], *PROBE[1]),
    ),
    "a method and a key": ("pushrod-engine", ("[output]", '[run.integrator]\nmethod = "central-difference"\n[output]', "run.steps_per_revolution"), SPRINGZ),
    "a chain and a unit": ("pushrod-engine", ("[run]", '[fidelity]\nmodel = "chain"\nmasses = 900\n[run]', "fidelity.masses"), (*MASS[0], *MASS[1])),
    "a rigid train and a unit": ("pushrod-engine", RIGID, (*MASS[0], *MASS[1])),
    "the version and a part": ("pushrod-engine", ("format = 1", "format = 2", "format"), (*SHAFT[0], *SHAFT[1])),
    "a published load and a key": ("published-model", FIXED_TAPPET, SPRINGZ),
    "the spring of a published load": ("published-model", ('direction = "uy"', 'direction = "up"', "springs.valve.direction"), SPRINGZ),
    "the mass of a follower": ("lumped-train", ('at = "tappet", mass', 'at = "tapet", mass', "masses.tappet.at"), SPRINGZ),
    "copies and a speed": ("dohc-16-valve", ('spacing = ["36 mm"', 'spacing = ["36 kg"', "repeat.side.spacing.0"), ('"6000 rpm"', '"6000 kg"', "run.crank_speed")),
    "a body and adaptive steps": ("solid-rocker", ('"rocker-stiffness.mtx"', '"none.mtx"', "superelements.rocker.stiffness"), REST, SMALLEST),
}  # fmt: skip


@pytest.mark.parametrize("name", INDEPENDENT)
def test_independent_faults_are_in_one_report(name, tmp_path, substitute, faults_of):
    template, *edits = INDEPENDENT[name]
    text = new_case(template, tmp_path / "case.toml")[0].read_text(encoding="utf-8")
    faults = faults_of(substitute(text, *(edit[:2] for edit in edits)))
    wheres = [re.split(r" \(|:", fault.where)[0] for fault in faults]
    assert sorted(wheres) == sorted(place for *_, place in edits if place)


def test_key_of_older_format_suggests_new_table(starter, substitute, faults_of):
    (fault,) = faults_of(substitute(starter, ("[output]", "[run.phaser]\nshift = [[0, 0], [1, 0.1]]\n[output]")))
    assert fault.remedy == "did you mean the table [phasers]?"


def test_braces_in_repeat_name_are_one_fault(tmp_path):
    """Names of repeated parts contain the placeholder in braces, names of repeat tables do not."""
    path = new_case("dohc-16-valve", tmp_path / "case.toml")[0]
    path.write_text(path.read_text().replace("[repeat.cylinder]", '[repeat."{cylinder}"]'))
    with pytest.raises(InputError) as refusal:
        CaseFile.open(path).read()
    assert {fault.where.partition(" ")[0] for fault in refusal.value.faults} == {"repeat.{cylinder}"}


def test_follower_fixed_along_lift_is_refused(tmp_path):
    """The follower has a mass; it has no degree of freedom because of its support."""
    path = new_case("roller-tappet", tmp_path / "case.toml")[0]
    support = 'supports.tappet=["ux", "uy", "uz", "rx", "ry", "rz"]'
    with pytest.raises(InputError, match=r"'tappet', held along the lift.*[Ff]ree it in \[supports\]"):
        prepare(CaseFile.open(path).read([support]))


def test_follower_without_mass_is_refused(tmp_path, substitute, faults_of):
    """The support of the tappet does not hold it along the lift."""
    text = new_case("roller-tappet", tmp_path / "case.toml")[0].read_text(encoding="utf-8")
    edits = ('follower = { at = "tappet"', 'follower = { at = "plunger"'), ('at = "tappet"  ', 'at = "plunger"  ')
    (fault,) = faults_of(substitute(text, *edits))
    assert fault.remedy == "end a member there, or add masses.NAME = { at = 'tappet', mass = ... }"


def test_follower_on_cam_axis_is_refused(tmp_path):
    message = "direction: the follower is on the axis of its cam, so that the lift has no direction. Correct the key"
    with pytest.raises(InputError, match=message):
        prepare(read_case(new_case("pushrod-engine", tmp_path / "case.toml")[0], ["cams.intake.at=tappet"]))


@pytest.mark.parametrize(("template", "edit", "key"), [
    ("pushrod-engine", ('stiffness = "60 MN/m" ', 'stifness = "60 MN/m" '), "contacts.seat.stifness"),
    ("gear-drive", ('stiffness = "30 kN m/rad"', 'stifness = "30 kN m/rad"'), "contacts.driving.stifness"),
    ("gear-drive", ('film = { diameter', 'films = { diameter'), "bearings.front.films"),
])  # fmt: skip
def test_misspelt_key_is_one_fault(template, edit, key, tmp_path, substitute, faults_of):
    text = new_case(template, tmp_path / "case.toml")[0].read_text(encoding="utf-8")
    assert [fault.where.split(" (")[0] for fault in faults_of(substitute(text, edit))] == [key]


def test_misspelt_mesh_key_is_reported_with_other_faults(tmp_path, substitute, faults_of):
    text = Path("cases/tayeb/model-1-cycloidal.toml").read_text(encoding="utf-8")
    found = faults_of(substitute(text, ('mesh = "../../meshes/tayeb-1.msh"', 'meshh = "tayeb-1.msh"'), DENSITY[0]))
    places = [re.sub(r" \(line \d+\)", "", fault.where) for fault in found]
    assert {"meshh", "materials.steel.densty"} <= {*places}
    assert not any(place.startswith("nodes") for place in places)


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (("crank_speed", "crank_sped"), "run.crank_sped (line 110)"), (("[nodes]", "[node]"), "node (line 10)"),
        (("\nlift = ", "\nlfit = "), "cams.intake.lfit (line 80)"),
        (("[cams.intake]", "[cam.intake]"), "cam (line 77)"),
        (('installed_force = "400 N"', 'installed_length = "40 mm"'), "springs.valve.installed_length (line 64)"),
        (("[run]", '[run]\nspeed_fluctuation = 0.1'), "run.speed_fluctuation (line 110)"),
        (("[run]", '[run]\nsped = "2000 rpm"'), "run.sped (line 110)"),
    ],
)  # fmt: skip
def test_misspelt_shared_key_causes_no_further_fault(edit, place, starter, substitute, faults_of):
    """The checks across tables use the intended key."""
    assert [fault.where for fault in faults_of(substitute(starter, edit))] == [place]


@pytest.mark.parametrize(
    ("edit", "remedies"),
    [
        (('installed_force = "400 N"', 'preload = "400 N"'), ["did you mean 'installed_force'?"]),
        (('installed_force = "400 N"', 'installed_length = "40 mm"'), ["remove it"]),
        (('installed_force = "400 N"', 'instaled_force = "400 Nm"'), ["did you mean 'installed_force'?", "use a known unit, such as N"]),
        (('dissipation = "0.3 s/m"', 'damping = "0.3 s/m"'), ["did you mean 'dissipation'?"]),
        (('dissipation = "0.3 s/m"', 'damping = "0.3 s/m"\ndissipation = 0.3'), ["remove it, or change model"]),
    ],
)  # fmt: skip
def test_suggested_key_is_not_given_and_fits_value(edit, remedies, starter, substitute, faults_of):
    assert [fault.remedy for fault in faults_of(substitute(starter, edit))] == remedies


def test_fault_inside_misspelt_table_has_written_name(starter, substitute, faults_of):
    edit = ("[run]", '[run]\nspeed_fluctuation = { orders = [2], amplitudes = ["1 rpm"] }')
    places = [fault.where for fault in faults_of(substitute(starter, edit))]
    assert places == [
        "run.speed_fluctuation (line 110)",
        "run.speed_fluctuation.amplitudes.0 (line 110, entry 1 of amplitudes)",
    ]


def test_node_of_same_member_is_not_suggested(starter, substitute, faults_of):
    """With it the member would contain a node twice."""
    (fault,) = faults_of(substitute(starter, ('"274 mm"', '"24 mm"')))
    assert fault.remedy == "move 'pushrod-top'"
