"""Bearings, loads, gravity, preloads and initial states, from the case file to the motion, against closed forms."""

# ruff: noqa: E501 - lines of case files

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run, solve
from flexcam.analysis.comparison import compare
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import ConstantSpeed
from flexcam.fem.sections import Section
from flexcam.valvetrain import build_structure

INLINE = Path(__file__).parents[1] / "data/inline.toml"
E, DENSITY, ROUND, LENGTH = 207e9, 7800.0, Section.circle(0.02), 0.6
EI = E * ROUND.Iz
BEAM = """
format = 1
[nodes]
root = {root}
tip = {tip}
[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"
[sections]
rod = {{ shape = "circle", diameter = "20 mm" }}
[members]
rod = {{ nodes = ["root", "tip"], material = "steel", section = "rod", elements = {elements}, mass = "{mass}" }}
{parts}
[run]
speed = "60 rpm"
step = "10 us"
revolutions = 1e-3
{run}
[output]
probes = {probes}
field_every = 1
"""
CLAMP = '[supports]\nroot = ["ux", "uy", "uz", "rx", "ry", "rz"]\n'
HINGES = '[supports]\nroot = ["ux", "uy", "uz", "rx"]\ntip = ["uy", "uz"]\n'
EQUILIBRIUM_START = 'start = "equilibrium"'


@pytest.fixture
def beam(tmp_path):
    """Return a function for a case of one straight rod from its [tables] and its lines of [run]."""

    def make(parts, run="", *, tip=(LENGTH, 0.0, 0.0), elements=2, probes=("tip",), mass="consistent"):
        text = BEAM.format(
            root=[0.0] * 3, tip=list(tip), elements=elements, mass=mass, parts=parts, run=run, probes=list(probes)
        )  # fmt: skip
        path = tmp_path / "case.toml"
        path.write_text(text.replace("'", '"'), encoding="utf-8")
        return read_case(path)

    return make


def assert_no_motion(response):
    """Assert equilibrium from the first instant: the residual of a direct solve moves less than 1e-9 of the deflection."""
    fields = response.fields.displacement
    assert np.abs(fields - fields[0]).max() <= 1e-9 * np.abs(fields).max()


POINT = '[loads.pull]\nat = "tip"\ndirection = "{}"\nforce = "{}"\n'
DISTRIBUTED = '[loads.wind]\nmember = "rod"\ndirection = "{}"\nforce_per_length = "{}"\n'


@pytest.mark.parametrize(
    ("load", "component", "expected"),
    [
        (POINT.format("-uy", "50 N"), "uy", -50.0 * LENGTH**3 / (3.0 * EI)),
        (POINT.format("uz", "-50 N"), "uz", -50.0 * LENGTH**3 / (3.0 * EI)),
        (POINT.format("ux", "2 kN"), "ux", 2000.0 * LENGTH / (E * ROUND.A)),
        (POINT.format("rz", "5 N m"), "uy", 5.0 * LENGTH**2 / (2.0 * EI)),
        (POINT.format("rz", "5 N m"), "rz", 5.0 * LENGTH / EI),
        (POINT.format("ry", "5 N m"), "uz", -5.0 * LENGTH**2 / (2.0 * EI)),
        (POINT.format("rx", "5 N m"), "rx", 5.0 * LENGTH / (E / 2.58 * ROUND.J)),
        (DISTRIBUTED.format("uy", "-100 N/m"), "uy", -100.0 * LENGTH**4 / (8.0 * EI)),
        (DISTRIBUTED.format("ux", "1 kN/m"), "ux", 1000.0 * LENGTH**2 / (2.0 * E * ROUND.A)),
    ],
)
@pytest.mark.parametrize("elements", [1, 4])
def test_equilibrium_of_loaded_cantilever(beam, load, component, expected, elements):
    """Cubic elements are exact at their nodes; rounding of K is eps n^4."""
    response = run(beam(CLAMP + load, EQUILIBRIUM_START, elements=elements))
    assert response[f"tip.{component}"].displacement[0] == pytest.approx(expected, rel=1e-9)
    assert_no_motion(response)


def test_sudden_load_starts_from_rest(beam):
    """A suddenly applied load acts from the start of the run: displacement zero and F = m a."""
    history = run(beam(CLAMP + POINT.format("uy", "50 N")))["tip.uy"]
    assert history.displacement[0] == 0.0
    assert history.acceleration[0] > 0.0


