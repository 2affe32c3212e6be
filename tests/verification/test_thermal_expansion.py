"""Thermal expansion of members: forces between walls, lash, preload and lateral stiffness.

A bar between walls under a temperature rise dT has the force EA alpha dT; a free bar elongates by alpha L dT; a bar in
series with a spring of stiffness k has the force alpha L dT k EA/(EA + k L) (S. P. Timoshenko, Strength of Materials,
part I, 3rd ed., sec. 7). A pinned column with a half-sine bow d0 deflects further under P by d0 P/(Pcr - P) (S. P.
Timoshenko and J. M. Gere, Theory of Elastic Stability, 2nd ed., sec. 1.12).
"""

import math

import pytest

from flexcam import InputError, prepare, read_case, run, solve
from flexcam.case.input_checks import check_values
from flexcam.dynamics import SaveAt
from flexcam.fem.recovery import section_forces
from flexcam.fem.sections import Section
from flexcam.valvetrain import StrengthSink, build_structure, element_loads
from flexcam.valvetrain.modes import model_modes
from tests.pinned_rod import LENGTH, TUBE, pinned_rod

SOURCE = "Thermal expansion"
E, ALPHA, RISE = 2e11, 12e-6, 80.0
AREA = Section.circle(0.01).A
BAR = """
format = 1
nodes = { left = [0, 0, 0], right = ["250 mm", 0, 0] }
sections = { rod = { shape = "circle", diameter = "10 mm" } }
materials = { steel = { E = "200 GPa", nu = 0.3, density = 7800, expansion = "12 um/m/K" } }
run = { speed = "600 rpm", steps_per_revolution = 100, revolutions = 0.05, start = "equilibrium" }
output = { probes = ["right"] }

[members]
bar = { nodes = ["left", "right"], elements = 4, material = "steel", section = "rod", temperature = "80 K" }

[supports]
left = ["ux", "uy", "uz", "rx"]
right = ["uy", "uz"]
"""


def bar_case(folder, *overrides):
    """Return the case of the bar with overrides."""
    path = folder / "bar.toml"
    path.write_text(BAR, encoding="utf-8")
    return read_case(path, overrides)


def test_force_of_bar_between_walls(record, tmp_path):
    response = run(bar_case(tmp_path, 'supports.right=["ux", "uy", "uz"]'))
    record(source=SOURCE, case="bar between walls", quantity="force", unit="N", reference=E * AREA * ALPHA * RISE,
           computed=response.channels["members.bar.compression"][-1], tolerance=1e-12, reason="exact")  # fmt: skip


def test_stress_of_bar_between_walls(tmp_path):
    ready = prepare(bar_case(tmp_path, 'supports.right=["ux", "uy", "uz"]'))
    sink = StrengthSink(build_structure(ready.model))
    solve(ready.problem, ready.scheme, save=SaveAt(field_every=1), sinks=[sink])
    assert sink.members()["bar"].mean == pytest.approx(-E * ALPHA * RISE, rel=1e-9)


def test_elongation_of_free_bar(record, tmp_path):
    response = run(bar_case(tmp_path))
    record(source=SOURCE, case="free bar", quantity="elongation", unit="m", reference=ALPHA * 0.25 * RISE,
           computed=response["right.ux"].displacement[-1], tolerance=1e-12, reason="exact")  # fmt: skip
    assert abs(response.channels["members.bar.compression"][-1]) < 1e-9 * E * AREA * ALPHA * RISE


def test_spring_preload_increases_by_expansion(record, tmp_path):
    k = 40e3
    spring = 'springs.valve={ at = "right", direction = "ux", stiffness = 40e3, installed_force = 300 }'
    response = run(bar_case(tmp_path, spring))
    # The installed bar is shorter by 300 N L/EA: the spring force of a cold case.
    cold = 300.0 * E * AREA / (E * AREA + k * 0.25)
    more = ALPHA * 0.25 * RISE * k * E * AREA / (E * AREA + k * 0.25)
    record(source=SOURCE, case="bar behind a spring", quantity="spring force", unit="N", reference=cold + more,
           computed=response.channels["springs.valve.force"][-1], tolerance=1e-12, reason="exact")  # fmt: skip


