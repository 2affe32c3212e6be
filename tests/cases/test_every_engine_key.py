"""All keys of engine parts are in a case that runs, and a change of each key changes the run."""

# ruff: noqa: E501 - tables, a row to a line

import shutil
from pathlib import Path

import numpy as np
import pytest
from pydantic import BaseModel

from flexcam import read_case, run
from flexcam.case import schema
from flexcam.case.reader import read_cams
from flexcam.case.schema import base

CHECKS = Path(__file__).parents[2] / "cases" / "checks"
DATA = Path(__file__).parents[1] / "data"
ENGINE = DATA / "every-engine.toml"

OIL = (
    'contacts.intake.lubrication={viscosity="10 mPa s",pressure_viscosity="15 1/GPa",roughness="0.3 um",'
    'conductivity="46 W/m/K",specific_heat="470 J/kg/K",wear_coefficient="1e-18 m^2/N"}'
)
FILM = 'film = { diameter = "30 mm", length = "15 mm", radial_clearance = "30 um", viscosity = "10 mPa s" }'
WARM = ("materials.steel.expansion=12e-6", "members.pushrod.temperature=10")

# Five steps from rest, starting in the middle of the rise.
SHORT = (
    "run.revolutions=0.007", "run.steps_per_revolution=720", "cams.intake.phase=-30deg", "cams.exhaust.phase=-30deg",
    "cams.direct.phase=-30deg", OIL, *WARM,
)  # fmt: skip

# By part: initial state that gives an impact.
IMPACT_STARTS = {
    "contacts.seat": 'run.start={ displacement = { valve = "0.02 mm" }, velocity = { valve = "-1 m/s" } }',
    "contacts.intake": 'run.start={ displacement = { "tappet.uy" = "3 mm" }, velocity = { "tappet.uy" = "-1 m/s" } }',
}

FREE = 'free_running = { cam = "intake", cam_mass = "0.4 kg", follower_mass = "0.1 kg" }'
SWING = 'fluctuation = { orders = [2, 4], amplitudes = ["3 %", 0.01], phases = ["30 deg", 0] }'