@pytest.mark.parametrize("start", ["equilibrium", "rest"])
@pytest.mark.parametrize(("mass", "share"), [("consistent", 5.0 / 384.0), ("lumped", 19.0 / 384.0 / 4.0)])
def test_sag_of_beam_under_gravity(beam, start, mass, share):
    """5 q L^4/(384 EI), also when installed; lumped: qL/4 at each quarter point, 19 P L^3/(384 EI)."""
    case = beam(HINGES, f'gravity = [0, "-9.81 m/s^2", 0]\nstart = "{start}"', elements=4, mass=mass)
    ready = prepare(case)
    middle = build_structure(ready.model).dofs.nodal(ready.problem.start.displacement)[
        ready.model.mesh.lines["rod"][2], 1
    ]
    expected = -share * DENSITY * ROUND.A * 9.81 * LENGTH**4 / EI
    assert middle == pytest.approx(expected, rel=1e-9)  # exact at nodes; rounding of K is eps n^4
    assert_no_motion(run(case))


HANGING_BODY = """
format = 1
nodes = { body = [0.0, 0.0, 0.0] }
masses.body = { at = "body", mass = "0.2 kg" }
springs.coil = { at = "body", direction = [0, 0.6, 0.8], stiffness = "2 kN/m", mass = "0.06 kg", elements = 3 }
run = { speed = "60 rpm", revolutions = 1e-3, start = "equilibrium", gravity = [0, "-6 m/s^2", "-8 m/s^2"] }
output = { probes = ["body"] }
"""


def test_weight_of_spring(tmp_path):
    """A body on a spring extends it by (m + m_s/2) g/k: the other end of the spring carries half of its weight."""
    path = tmp_path / "hanging.toml"
    path.write_text(HANGING_BODY, encoding="utf-8")
    response = run(read_case(path))
    sunk = response["body"].displacement[0, :3] @ [0.0, 0.6, 0.8]
    assert sunk == pytest.approx(-(0.2 + 0.03) * 10.0 / 2e3, rel=1e-12)
    assert_no_motion(response)


BEARINGS = """
[bearings]
front = { at = "root", stiffness = "2 MN/m" }
rear = { at = "tip", stiffness = "2 MN/m", damping = "100 N s/m" }
"""


@pytest.mark.parametrize("tip", [(LENGTH, 0.0, 0.0), (0.0, 0.0, LENGTH), (0.4, 0.2, -0.4)], ids=["x", "z", "skew"])
@pytest.mark.parametrize("around", [0.0, 30.0, 90.0])
def test_bearings_are_isotropic_across_shaft(beam, tip, around):
    """A force F at one end moves it by F/k in its own direction; sliding and rotation are free."""
    axis = np.array(tip) / LENGTH
    first = np.cross(axis, [0.3, 1.0, 0.2]) / np.linalg.norm(np.cross(axis, [0.3, 1.0, 0.2]))
    angle = math.radians(around)
    pull = math.cos(angle) * first + math.sin(angle) * np.cross(axis, first)
    load = f'[loads.pull]\nat = "tip"\ndirection = {pull.tolist()}\nforce = "100 N"\n'
    case = beam(BEARINGS + load, EQUILIBRIUM_START, tip=tip, probes=("tip", "root"))
    response = run(case)
    across = np.eye(3) - np.outer(axis, axis)
    assert across @ response["tip"].displacement[0, :3] == pytest.approx(100.0 / 2e6 * pull, abs=1e-9 * 5e-5)  # eps n^4
    assert np.abs(across @ response["root"].displacement[0, :3]).max() <= 1e-9 * 5e-5
    assert_no_motion(response)
    assert prepare(case).problem.system.free.shape[1] == 2


@pytest.mark.parametrize("tip", [(LENGTH, 0.0, 0.0), (0.4, 0.2, -0.4)], ids=["x", "skew"])
def test_unloaded_axial_motion_is_zero(beam, tip):
    """A load perpendicular to the shaft has no axial component, and neither has the equilibrium in any orientation."""
    axis = np.array(tip) / LENGTH
    pull = np.cross(axis, [0.3, 1.0, 0.2])
    load = f'[loads.pull]\nat = "tip"\ndirection = {pull.tolist()}\nforce = "100 N"\n'
    moved = run(beam(BEARINGS + load, EQUILIBRIUM_START, tip=tip))["tip"].displacement[0, :3]
    assert abs(axis @ moved) <= 1e-9 * np.linalg.norm(moved)