TRAIN = """
format = 1
sections = { rod = { shape = "circle", diameter = "8 mm" } }
run = { speed = "600 rpm", steps_per_revolution = 720, revolutions = 0.02, start = "equilibrium" }
output = { probes = ["top"] }

[nodes]
cam = [0, 0, 0]
tappet = [0, "30 mm", 0]
top = [0, "230 mm", 0]
stem = [0, "231 mm", 0]
head = [0, "331 mm", 0]

[materials]
steel = { E = "200 GPa", nu = 0.3, density = 7800, expansion = "12e-6 1/K" }
valve = { E = "210 GPa", nu = 0.3, density = 7800, expansion = "17e-6 1/K" }

[members]
pushrod = { nodes = ["tappet", "top"], material = "steel", section = "rod", temperature = "80 K" }
stem = { nodes = ["stem", "head"], material = "valve", section = "rod", temperature = "300 K" }

[supports]
tappet = ["ux", "uz", "rx", "ry", "rz"]
stem = ["ux", "uz", "rx", "ry", "rz"]

[springs]
tappet = { at = "tappet", direction = "uy", stiffness = "1 kN/m", installed_force = "20 N" }
valve = { at = "head", direction = "uy", stiffness = "30 kN/m", installed_force = "300 N" }

[cams.intake]
at = "cam"
axis = [1, 0, 0]
law = "4-5-6-7"
lift = "8 mm"
rise = "60 deg"
return = "60 deg"
phase = "90 deg"

[contacts]
cam = { cam = "intake", follower = "tappet", model = "bilateral", stiffness = "1 GN/m" }
lash = { from = "top", to = "stem", direction = "uy", model = "lash", gap = "0.8 mm", stiffness = "30 MN/m" }
seat = { at = "head", direction = "uy", model = "seat", stiffness = "1 GN/m" }
"""


SEPARATE_ADJUSTER = (
    'nodes.left=["50 mm", 0, 0]',
    'nodes.right=["60 mm", 0, 0]',
    'masses.left={ at = "left", mass = "0.1 kg" }',
    'masses.right={ at = "right", mass = "0.1 kg" }',
    'springs.left={ at = "left", direction = "ux", stiffness = "10 kN/m" }',
    'springs.right={ at = "right", direction = "ux", stiffness = "10 kN/m", installed_force = "20 N" }',
    'contacts.oil={from="left", to="right", direction="ux",model="lash-adjuster", stiffness=2e7, leak=1e3, refill=1}',
    "contacts.oil.plunger_force=10",
)
"""An adjuster that is not part of the train."""


@pytest.mark.parametrize(
    ("model", "further"), [("beams", ()), ("rigid", ()), ("sdof", ()), ("chain", ()), ("beams", SEPARATE_ADJUSTER)]
)
def test_expansion_does_not_count_as_valve_loft(tmp_path, model, further):
    """The valve of a warm train rises further by the expansion, but not above the lift of the warm rigid train."""
    path = tmp_path / "train.toml"
    path.write_text(TRAIN, encoding="utf-8")
    common = ["run.revolutions=1", "run.speed=100rpm", f"fidelity.model={model!r}", *further]
    warm, cold = (
        run(read_case(path, [*common, *more])).metrics["contacts.seat.valve_loft"]
        for more in ((), ("members.pushrod.temperature=0", "members.stem.temperature=0"))
    )
    assert abs(warm - cold) < 1e-5  # the force of the valve spring increases slightly; the expansion itself is 0.7 mm


