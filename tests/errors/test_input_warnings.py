"""Warnings about implausible but possible input; valid cases give no warnings."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from flexcam import InputError, RunFailedError, prepare, read_case, read_result
from flexcam.analysis.run_checks import check_input, check_lobes
from flexcam.case.builder import build_model
from flexcam.case.input_checks import TYPICAL_RANGES, check_coil_bind, check_values
from flexcam.cli.main import main

ROOT = Path(__file__).parents[2]
CASE = ROOT / "tests/data/inline.toml"
ENGINE = ROOT / "tests/data/every-engine.toml"
PUSHROD = ROOT / "flexcam/templates/pushrod-engine.toml"
GEAR, ROLLER = (ROOT / f"flexcam/templates/{name}.toml" for name in ("gear-drive", "roller-tappet"))

THIN_SECTION = 'sections.shaft={shape="custom", A=1e-4, Iy=1e-15, Iz=1e-15, J=2e-15}'

# case, override, and two parts of the expected warning
IMPLAUSIBLE = {
    "E in Pa": (CASE, "materials.steel.E=207", "207 Pa is unusual", "did you mean 207 GPa?"),
    "E as text": (CASE, "materials.steel.E=207 Pa", "207 Pa is unusual", "did you mean 207 GPa?"),
    "E in MPa": (CASE, "materials.steel.E=207000", "207000 Pa", "did you mean 207000 MPa?"),
    "E in MPa, meant in GPa": (CASE, "materials.steel.E=207 MPa", "207 MPa (2.07e+08 Pa) is unu", "usually 1e+09 to"),
    "a speed in its unit": (PUSHROD, "run.crank_speed=50000 rpm", "50000 rpm (5235.99 rad/s)", "2500 rad/s)"),
    "an installed force too small": (PUSHROD, "springs.valve.installed_force=0.4", "0.4 N is unusual", "mean 0.4 kN?"),
    "density in g/cm^3": (CASE, "materials.steel.density=7.8", "7.8 kg/m^3", "did you mean 7.8 g/cm^3?"),
    "strength in MPa": (CASE, "materials.steel.ultimate_strength=800", "800 Pa", "did you mean 800 MPa?"),
    "diameter in mm": (CASE, "sections.shaft.diameter=25", "25 m is unusual", "did you mean 25 mm?"),
    "a node in mm": (CASE, "nodes.rear=[180,0,0]", "nodes.rear", "did you mean 180 mm?"),
    "mass in g": (CASE, "masses.valve.mass=90", "90 kg", "did you mean 90 g?"),
    "a seat in N/m": (PUSHROD, "contacts.seat.stiffness=60N/m", "60N/m (60 N/m) is unusual", "did you mean 60 kN/m?"),
    "a valve without mass": (PUSHROD, "masses.valve.mass=0kg", "0kg (0 kg) is unusual", "0.0005 to 20 kg"),
    "a bow of 10 mm": (PUSHROD, "members.pushrod.bow=10mm", "10mm (0.01 m) is unusual", "up to 0.005 m"),
    "density of nothing": (CASE, "materials.steel.density=0", "0 kg/m^3 is unusual", "500 to 30000 kg/m^3"),
    "stiffness in kN/m": (CASE, "springs.valve.stiffness=50", "50 N/m is unusual", "mean 50 kN/m?"),
    "engine speed in rpm": (PUSHROD, "run.crank_speed=4000", "4000 rad/s", "did you mean 4000 rpm?"),
    "camshaft speed in rpm": (CASE, "run.speed=2000", "2000 rad/s is unusual", "did you mean 2000 rpm?"),
    "a usual engine speed in rpm": (PUSHROD, "run.crank_speed=2000", "19098.6 rpm", "did you mean 2000 rpm?"),
    "a usual camshaft speed in rpm": (CASE, "run.speed=600", "600 without a unit", "did you mean 600 rpm?"),
    "a phase in deg": (PUSHROD, "cams.intake.phase=105", "105 without a unit is in rad, 6016.06", "mean 105 deg?"),
    "a negative phase in deg": (PUSHROD, "cams.intake.phase=-60", "-60 without a unit is", "did you mean -60 deg?"),
    "a timing in deg": (CASE, 'cams.intake.timing={lift="1 mm", opening=-20}', "timing.opening", "mean -20 deg?"),
    "an angular lash in deg": (GEAR, "contacts.driving.gap=10", "10 rad is unusual", "did you mean 10 deg?"),
    "damping in per cent": (CASE, "run.damping={modal=2}", "2 is unusual", "did you mean 2 %?"),
    "damping in us": (CASE, "run.damping={beta=20}", "20 s is unusual", "did you mean 20 us?"),
    "damping of 1 ms": (PUSHROD, "run.damping.beta=1ms", "1ms (0.001 s) is unusual", "did you mean 1 us?"),
    "a bow in mm": (PUSHROD, "members.pushrod.bow=0.3", "0.3 m is unusual", "did you mean 0.3 mm?"),
    "a torsion constant beyond the section": (CASE, "sections.shaft.J=1", "J = 1 m^4 is above Iy + Iz", "no shape"),
    "a section thinner than a circle": (CASE, THIN_SECTION, "Iy + Iz = 2e-15 m^4 is below", "circle of its area"),
    "a shear factor above 1": (CASE, "sections.shaft.kappa_y=5", "kappa_y = 5 is above 1", "shear"),
    "arms in mm": (CASE, "rockers.rocker.arms=[25,40]", "25 m is unusual", "did you mean 25 mm?"),
    "inertia in kg mm^2": (CASE, "rockers.rocker.inertia=100000", "kg m^2 is unusual", "did you mean"),
    "inertia too large by 1000": (PUSHROD, "rockers.rocker.inertia=0.06", "0.06 kg m^2 is unusual", "1e-07 to 0.01 kg"),
    "a mass of 90 mg": (PUSHROD, "masses.valve.mass=90mg", "90mg (9e-05 kg) is unusual", "0.0005 to 20 kg"),
    "a spring of 60 mg": (PUSHROD, "springs.valve.mass=60mg", "60mg (6e-05 kg) is unusual", "0.0001 to 20 kg"),
    "a cam of 1.2 m": (PUSHROD, "cams.intake.width=1.2m", "1.2m (1.2 m) is unusual", "0.001 to 0.3 m"),
    "a temperature of 800 K": (PUSHROD, "members.pushrod.temperature=800", "800 K is unusual", "up to 700 K"),
    "lift in mm": (CASE, "cams.intake.lift=6", "6 m is unusual", "did you mean 6 mm?"),
    "speed in rpm": (CASE, "run.speed=3000", "3000 rad/s is unusual", "did you mean 3000 rpm?"),
    "a spring as soft as nothing": (CASE, "springs.valve.stiffness=1e-5", "1e-05 N/m is unusual", ""),
    "gravity in mm/s^2": (CASE, "run.gravity=[0,-9810,0]", "9810 m/s^2", "did you mean 9810 mm/s^2?"),
    "lash in mm": (ENGINE, "contacts.play.gap=0.3", "play", "did you mean 0.3 mm?"),
    "a tolerance in per cent": (CASE, "fidelity.tolerance={force=5}", "5 is unusual", "did you mean 5 %?"),
    "a bearing in mm": (GEAR, "bearings.front.film.length=14", "14 m is unusual", "did you mean 14 mm?"),
    "a clearance in um": (GEAR, "bearings.rear.film.radial_clearance=30", "30 m is unusual", "did you mean 30 um?"),
    "a viscosity in mPa s": (GEAR, "bearings.front.film.viscosity=9", "9 Pa s is unusual", "did you mean 9 mPa s?"),
    "an adjuster's oil in mPa s": (ROLLER, "contacts.adjuster.oil.viscosity=15", "15 Pa s", "mean 15 mPa s?"),
    "a member thicker than long": (CASE, "sections.shaft.diameter=1", "1 m thick", "same unit?"),
}  # fmt: skip


@pytest.mark.parametrize("what", IMPLAUSIBLE)
def test_implausible_value_gives_warning(what, tried):
    path, override, *expected = IMPLAUSIBLE[what]
    found = [one for one in check_values(read_case(path, [override])) if expected[0] in one]
    assert found, check_values(read_case(path, [override]))
    assert expected[1] in found[0]
    assert f"(--set {override})" in found[0] or "line" in found[0], "with its place"
    tried("planted", f"number: {what}", 1, "warning with the likely unit or value")


PHASES = 'repeat.cylinder={names=["1", "2"], spacing=["0.1 m", 0, 0], phases=[0, 180]}'


def test_warning_names_phases_of_repeat_table(tmp_path):
    """The phases of the copies are within 0 to 2 pi; the warning names the table that the user wrote."""
    cam = "spare-{cylinder}"
    text = CASE.read_text(encoding="utf-8")
    part = f'[cams."{cam}"]\nat = "cam"\nlaw = "shm"\nlift = "5 mm"\nrise = "90 deg"\nreturn = "90 deg"\nphase = 105\n'
    (tmp_path / "case.toml").write_text(f"{text}\n{part}", encoding="utf-8")
    warned = [one for one in check_values(read_case(tmp_path / "case.toml", [PHASES])) if "without a unit" in one]
    assert [one.split(" (")[0] for one in warned] == [
        f"Warning: cams.{cam}.phase", "Warning: repeat.cylinder.phases.1",
    ]  # fmt: skip


def test_override_with_unit_gives_no_unit_warning(tmp_path):
    text = PUSHROD.read_text(encoding="utf-8")
    (tmp_path / "case.toml").write_text(text.replace('phase = "', 'phase = 9  # "', 1), encoding="utf-8")
    case = read_case(tmp_path / "case.toml", ["cams.intake.phase=515 deg"])
    assert not [one for one in check_values(case) if "phase" in one]


@pytest.mark.parametrize(
    "override", ["run.speed=314.159", "run.speed=300 rad/s", "run.speed=100", "springs.valve.installed_force=4 N"]
)
def test_plausible_value_gives_no_warning(override):
    assert not [one for one in check_values(read_case(CASE, [override])) if override.partition("=")[0] in one]


def test_endurance_limit_above_ultimate_strength_is_refused():
    strengths = 'materials.steel={E=2e11, nu=0.3, density=7800, ultimate_strength="400 MPa", endurance_limit="900 MPa"}'
    with pytest.raises(InputError, match="up to the ultimate strength, 4e"):
        read_case(CASE, [strengths])


LARGE = ("dohc-16-valve", "v8-bank")
"""Templates that take long to prepare."""


def _valid_cases():
    """Return all cases, every second one marked slow, and all templates."""
    cases, starters = (sorted((ROOT / folder).rglob("*.toml")) for folder in ("cases", "flexcam/templates"))
    slow = [*cases[1::2], *(path for path in starters if path.stem in LARGE)]
    return [
        pytest.param(path, id=f"{path.parent.name}-{path.stem}", marks=[pytest.mark.slow] * (path in slow))
        for path in (*cases, *starters)
    ]


@pytest.mark.parametrize("path", _valid_cases())
def test_valid_case_gives_no_warning(path):
    try:
        case = read_case(path)
    except InputError:
        assert "[run]" not in path.read_text(encoding="utf-8"), "cams without a mechanism around them"
        return
    not_periodic = case.with_run({"start": "equilibrium"}) if case.record.run.start == "periodic" else case
    assert check_input(replace(prepare(not_periodic), case=case)) == []


def test_typical_ranges_are_ordered_and_sizes_positive():
    for usual in TYPICAL_RANGES:
        assert 0.0 <= usual.least < usual.most, usual.keys
        assert all(0.0 < size < 1e12 for size in usual.meant.values()), usual.keys


def test_spring_on_fixed_component_gives_warning(tried):
    overrides = ["springs.side.at=front", "springs.side.direction=uy", "springs.side.stiffness=1e6"]
    (warning,) = check_values(read_case(CASE, overrides))
    assert "springs.side" in warning
    assert "acts on nothing" in warning
    tried("planted", "a spring on a component that a support holds", 1, "warning")


def test_loads_without_effect_give_warnings():
    loads = [f'loads.{name}={{ at = "{at}", direction = "uy", force = {size} }}' for name, at, size in (
        ("lost", "lost", 3), ("borne", "front", -3), ("meant", "cam", 3), ("none", "front", 0))]  # fmt: skip
    ready = prepare(read_case(CASE, ["nodes.lost=[0, 0, 1]", *loads]))
    warned = [sentence for sentence in check_input(ready) if "loads." in sentence]
    assert [sentence.split(":")[1].strip() for sentence in warned] == ["loads.lost", "loads.borne"]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ('masses.lobe={ at = "cam", mass = 0.1, offset = ["0 mm", "3 mm", "4 mm"] }', "is 5 mm off the axis"),
        (
            'masses.lobe={ at = "cam", mass = 0.1, inertia = [4e-4, 3e-4, 2e-4] }',
            "transverse moments of inertia differ",
        ),
        ('masses.lobe={ at = "cam", mass = 0.1, offset = ["3 mm", 0, 0], inertia = [4e-4, 3e-4, 3e-4] }', ""),
    ],
)
def test_body_that_turns_with_a_shaft_gives_warning(override, words):
    warned = [one for one in check_input(prepare(read_case(PUSHROD, [override]))) if "keeps its orientation" in one]
    assert len(warned) == bool(words)
    assert all(words in one for one in warned)


def test_part_on_a_shaft_of_many_cams_gives_one_message():
    engine = ROOT / "cases/camshaft-4cyl/camshaft.toml"
    body = 'masses.wheel={ at = "sprocket", mass = 0.1, offset = [0, "2 mm", 0] }'
    assert len([one for one in check_input(prepare(read_case(engine, [body]))) if "keeps its orientation" in one]) == 1
    with pytest.raises(InputError) as refusal:
        build_model(read_case(engine, ['friction.seal={ at = "sprocket", direction = "rx", force = 0.5 }']))
    assert len(refusal.value.faults) == 1


def test_drag_about_a_rotating_shaft_is_refused():
    """The rotations of a shaft are relative to its drive: drag against ground would have no speed."""
    with pytest.raises(InputError, match=r"friction\.seal\.direction.*got the axis of a rotating shaft"):
        prepare(read_case(PUSHROD, ['friction.seal={ at = "rear", direction = "rx", force = 0.5 }']))
    prepare(read_case(PUSHROD, ['friction.seal={ at = "pushrod-top", direction = "uy", force = 0.5 }']))


def test_roller_away_from_its_offset_gives_warning():
    offset = "cams.intake.follower.offset=6 mm"
    (warning,) = check_lobes(build_model(read_case(ROLLER, [offset])))
    assert "is at 0 mm along [0.0, 0.0, -1.0] from the cam centre, but should be at 6 mm" in warning
    moved = 'nodes.tappet=["120 mm", "26.3 mm", "-6 mm"]'
    assert not check_lobes(build_model(read_case(ROLLER, [offset, moved, "contacts.intake.direction=uy"])))


def test_adjuster_without_seat_gives_warning(tmp_path):
    text = (ROOT / "cases/direct-acting/finger.toml").read_text(encoding="utf-8")
    start = text.index("\nseat = ")
    (tmp_path / "finger.toml").write_text(text[:start] + text[text.index("\n", start + 1) :], encoding="utf-8")
    warned = check_input(prepare(read_case(tmp_path / "finger.toml", ["run.start=equilibrium"])))
    assert any("always sinks: without a seat" in one for one in warned)


def test_valve_without_cam_gives_warning(tmp_path):
    text = (ROOT / "cases/pushrod-engine/intake.toml").read_text(encoding="utf-8")
    rod = 'pushrod = { nodes = ["tappet", '
    assert rod in text
    apart = text.replace(rod, 'pushrod = { nodes = ["rod", ').replace("[nodes]", '[nodes]\nrod = ["60 mm", "40 mm", 0]')
    (tmp_path / "case.toml").write_text(apart, encoding="utf-8")
    warned = check_input(prepare(read_case(tmp_path / "case.toml", ["run.start=rest"])))
    assert any("no cam moves the valve of seat 'seat'" in one for one in warned)


def test_unconnected_member_gives_warning(tmp_path, tried):
    alone = 'alone = { nodes = ["a", "b"], material = "steel", section = "tube" }\n[supports]'
    text = CASE.read_text(encoding="utf-8").replace("[supports]", alone)
    text = text.replace("[materials.steel]", "a = [1, 1, 1]\nb = [1, 1.2, 1]\n[materials.steel]")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    warned = [one for one in check_input(prepare(read_case(tmp_path / "case.toml"))) if "touches them" in one]
    assert len(warned) == 1
    assert "members alone" in warned[0]
    tried("planted", "a member that nothing touches", 1, "warning")


@pytest.mark.parametrize("start", ["rest", "equilibrium"])
def test_open_contact_without_spring_gives_warning(start, tmp_path, tried):
    """Without an installed force no spring presses the follower against its cam at the start."""
    case = ROOT / "cases/direct-acting/bucket.toml"
    assert check_input(prepare(read_case(case, [f"run.start={start}"]))) == []
    lines = [line for line in case.read_text(encoding="utf-8").splitlines() if "installed_force" not in line]
    (tmp_path / "case.toml").write_text("\n".join(lines), encoding="utf-8")
    (warning,) = check_input(prepare(read_case(tmp_path / "case.toml", [f"run.start={start}"])))
    assert "contacts.intake: no spring pushes the follower against its cam" in warning
    assert "check the direction of the contact, and the installed_force" in warning
    tried("planted", f"springs that cannot hold contact, start {start}", 1, "warning with the remedy")


@pytest.mark.slow
def test_open_contact_at_periodic_start_gives_no_warning():
    """The periodic motion starts with an open contact on the base circle; in equilibrium the spring closes it."""
    case = read_case(ROOT / "flexcam/templates/valve-bridge.toml", ['run.start="periodic"'])
    assert not [one for one in check_input(prepare(case)) if "no spring pushes" in one]


@pytest.mark.parametrize(
    ("phase", "start", "count"),
    [(-40, "rest", 1), (340, "rest", 1), (0, "rest", 0), (-40, "equilibrium", 0), (-40, "periodic", 0)],
)
def test_start_from_rest_during_lift_gives_warning(phase, start, count):
    """At 40 deg of a harmonic rise over 180 deg the lift is 3 mm (1 - cos 40 deg)."""
    case = read_case(CASE, [f"cams.intake.phase={phase} deg", f"run.start={start}"])
    found = [one for one in check_input(prepare(case)) if "middle of its lift" in one]
    assert len(found) == count
    if phase == -40 and count:
        assert "cams.intake" in found[0]
        assert "0.702 mm and 0.606 m/s" in found[0]
        assert 'start = "equilibrium"' in found[0]
    assert check_input(prepare(case, rigid=True)) == []


def test_run_prints_and_stores_warnings(tmp_path, capsys):
    words = [
        "run",
        str(CASE),
        "--set",
        "materials.steel.density=7.8",
        "--set",
        "run.revolutions=0.1",
        "-o",
        str(tmp_path),
        "--json",
    ]
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0
    warned = json.loads(capsys.readouterr().out)["warnings"]
    assert any("7.8 g/cm^3" in one for one in warned)
    assert "7.8 g/cm^3" in read_result(tmp_path / "inline.vtkhdf").about["warnings"]


COARSE = "run.steps_per_revolution=360"
STUDIES = {
    "campbell": ("--count", "2", "--orders", "1"),
    "compare": (),
    "fit": ("--to", "curve.csv", "--vary", "springs.valve.stiffness=30:60kN/m", "--steps", "1"),
    "limits": ("--workers", "1", "--lowest", "1000rpm", "--highest", "1100rpm"),
    "modes": (),
    "optimize": ("--vary", "springs.valve.stiffness=30:60kN/m", "--least", "frequency.1", "--evaluations", "4"),
    "sensitivity": ("--of", "frequency.1", "--to", "springs.valve.stiffness"),
    "stability": (),
    "sweep": ("--set", "springs.valve.stiffness=30,40kN/m", "--workers", "0", "-o", "out"),
    "trade": ("--repeats", "1"),
}
"""Words of commands that run or analyse a case, after the case file."""


@pytest.mark.parametrize("command", STUDIES)
def test_studies_print_input_warnings_once(flexcam, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    Path("curve.csv").write_text("cam angle [deg],valve displacement [mm]\n0,0\n60,3\n120,0\n")
    done = flexcam(command, CASE, *STUDIES[command], "--set", "masses.valve.mass=30kg", "--set", COARSE)
    assert done.err.count("30kg (30 kg) is unusual") == 1, done.err
    assert "30kg (30 kg) is unusual" not in done.out


def test_modes_do_not_warn_of_time_steps(flexcam):
    words = (CASE, "--set", "run.steps_per_revolution=36")
    assert "36 steps per revolution" in flexcam("check", *words).out
    assert "steps per revolution" not in flexcam("modes", *words).err


def test_failed_equilibrium_names_implausible_values():
    """A pushrod of 207 Pa cannot carry the spring force: the cause is the modulus, not the contact."""
    with pytest.raises(RunFailedError, match=r"materials\.steel\.E .*did you mean 207 GPa\?"):
        prepare(read_case(ROOT / "cases/pushrod-engine/lever.toml", ["materials.steel.E=207"]))


@pytest.mark.parametrize(("override", "message"), [
    ("cams.intake.base_radius=17.4mm", "undercut: its base circle"),
    ("sections.shaft.diameter=50mm", "its base circle has a radius of 24 mm, its shaft one of 25 mm"),
])  # fmt: skip
def test_infeasible_lobe_gives_warning(override, message):
    (warning,) = [one for one in check_lobes(build_model(read_case(PUSHROD, [override]))) if "cams.intake:" in one]
    assert message in warning


ROLL = 'cams.intake.follower={type="roller", radius="9 mm"'


@pytest.mark.parametrize(("overrides", "message"), [
    (["nodes.tappet.1=34 mm"], "is 34 mm from the cam centre, but it should be 24 mm (from base_radius);"),
    ([ROLL + "}"], "is 24 mm from the cam centre, but it should be 33 mm (from base_radius and the roller);"),
    ([ROLL + ', offset="3.4 mm"}', "nodes.tappet.1=33 mm"], ""),
    (["cams.intake.base_radius=26mm"], ""),
])  # fmt: skip
def test_follower_off_base_circle_gives_warning(overrides, message):
    """A base radius changed by a tenth is accepted; an offset of 3.4 mm lowers a roller by 0.2 mm."""
    warned = [
        one
        for one in check_lobes(build_model(read_case(PUSHROD, overrides)))
        if "contacts.intake: in the lift direction" in one
    ]
    assert len(warned) == bool(message)
    assert all(message in one for one in warned)


def test_lash_without_seat_gives_warning(tmp_path):
    """Without a seat the cam carries the spring force, so that the lash stays closed."""
    text = PUSHROD.read_text(encoding="utf-8")
    begin = text.index("[contacts.seat]")
    (tmp_path / "case.toml").write_text(text[:begin] + text[text.index("[contacts.lash]") :], encoding="utf-8")
    (warning,) = check_input(prepare(read_case(tmp_path / "case.toml")))
    assert (
        "contacts.lash: the lash stays closed: without a seat the spring force always goes through the cam" in warning
    )


@pytest.mark.parametrize(("factor", "warns"), [(1, False), (2, True)])
def test_cam_given_in_crank_angles_gives_warning(factor, warns):
    """The rise and return of the intake are twice as long in crank angles."""
    cam = read_case(PUSHROD).record.cams["intake"]
    case = read_case(PUSHROD, {"cams.intake.rise": factor * cam.rise, "cams.intake.return": factor * cam.rise})
    assert any("did you give crank angles?" in one for one in check_input(prepare(case))) == warns


def test_undercut_fault_names_base_radius():
    with pytest.raises(
        InputError, match=r"^cams\.intake\.base_radius .*: got 17\.4 mm, .*undercut.* first at 154\.6 deg of cam angle"
    ):
        prepare(read_case(PUSHROD, ["cams.intake.base_radius=17.4mm"]))


TWO_FOLLOWERS = """
format = 1
[nodes]
shaft = [0, 0, 0]
up = [0, "30 mm", 0]
beside = [0, 0, {side}]
[supports]
up = ["ux", "uz"]
beside = ["ux", "uy"]
[masses]
up = {{ at = "up", mass = "0.1 kg" }}
beside = {{ at = "beside", mass = "0.1 kg" }}
[springs]
up = {{ at = "up", direction = "uy", stiffness = "40 kN/m" }}
beside = {{ at = "beside", direction = [0, 0, {side}], stiffness = "40 kN/m" }}
[cams]
one = {{ at = "shaft", axis = [{axis}, 0, 0], law = "3-4-5", lift = "5 mm", rise = "60 deg", return = "60 deg" }}
[contacts]
up = {{ cam = "one", follower = "up", model = "bilateral", stiffness = "10 MN/m" }}
beside = {{ cam = "one", follower = "beside", model = "bilateral", stiffness = "10 MN/m" }}
[run]
speed = "1000 rpm"
"""


@pytest.mark.parametrize(("side", "axis", "later"), [(0.03, 1, 90), (0.03, -1, 270), (-0.03, 1, 270), (-0.03, -1, 90)])
def test_inconsistent_follower_angles_of_one_lobe_give_warning(tmp_path, side, axis, later):
    """A positive rotation about x turns the lobe from y to z."""
    (tmp_path / "both.toml").write_text(TWO_FOLLOWERS.format(side=side, axis=axis), encoding="utf-8")
    (warning,) = check_lobes(build_model(read_case(tmp_path / "both.toml")))
    assert (
        f"cams.one: it lifts up and beside at the same cam angle, but its lobe reaches the second {later} deg later"
        in warning
    )


def test_base_circle_equal_to_shaft_gives_no_warning():
    assert check_lobes(build_model(read_case(PUSHROD, ["sections.shaft.diameter=48mm"]))) == []


@pytest.mark.parametrize(("override", "message"), [
    ('materials.gold={E="80 GPa", nu=0.4, density="19300 kg/m^3"}', "no member is made of it"),
    ('sections.spare={shape="circle", diameter="5 mm"}', "no member has it"),
    ('cams.spare={at="cam", law="shm", lift="5 mm", rise="90 deg", return="90 deg"}', "no contact names it"),
])  # fmt: skip
def test_unused_part_gives_warning(override, message):
    """A misspelt name in --set defines a new part in addition to the intended one."""
    (warning,) = check_values(read_case(CASE, [override]))
    key = override.partition("=")[0]
    assert warning.startswith(f"Warning: {key} (--set {key}=")
    assert message in warning


def test_override_of_several_lines_is_refused():
    with pytest.raises(InputError, match=r"run\.speed"):
        read_case(CASE, ["run.speed=300\nrevolutions=5"])
    with pytest.raises(InputError, match=r"run\.speed"):
        read_case(CASE, ["run.speed=300\n[run]"])


def test_coil_bind_warning_names_sufficient_travel():
    """The travel is 5 mm; the warning names 4.88 mm, and the sum gives no warning, despite rounding errors."""
    case = ROOT / "cases/pushrod-engine/intake.toml"
    variants = (read_case(case, [f"springs.valve.clash_travel={mm} mm"]) for mm in (5, 9.88))
    (warning,), none = (check_coil_bind(build_model(variant), variant.speed) for variant in variants)
    assert warning.endswith("full lift needs 4.88 mm more clash_travel")
    assert none == []