def test_initial_state_with_units(beam):
    start = 'start = { displacement = { "tip.uy" = "1 mm", "tip.rz" = "2 deg" }, velocity = { "tip.uz" = "-0.5 m/s", "tip.rx" = "60 rpm" } }'
    tip = run(beam(CLAMP, start))["tip"]
    assert tip.displacement[0] == pytest.approx([0.0, 1e-3, 0.0, 0.0, 0.0, math.radians(2.0)], rel=1e-15)
    assert tip.velocity[0] == pytest.approx([0.0, 0.0, -0.5, 2.0 * math.pi, 0.0, 0.0], rel=1e-15)


def test_initial_state_of_supported_component_raises_error(beam):
    with pytest.raises(InputError, match=r"root\.uy"):
        run(beam(CLAMP, 'start = { displacement = { "root.uy" = "1 mm" } }'))


def inline_case(folder, *pairs, name="case"):
    """Return the inline case with parts of its text replaced."""
    text = INLINE.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return read_case(path)


@pytest.fixture
def restart_cases(tmp_path):
    """Return a case of two revolutions, and a case that continues from the result of one."""
    first = prepare(inline_case(tmp_path, name="first"))
    solve(first.problem, first.scheme, save=first.save, sinks=[open_result_file(first, tmp_path)])
    return (
        inline_case(tmp_path, ("revolutions = 1", "revolutions = 2"), name="whole"),
        inline_case(tmp_path, ('start = "rest"', 'start = { result = "first.vtkhdf" }'), name="second"),
    )


@pytest.mark.parametrize(
    "start",
    ["rest", pytest.param("equilibrium", marks=pytest.mark.slow), pytest.param("periodic", marks=pytest.mark.slow)],
)
def test_sdof_run_continues_from_result(tmp_path, start):
    """The result includes the deflection by installed spring and preload that the single shape does not represent."""
    few = ("[output]", '[fidelity]\nmodel = "sdof"\n\n[output]'), ('start = "rest"', f'start = "{start}"')
    first = prepare(inline_case(tmp_path, *few, name="first"))
    one = solve(first.problem, first.scheme, save=first.save, sinks=[open_result_file(first, tmp_path)])
    second = run(inline_case(tmp_path, few[0], (few[1][0], 'start = { result = "first.vtkhdf" }'), name="second"))
    whole = run(inline_case(tmp_path, *few, ("revolutions = 1", "revolutions = 2"), name="whole"))
    late, again = whole["valve"].displacement[len(one.time) - 1 :], second["valve"].displacement
    # The state has double precision and is projected once more.
    assert np.abs(again - late).max() <= 1e-9 * np.abs(late).max()


def test_run_continues_from_result(restart_cases):
    """The run continues state and cam angle; the acceleration follows from equilibrium up to the residual of a solve."""
    whole, second = (run(case) for case in restart_cases)
    for name in ("valve", "cam"):
        for quantity in ("displacement", "velocity", "acceleration"):
            late, again = getattr(whole[name], quantity)[720:], getattr(second[name], quantity)
            assert np.abs(again - late).max() <= 1e-9 * np.abs(late).max(), (name, quantity)
    assert second.time == pytest.approx(whole.time[720:], rel=1e-12)
    assert second.angle == pytest.approx(whole.angle[720:], rel=1e-12)
    assert second.angle[0] == pytest.approx(2.0 * math.pi, rel=1e-12)


def test_rigid_run_continues_from_result(restart_cases):
    second = restart_cases[1]
    flexible, rigid = run(second), run(second, rigid=True)
    assert np.array_equal(flexible.time, rigid.time)
    found = compare(flexible, rigid, "valve", 3000.0)
    assert found.lift == pytest.approx(0.006 * 40.0 / 25.0, rel=1e-6)  # an instant is at the peak of the lift
    assert found.peak_deviation < 2.0


def preload(case):
    at_zero = ConstantSpeed(1.0).at(np.array([0.0]))
    return [float(x.history(at_zero)[0]) for x in prepare(case).problem.system.loads if x.name.endswith(".preload")]