def test_lash_of_warm_train(record, tmp_path):
    """The cam supports the pushrod and the seat the valve; both expand into the lash."""
    path = tmp_path / "train.toml"
    path.write_text(TRAIN, encoding="utf-8")
    warm, cold = (
        run(read_case(path, [f"members.pushrod.temperature={a}", f"members.stem.temperature={b}"]))
        for a, b in ((80, 300), (0, 0))
    )
    change = [float(one.channels["contacts.lash.gap"][0]) for one in (warm, cold)]
    reference = 12e-6 * 0.2 * 80.0 + 17e-6 * 0.1 * 300.0
    # The tappet spring at the pushrod foot does not change; the stiff seat and cam deform by 1e-9 m.
    record(source=SOURCE, case="valve train", quantity="lash taken up", unit="m", reference=reference,
           computed=change[1] - change[0], tolerance=1e-6, reason="compliance of seat and cam")  # fmt: skip


def test_deflection_of_warm_bowed_column(record, tmp_path):
    """With fixed ends the column buckles at alpha dT = (pi/L)^2 Iz/A; at half of that the bow doubles."""
    critical = math.pi**2 * TUBE.Iz / (TUBE.A * LENGTH**2)
    path, bow = tmp_path / "rod.toml", 1e-7
    text = pinned_rod(bow, "", elements=4).replace('tip = ["uy", "uz"]', 'tip = ["ux", "uy", "uz"]')
    text = text.replace('density = "7800', 'expansion = "12e-6 1/K"\ndensity = "7800').replace(
        "bow =", f"temperature = {0.5 * critical / 12e-6!r}\nbow ="
    )
    path.write_text(text, encoding="utf-8")
    response = run(read_case(path))
    record(source=SOURCE, case="warm column, half of its buckling load", quantity="further deflection", unit="m",
           reference=bow, computed=response["mid.uy"].displacement[-1], tolerance=2e-4,
           reason="Euler's load of eight elements: (pi/8)^4/720, doubled near it")  # fmt: skip
    assert response.channels["members.rod.buckling_use"][-1] == pytest.approx(0.5, rel=1e-4)


def test_section_forces_and_frequency_of_warm_column(record, tmp_path):
    """For a straight column, the lateral frequency is f0 sqrt(1 - N/Pcr); the section force is that of the channel."""
    critical = math.pi**2 * TUBE.Iz / (TUBE.A * LENGTH**2)
    path = tmp_path / "rod.toml"
    text = pinned_rod(1e-7, "", elements=4).replace('tip = ["uy", "uz"]', 'tip = ["ux", "uy", "uz"]')
    text = text.replace('density = "7800', 'expansion = "12e-6 1/K"\ndensity = "7800')
    path.write_text(text, encoding="utf-8")
    case = read_case(path, [f"members.rod.temperature={0.5 * critical / 12e-6!r}"])
    ready = prepare(case)
    structure, still = build_structure(ready.model), ready.problem.start.displacement
    pressed = section_forces(structure.beams, structure.dofs.nodal(still), spread=element_loads(structure))
    assert -pressed[:, :, 0] == pytest.approx(0.5 * critical * 207e9 * TUBE.A, rel=1e-3)
    own = model_modes(structure, 1).modes.omegas[0], model_modes(structure, 1, loaded=still).modes.omegas[0]
    record(source=SOURCE, case="warm column, half of its buckling load", quantity="frequency over that of the cold one",
           unit="1", reference=math.sqrt(0.5), computed=own[1] / own[0], tolerance=1e-3,
           reason="Euler's load of eight elements")  # fmt: skip


def test_material_without_expansion_raises_error(tmp_path):
    with pytest.raises(InputError, match="'steel' does not expand") as refusal:
        prepare(bar_case(tmp_path, "materials.steel.expansion=0"))
    assert "members" in str(refusal.value)


def test_rigid_model_with_temperature_causes_warning(tmp_path):
    path = tmp_path / "train.toml"
    path.write_text(TRAIN, encoding="utf-8")
    warnings = check_values(read_case(path, ["fidelity.model=rigid"]))
    assert sum("rigid members do not expand" in one for one in warnings) == 2