# by key: override
OVERRIDES = {
    "members.pushrod.bow": "members.pushrod.bow=-1mm",
    "members.pushrod.temperature": "members.pushrod.temperature=20",
    "materials.steel.expansion": "materials.steel.expansion=20e-6",
    "rockers.rocker.angles": "rockers.rocker.angles=[0.1, 0.0]",
    "rockers.rocker.angles, at the point": 'rockers.rocker.angles=["-8 deg", "4 deg"]',
    "rockers.rocker.arms": 'rockers.rocker.arms=["25 mm", "38 mm"]',
    "rockers.rocker.inertia": "rockers.rocker.inertia=2e-4",
    "rockers.rocker.stiffness": "rockers.rocker.stiffness=3e6",
    "rockers.rocker.damping": "rockers.rocker.damping=0",
    "rockers.rocker.drive_stiffness": "rockers.rocker.drive_stiffness=3e6",
    "rockers.rocker.drive_damping": "rockers.rocker.drive_damping=0",
    "rockers.finger.angles": "rockers.finger.angles=[0.0, 0.1]",
    "rockers.finger.stiffness": "rockers.finger.stiffness=3e6",
    "rockers.finger.inertia": "rockers.finger.inertia=2e-4",
    "contacts.intake.friction": "contacts.intake.friction=0",
    "contacts.intake.friction_speed": "contacts.intake.friction_speed=20",
    "contacts.intake.lubrication.viscosity": 'contacts.intake.lubrication.viscosity="8 mPa s"',
    "contacts.intake.lubrication.pressure_viscosity": 'contacts.intake.lubrication.pressure_viscosity="20 1/GPa"',
    "contacts.intake.lubrication.roughness": 'contacts.intake.lubrication.roughness="0.2 um"',
    "contacts.intake.lubrication.conductivity": 'contacts.intake.lubrication.conductivity="30 W/m/K"',
    "contacts.intake.lubrication.specific_heat": 'contacts.intake.lubrication.specific_heat="500 J/kg/K"',
    "contacts.intake.lubrication.wear_coefficient": 'contacts.intake.lubrication.wear_coefficient="2e-18 m^2/N"',
    "contacts.adjuster.stiffness": "contacts.adjuster.stiffness=5e6",
    "contacts.adjuster.leak": "contacts.adjuster.leak=5e3",
    "contacts.adjuster.plunger_force": "contacts.adjuster.plunger_force=60",
    "contacts.tip.gap": "contacts.tip.gap=0",
    "contacts.play.gap": "contacts.play.gap=0",
    "contacts.play.stiffness": "contacts.play.stiffness=5e6",
    "contacts.play.damping": "contacts.play.damping=0",
    "contacts.play.damping_depth": 'contacts.play.damping_depth="200 um"',
    "contacts.play.direction": 'contacts.play.direction="-uy"',
    "contacts.play.to": 'contacts.play.to="stem-end"',
    "springs.valve.wire.diameter": 'springs.valve.wire.diameter="4.2 mm"',
    "springs.valve.wire.coil_diameter": 'springs.valve.wire.coil_diameter="24 mm"',
    "springs.valve.wire.active_coils": "springs.valve.wire.active_coils=5",
    "springs.valve.wire.shear_modulus": 'springs.valve.wire.shear_modulus="70 GPa"',
    "springs.exhaust.wire.diameter": 'springs.exhaust.wire.diameter="4.2 mm"',
    "run.fluctuation.orders": "run.fluctuation.orders=[3, 4]",
    "run.fluctuation.amplitudes": "run.fluctuation.amplitudes=[0.0, 0.01]",
    "run.fluctuation.phases": "run.fluctuation.phases=[0, 0]",
    "run.start": 'run.start={ velocity = { "tappet.uy" = "1 mm/s" } }',
}  # fmt: skip


def run_channels(path, *overrides):
    response = run(read_case(path, [*SHORT, *overrides]))
    assert response.status.ok, str(response.status)
    return {**response.channels, "probes": response.probes.displacement, "angle": response.angle}


@pytest.fixture(scope="module")
def unchanged():
    return run_channels(ENGINE)


ROUNDING = {"energy.residual", "energy.numerical"}
"""Small differences of large energies."""


def any_change(one, other):
    """Return whether any history of equal length changed by more than rounding."""
    shared = [name for name in sorted((one.keys() & other.keys()) - ROUNDING) if one[name].shape == other[name].shape]
    return any(np.abs(one[name] - other[name]).max() > 1e-9 * np.abs(one[name]).max() for name in shared)


QUICK = (
    "members.pushrod.bow",
    "members.pushrod.temperature",
    "rockers.rocker.angles",
    "contacts.adjuster.leak",
    "contacts.intake.lubrication.viscosity",
)


@pytest.mark.parametrize("key", [pytest.param(k, marks=[] if k in QUICK else [pytest.mark.slow]) for k in OVERRIDES])
def test_key_changes_run(key, unchanged):
    assert any_change(unchanged, run_channels(ENGINE, OVERRIDES[key]))


@pytest.mark.slow
@pytest.mark.parametrize("part", IMPACT_STARTS)
def test_restitution_changes_run(part):
    one, other = (run_channels(ENGINE, IMPACT_STARTS[part], f"{part}.restitution={value}") for value in (0.0, 0.9))
    assert any_change(one, other)


@pytest.fixture
def rewrite(tmp_path):
    """Return a function that writes the case with one replaced text."""

    def write(old, new):
        text = ENGINE.read_text(encoding="utf-8")
        assert old in text
        path = tmp_path / "every-engine.toml"
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        return path

    return write