SPRING = 'stiffness = "40 kN/m"\n'
INSTALLED_SPRING = f'{SPRING}installed_force = "300 N"\n'


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ("", 300.0 * 1.6),
        ('[springs.inner]\nat = "valve"\ndirection = "uy"\nstiffness = 5e3\ninstalled_force = 100\n', 400.0 * 1.6),
        ('[springs.tappet]\nat = "tappet"\ndirection = "uy"\nstiffness = 5e3\ninstalled_force = 100\n', 580.0),
        ('[springs.loose]\nat = "valve"\ndirection = "uy"\nstiffness = 5e3\n', 300.0 * 1.6),
        ('[springs.shaft]\nat = "drive"\ndirection = "ux"\nstiffness = 5e3\ninstalled_force = 100\n', 300.0 * 1.6),
        ('[springs.cam]\nat = "cam"\ndirection = "uy"\nstiffness = 5e3\ninstalled_force = 100\n', 300.0 * 1.6),
    ],
    ids=["one", "two at the valve", "one at the tappet", "one without a force", "one on the shaft", "one at the cam"],
)
def test_preload_is_sum_of_follower_springs(tmp_path, more, expected):
    """Forces at the valve count with the rocker ratio 40/25; those outside of the follower's train do not count."""
    case = inline_case(tmp_path, (SPRING, INSTALLED_SPRING), ("[cams.intake]", f"{more}[cams.intake]"))
    assert preload(case) == pytest.approx([expected], rel=1e-12)


PULLING_SPRING = '[springs.tappet]\nat = "tappet"\ndirection = "-uy"\nstiffness = 5e3\ninstalled_force = {}\n'


def test_opposing_spring_reduces_preload(tmp_path):
    case = inline_case(
        tmp_path, (SPRING, INSTALLED_SPRING), ("[cams.intake]", f"{PULLING_SPRING.format(80)}[cams.intake]")
    )
    assert preload(case) == pytest.approx([400.0], rel=1e-12)


def test_preload_against_lift_raises_error(tmp_path):
    case = inline_case(
        tmp_path, (SPRING, INSTALLED_SPRING), ("[cams.intake]", f"{PULLING_SPRING.format(500)}[cams.intake]")
    )
    with pytest.raises(InputError, match="a force against the lift"):
        prepare(case)


def test_sign_of_load_at_rocker_point(tmp_path):
    """10 N along -uy is -10 N along uy, also at the valve."""
    ends = []
    for given in ('direction = "-uy"\nforce = 10', 'direction = "uy"\nforce = -10'):
        case = inline_case(tmp_path, ("[cams.intake]", f'[loads.gas]\nat = "valve"\n{given}\n[cams.intake]'))
        system = prepare(case).problem.system
        ends.append(next(load.vector.min() + load.vector.max() for load in system.loads if load.name == "loads.gas"))
    assert ends == pytest.approx([-16.0, -16.0], rel=1e-12)  # the rocker's ratio 40/25 times 10 N


def test_opening_valve_spring_raises_error(tmp_path):
    """An installed force along -uy opens the valve."""
    case = inline_case(tmp_path, (SPRING, INSTALLED_SPRING), ('direction = "uy"', 'direction = "-uy"'))
    with pytest.raises(InputError, match="a force against the lift"):
        prepare(case)


def test_default_preload_exceeds_rigid_inertia(tmp_path):
    """2.5 times the moving mass at the tappet times h/2 omega^2, the maximum deceleration of simple harmonic motion."""
    rod = 7800.0 * math.pi / 4.0 * (0.008**2 - 0.005**2) * 0.250
    mass = 0.10 + rod + 1e-4 / 0.025**2 + 0.10 * 1.6**2
    expected = 2.5 * mass * 0.003 * (100.0 * math.pi) ** 2
    assert preload(inline_case(tmp_path)) == pytest.approx([expected], rel=1e-9)


SECOND_TRAIN = """
[rockers.second]
model = "lumped"
from = "top2"
to = "valve2"
arms = ["25 mm", "40 mm"]
inertia = "1e-4 kg m^2"
[springs.valve2]
at = "valve2"
direction = "uy"
stiffness = "40 kN/m"
[cams.exhaust]
at = "rear2"
law = "shm"
lift = "6 mm"
rise = "180 deg"
return = "180 deg"
phase = "{phase} deg"
[contacts.exhaust]
cam = "exhaust"
follower = "tappet2"
model = "published-load"
"""


def two_trains(folder, phase):
    """Return the inline case with a second, equal train on its own shaft at a distance of 1 m."""
    return inline_case(
        folder,
        ("[nodes]", ('[nodes]\ndrive2 = [0, 0, 1.0]\nfront2 = ["60 mm", 0, 1.0]\nrear2 = ["120 mm", 0, 1.0]\nend2 = ["180 mm", 0, 1.0]\n'
         'tappet2 = ["120 mm", "18 mm", 1.0]\ntop2 = ["120 mm", "268 mm", 1.0]')),
        ("[members]", ('[members]\ncamshaft2 = { nodes = ["drive2", "front2", "rear2", "end2"], material = "steel", section = "shaft" }\n'
         'pushrod2 = { nodes = ["tappet2", "top2"], material = "steel", section = "tube" }')),
        ("[supports]", ('[supports]\ndrive2 = ["uy", "uz", "rx"]\nfront2 = ["uy", "uz"]\nend2 = ["uy", "uz"]\n'
         'top2 = ["ux", "uz", "rx", "ry", "rz"]\ntappet2 = ["ux", "uz", "ry"]')),
        ("[masses]", ('[masses]\nlobe2 = { at = "rear2", mass = "0.15 kg" }\nfollower2 = { at = "tappet2", mass = "0.10 kg" }\n'
         'valve2 = { at = "valve2", mass = "0.10 kg" }')),
        ("[contacts.intake]", SECOND_TRAIN.format(phase=phase) + "[contacts.intake]"),
        ('probes = ["valve", "cam"]', 'probes = ["valve", "valve2"]'),
        name="two",
    )  # fmt: skip


def test_two_equal_trains_move_as_single_train(tmp_path):
    """Two equal trains without a common part: each moves as a single one, up to the rounding of a larger solve."""
    alone, both = run(inline_case(tmp_path)), run(two_trains(tmp_path, 0.0))
    for name in ("valve", "valve2"):
        for quantity in ("displacement", "velocity", "acceleration"):
            one, other = getattr(alone["valve"], quantity), getattr(both[name], quantity)
            assert np.abs(other - one).max() <= 1e-8 * np.abs(one).max(), (name, quantity)
    for channel in ("force", "torque"):
        one, other = (both.channels[f"contacts.{c}.{channel}"] for c in ("intake", "exhaust"))
        assert np.abs(other - one).max() <= 1e-8 * np.abs(one).max()


def test_phase_of_cam_does_not_affect_other_train(tmp_path):
    alone, both = run(inline_case(tmp_path)), run(two_trains(tmp_path, 90.0))
    one, other = alone["valve"].displacement, both["valve"].displacement
    assert np.abs(other - one).max() <= 1e-8 * np.abs(one).max()
    assert np.abs(both["valve2"].displacement - one).max() > 0.1 * np.abs(one).max()


FORWARD = '["drive", "front", "cam", "rear"]', '["tappet", "pushrod-top"]'
BACKWARD = '["rear", "cam", "front", "drive"]', '["pushrod-top", "tappet"]'


@pytest.mark.parametrize("swapped", [(0,), (1,), (0, 1)], ids=["camshaft", "pushrod", "both"])
@pytest.mark.parametrize("deflection", ["false", "true"])
def test_order_of_member_nodes_does_not_matter(tmp_path, swapped, deflection):
    """Same valve motion, force and torque with its sign, up to rounding."""
    felt = ('model = "published-load"', f'model = "published-load"\ncam_deflection = {deflection}')
    turned = [(FORWARD[i], BACKWARD[i]) for i in swapped]
    one, other = run(inline_case(tmp_path, felt)), run(inline_case(tmp_path, felt, *turned, name="turned"))
    pairs = [
        (one["valve"].displacement, other["valve"].displacement),
        (one["cam"].displacement, other["cam"].displacement),
    ]
    # The residual of the energy balance is rounding.
    names = [name for name in one.channels if name not in ("energy.numerical", "energy.residual")]
    pairs += [(one.channels[name], other.channels[name]) for name in names]
    for a, b in pairs:
        assert np.abs(b - a).max() <= 1e-8 * np.abs(a).max()


def test_shaft_axis_does_not_depend_on_node_order(tmp_path):
    axes = []
    for pairs in ((), tuple(zip(FORWARD, BACKWARD, strict=True))):
        model = build_model(inline_case(tmp_path, *pairs))
        axes.append(model.contacts["intake"].shaft_axis.tolist())
    assert axes == [[1.0, 0.0, 0.0]] * 2