REPLACED = {
    "geometric_stiffness": ('geometric_stiffness = true\nbow = "0.3 mm"\n', ""),
    "fluctuation": (SWING, ""),
    "lever": ("[rockers.rocker]\n", "[rockers.rocker]\n# as it stands\n"),
    "drive_stiffness": ('drive_stiffness = "8 MN/m"\n', ""),
    "direction of the finger": ('to = "exhaust"\ndirection = "uy"', 'to = "exhaust"\ndirection = [0, 0.8, 0.6]'),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("key", REPLACED)
def test_omitted_key_changes_run(key, rewrite, unchanged):
    changed = any_change(unchanged, run_channels(rewrite(*REPLACED[key])))
    assert changed == (key != "lever"), "a comment changes nothing, everything else does"


@pytest.mark.slow
def test_free_running_keys_change_run(rewrite, unchanged):
    path = rewrite(SWING, FREE)
    one = run_channels(path)
    assert any_change(unchanged, one)
    for key in ("cam_mass=2.0", "follower_mass=2.0"):
        assert any_change(one, run_channels(path, f"run.free_running.{key}")), key
    assert any_change(one, run_channels(path, 'run.free_running.cam="exhaust"', "cams.exhaust.phase=20deg"))


LINEAR = Path(__file__).parents[2] / "cases/pushrod-engine/intake.toml"


@pytest.mark.slow
def test_periodic_start_returns_after_revolution():
    """The state returns after one revolution, as the statistics of the run state."""
    about = ["run.crank_speed=2000rpm", "run.steps_per_revolution=720", "run.revolutions=1", 'run.start="periodic"']
    response = run(read_case(LINEAR, about))
    valve_motion = response["valve"].displacement
    assert response.status.ok
    assert 0.0 <= response.stats.periodicity < 1e-2
    assert abs(valve_motion[-1] - valve_motion[0]) <= 2e-2 * np.ptp(valve_motion)


def keys_in(value):
    """Return (record, key) of all given keys."""
    if isinstance(value, BaseModel):
        here = {(type(value).__name__, key) for key in value.model_fields_set}
        return here.union(*(keys_in(getattr(value, key)) for key in value.model_fields_set))
    inside = value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else ()
    return set().union(*(keys_in(one) for one in inside))


def subclasses(kind):
    return {kind}.union(*(subclasses(one) for one in kind.__subclasses__()))


def all_keys(modules):
    """Return (record, key) of all tables of some modules."""
    kinds = [one for one in subclasses(base.Record) if one.__module__ in {m.__name__ for m in modules}]
    return {(one.__name__, key) for one in kinds if not one.__name__.startswith("_") for key in one.model_fields}


@pytest.mark.slow
def test_refill_changes_run():
    """The check valve opens after the lift."""
    oil = 'contacts.lash={ at = "rocker", model = "lash-adjuster", stiffness = 15e6, leak = 1e5, refill = %s, plunger_force = 20 }'
    about = ["run.crank_speed=7000rpm", "run.revolutions=0.6", "run.steps_per_revolution=720"]
    one, other = (run(read_case(LINEAR, [*about, oil % value])).channels for value in (2000.0, 200.0))
    assert any_change(one, other)


def test_adjuster_between_nodes_leaks_down():
    oil = 'contacts.play={ from = "lifter-top", to = "stem", direction = "uy", model = "lash-adjuster", '
    oil += 'stiffness = "20 MN/m", leak = "100 kN s/m", refill = "200 N s/m", plunger_force = "20 N" }'
    found = run_channels(ENGINE, oil)
    assert found["contacts.play.force"].max() > 20.0
    assert np.ptp(found["contacts.play.leak_down"]) > 0.0


COILS = (
    'springs.stem={ at = "stem", direction = "uy", installed_compression = "8 mm", elements = 2, coils = [{ turns = 2, '
)
COILS += 'diameter = ["24 mm", "20 mm"], pitch = "5 mm" }, { turns = 4, diameter = "24 mm", pitch = "9 mm" }], '
COILS += 'wire = { diameter = "4 mm", shear_modulus = "80 GPa", density = "7850 kg/m^3" } }'
TABLE = 'springs.lifter={ at = "lifter", direction = "uy", installed_force = 10, force_table = [[0, 0], [0.04, 24], [0.05, 40]] }'


@pytest.mark.slow
def test_nonlinear_springs_change_run(unchanged):
    one = run_channels(ENGINE, COILS)
    assert any_change(unchanged, one)
    assert any_change(one, run_channels(ENGINE, COILS, "springs.stem.coils.0.pitch=6 mm"))
    assert any_change(unchanged, run_channels(ENGINE, TABLE))


@pytest.mark.slow
def test_keys_of_coils_change_run():
    one = run_channels(ENGINE, COILS)
    for key in ("turns=2.5", "diameter=24 mm"):
        assert any_change(one, run_channels(ENGINE, COILS, f"springs.stem.coils.0.{key}")), key
    for key in ("diameter=4.2 mm", "density=8500", "shear_modulus=75 GPa"):
        assert any_change(one, run_channels(ENGINE, COILS, f"springs.stem.wire.{key}")), key


TOLERANCES = '{ lift = "1 %", velocity = "2 %", acceleration = "5 %", force = "5 %" }'
GAS = '{ at = "valve", direction = "uy", table = "gas.csv", area = "8 cm^2", phase = "10 deg", repeat = true }'
GUIDE = (
    '{ at = "valve", to = "cam", direction = "uy", force = "8 N", breakaway_force = "12 N", stribeck_speed = "0.1 m/s", '
    'friction_speed = "5 mm/s", damping = "2 N s/m" }'
)
COIL = '{ at = "valve", direction = "uy", stiffness = "10 kN/m", mass = "10 g" }'
NEST = (
    f"springs.inner={COIL}",
    f"springs.outer={COIL}",
    "friction.nest={ spring = 'inner', inside = 'outer', force = 10 }",
)
WIRE = "wire = { diameter = '3 mm', coil_diameter = 'DIAMETER', active_coils = 5, shear_modulus = '80 GPa' }"
PRESSED = COIL.replace('stiffness = "10 kN/m"', WIRE)
INTERFERENCE = (
    f"springs.inner={PRESSED.replace('DIAMETER', '20 mm')}",
    f"springs.outer={PRESSED.replace('DIAMETER', '26 mm')}",
    "friction.nest={ spring = 'inner', inside = 'outer', coefficient = 0.1, interference = '0.05 mm' }",
)
ADJUSTER = (
    '{ at = "rocker", model = "lash-adjuster", refill = "200 N s/m", plunger_force = "20 N", oil = '
    '{ viscosity = "20 mPa s", bulk_modulus = "1.5 GPa", plunger_diameter = "11 mm", clearance = "6 um", '
    'land_length = "8 mm", chamber_height = "5 mm", air = "5 %", pressure = "2 MPa" } }'
)
BODY = """
format = 1
nodes = { foot = [0, 0, 0], tip = [0, 1, 0] }
run = { speed = "600 rpm", revolutions = 1, steps_per_revolution = 100 }
superelements = { arm = { nodes = { 1 = "foot", 2 = "tip" }, units = "m-kg-s", mass = "K.mtx", stiffness = { file = "K.mtx" }, damping = "K.mtx", modes = 2 } }
"""
PAPERS = ("checks/mathieu.toml", "checks/pump-up.toml", "li/valve-train.toml", "petrescu/valve-spring.toml")


def test_every_key_of_the_format_is_in_a_case(rewrite, tmp_path):
    shutil.copy(DATA / "lift.csv", tmp_path)
    cases = [
        (DATA / "every-key.toml", []), (DATA / "every-contact.toml", []), (ENGINE, [OIL, *WARM]), (rewrite(SWING, FREE), []),
        (ENGINE, [COILS, TABLE]),
        (DATA / "every-key.toml", ['run.integrator={ method = "hht", alpha = -0.1 }']),
        (DATA / "every-key.toml", ['run.integrator={ method = "generalized-alpha", rho_inf = 0.8 }']),
        (DATA / "every-key.toml", ['run.start={ displacement = { "cam.uy" = "1 um" }, velocity = { "cam.rx" = 1 } }']),
        (DATA / "every-key.toml", ['run.integrator={ method = "bathe" }']),
        (DATA / "every-key.toml", ['run.integrator={ method = "central-difference" }']),
        (DATA / "every-key.toml", ['run.integrator={ method = "radau", tolerance = 1e-6 }']),
        (DATA / "every-key.toml", ['run.adaptive={ tolerance = 1e-5, smallest = "1 ns" }']),
        (DATA / "every-key.toml", ['run.engine="direct"']),
        (DATA / "every-key.toml", ["masses.lobe.products=[1e-7, 0, 0]"]),
        (DATA / "every-key.toml", [f'bearings.rear={{ at = "rear", {FILM} }}']),
        *((ENGINE, [f'cams.intake.timing={{ lift = "1 mm", {one} = "10 deg" }}']) for one in ("opening", "closing", "centre")),
        (DATA / "every-key.toml", ['run.integrator={ method = "collocation" }']),
        (DATA / "every-key.toml", [f"loads.gas={GAS}", f"friction.guide={GUIDE}"]),
        (DATA / "every-key.toml", [*NEST]),
        (DATA / "every-key.toml", [*INTERFERENCE]),
        (DATA.parents[1] / "flexcam/templates/valve-bridge.toml", ['phasers.intake={ cams = ["intake"], shift = [["0 deg", "0 deg"], ["9 deg", "1 deg"]] }']),
        (DATA / "every-engine.toml", [f"contacts.adjuster={ADJUSTER}"]),
        (CHECKS / "mathieu.toml", []),
        (DATA / "every-key.toml", ['run.integrator={ method = "bathe" }', "fidelity.modes=20", "fidelity.reduction=craig-bampton"]),
        (DATA / "every-key.toml", ['fidelity={ model = "chain", masses = 2, estimate = true }']),
        (DATA / "every-key.toml", [f"fidelity.tolerance={TOLERANCES}", "fidelity.norm=max"]),
        (DATA / "every-key.toml", ['run.start={ result = "any.vtkhdf" }']),
        (DATA / "every-key.toml", ["members.pushrod.section=flat", "members.camshaft.section=own"]),
        (DATA / "every-key.toml", ['run.integrator={ method = "dop853", tolerance = 1e-8 }']),
        (DATA / "every-key.toml", ['run.integrator={ method = "central-difference" }']),
        (DATA / "every-key.toml", ['run.adaptive={ tolerance = 1e-6, smallest = "1 ns" }']),
        *((DATA.parents[1] / "cases" / name, []) for name in PAPERS),
    ]  # fmt: skip
    (tmp_path / "K.mtx").write_text("1 1 1 1 2.0\n2 1 2 1 2.0\n", encoding="utf-8")
    (tmp_path / "body.toml").write_text(BODY, encoding="utf-8")
    cases.append((tmp_path / "body.toml", []))
    text = (DATA / "every-key.toml").read_text(encoding="utf-8")
    text = text.replace("steps_per_revolution = 720", 'step = "20 us"').replace('speed = "1000', 'crank_speed = "2000')
    (tmp_path / "step.toml").write_text(text, encoding="utf-8")
    given = set().union(
        *(keys_in(read_case(path, over).record) for path, over in [*cases, (tmp_path / "step.toml", [])])
    )
    given |= keys_in(read_cams(DATA / "every-cam.toml"))
    modules = [getattr(schema, name) for name in ("cams", "contacts", "parts", "run", "springs")]
    between = {("AdjusterRecord", key) for key in ("start", "to", "direction")}  # same as those of a lash
    between |= {key for key in all_keys(modules) if key[0] == "RepeatRecord"}  # removed after its copies are made
    free = {key for key in all_keys(modules) if key[0] == "CamDesignRecord"}  # same as those of a cam
    assert len(all_keys(modules)) > 150
    assert all_keys(modules) - given - between - free == set()
