"""Coil springs: rate and stress of the wire, surge against an independent chain, coil clash, nonlinear curves.

J. E. Shigley and C. R. Mischke, Mechanical Engineering Design, 5th ed. (1989), secs. 10-1 to 10-3: k = G d^4/(8 D^3 n),
the maximum shear stress K_W 8 F D/(pi d^3) with Wahl's factor. A. M. Wahl, Mechanical Springs, 2nd ed. (1963): a
conical spring has k = G d^4/(2 n (D1 + D2) (D1^2 + D2^2)).
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from flexcam import InputError, build_model, modes, prepare, read_case, run
from flexcam.dynamics import ConstantSpeed, equilibrium
from flexcam.valvetrain.springs import condense_spring, spring_curve, spring_frequencies

SOURCE = "Coil springs"
CASE = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.02, 0.0, 0.0]
tappet = [0.02, 0.03, 0.0]
top = [0.02, 0.08, 0.0]
[materials.stiff]
E = "500 GPa"
nu = 0.3
density = "1 kg/m^3"
[sections]
thick = {{ shape = "circle", diameter = "40 mm" }}
[members]
camshaft = {{ nodes = ["drive", "cam"], material = "stiff", section = "thick" }}
pushrod = {{ nodes = ["tappet", "top"], material = "stiff", section = "thick" }}
[supports]
drive = ["ux", "uy", "uz", "rx", "ry", "rz"]
tappet = ["ux", "uz", "ry", "rx", "rz"]
top = ["ux", "uz", "ry", "rx", "rz"]
[masses]
follower = {{ at = "tappet", mass = "0.1 kg" }}
[springs.valve]
at = "top"
direction = "uy"
installed_force = 400.0
{spring}
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "10 mm"
rise = "80 deg"
return = "80 deg"
phase = "10 deg"
[contacts]
intake = {{ cam = "intake", follower = "tappet", model = "bilateral", stiffness = "1 GN/m" }}
[run]
speed = "1800 rpm"
revolutions = 0.5
steps_per_revolution = 3600
start = "equilibrium"
[output]
probes = ["top"]
"""
WIRE, COIL, COILS, MODULUS = 0.0042, 0.027, 5.5, 79.3e9
INSTALLED = 400.0
WIRE_SPRING = 'wire = { diameter = "4.2 mm", coil_diameter = "27 mm", active_coils = 5.5, shear_modulus = "79.3 GPa" }'


@pytest.fixture
def case(tmp_path):
    def make(spring, *more):
        path = tmp_path / "spring.toml"
        path.write_text(CASE.format(spring=spring), encoding="utf-8")
        return read_case(path, list(more))

    return make


RATE = MODULUS * WIRE**4 / (8.0 * COIL**3 * COILS)


def static_lift_and_channels(made, degrees):
    """Return lift and channels at static equilibrium at a cam angle, from the first instant of a run."""
    response = run(read_case(made.path, [f"cams.intake.phase={-degrees} deg", "run.revolutions=0.001"]))
    return response["top.uy"].displacement[0], {n: float(v[0]) for n, v in response.channels.items()}


def test_rate_of_wire_spring(record, case):
    found = build_model(case(WIRE_SPRING)).springs["valve"].stiffness
    record(source=SOURCE, case="wire 4.2 mm, D = 27 mm, 5.5 coils", quantity="rate", unit="N/m", reference=RATE,
           computed=found, tolerance=1e-12, reason="rounding")  # fmt: skip


@pytest.mark.parametrize("degrees", [0.0, 40.0, 80.0])
def test_static_stress_of_wire(record, case, degrees):
    lift, channels = static_lift_and_channels(case(WIRE_SPRING), degrees)
    C = COIL / WIRE
    wahl = (4.0 * C - 1.0) / (4.0 * C - 4.0) + 0.615 / C
    force = INSTALLED + RATE * lift
    record(source=SOURCE, case=f"lift of {1e3 * lift:.2f} mm", quantity="shear stress of the wire", unit="Pa",
           reference=wahl * 8.0 * force * COIL / (math.pi * WIRE**3), computed=channels["springs.valve.stress"],
           tolerance=1e-9, reason="rounding")  # fmt: skip
    assert channels["springs.valve.force"] == pytest.approx(force, rel=1e-9)
    assert channels["contacts.intake.force"] == pytest.approx(force, rel=1e-6)


SURGE_SPRING = WIRE_SPRING + '\nmass = "80 g"\nelements = PARTS\ndamping = 2.0'


@pytest.mark.parametrize("parts", [pytest.param(4, marks=pytest.mark.slow), 8])
def test_surge_matches_mass_chain(record, case, parts):
    """The reference is a row of bars with consistent masses between ground and a given motion, integrated by scipy."""
    response = run(case(SURGE_SPRING.replace("PARTS", str(parts))))
    top = response["top.uy"]
    at = CubicHermiteSpline(response.time, top.velocity, top.acceleration)
    where = at.antiderivative()
    n, m, k, c = parts, 0.08 / parts, RATE * parts, 2.0 * parts
    D = np.diff(np.eye(n + 1), axis=0)  # stretch of every part from the motions of all ends
    S = np.abs(D)
    K, C, M = k * D.T @ D, c * D.T @ D, m / 4.0 * S.T @ S + m / 12.0 * D.T @ D
    inner = slice(1, n)
    Mi = np.linalg.inv(M[inner, inner])

    def rates(t, y):
        u, v = np.zeros(n + 1), np.zeros(n + 1)
        u[inner], v[inner], u[n], v[n] = y[: n - 1], y[n - 1 :], top.displacement[0] + where(t), at(t)
        a = Mi @ (-(K @ u + C @ v)[inner] - M[inner, n] * at(t, 1))
        return np.concatenate([y[n - 1 :], a])

    start = np.concatenate([np.arange(1, n) / n * top.displacement[0], np.zeros(n - 1)])
    chain = solve_ivp(rates, (0.0, response.time[-1]), start, t_eval=response.time, rtol=1e-8, atol=1e-12)
    u = np.vstack([np.zeros(len(response.time)), chain.y[: n - 1], top.displacement])
    uneven = np.abs(u - np.arange(n + 1)[:, None] / n * u[-1]).max(axis=0)
    found = response.channels["springs.valve.surge"]
    record(source=SOURCE, case=f"surge of {parts} parts", quantity="largest error of the surge", unit="m",
           reference=0.0, computed=np.abs(found - uneven).max(), tolerance=0.02 * uneven.max(), absolute=True,
           reason="the average acceleration on 9 us steps delays the highest mode of the chain")  # fmt: skip
    force = INSTALLED + k * (D @ u)
    worst = np.abs(response.channels["springs.valve.force"] - force[-1]).max()
    assert worst < 5e-3 * force.max()
    stress = response.channels["springs.valve.stress"] / (8.0 * COIL / (math.pi * WIRE**3))
    C = COIL / WIRE
    wahl = (4.0 * C - 1.0) / (4.0 * C - 4.0) + 0.615 / C
    np.testing.assert_allclose(stress, wahl * np.abs(force).max(axis=0), atol=5e-3 * wahl * force.max())


CLASH_SPRING = "stiffness = 30e3\nelements = 4\nmass = 0.04\nclash_travel = 8e-3\nclash_stiffness = 2e6"


@pytest.mark.parametrize("degrees", [0.0, 40.0, 80.0])
def test_static_clearance_and_coil_clash(record, case, degrees):
    """Up to the travel the spring has its rate; beyond, four contacts in series act in parallel with it."""
    made = case(CLASH_SPRING, f"cams.intake.phase={-degrees} deg")
    problem = prepare(made).problem
    state = equilibrium(problem.system, ConstantSpeed(1.0))
    names = problem.system.names
    lift, cam = (float(state.displacement[names.index(name)]) for name in ("top.uy", "tappet.uy"))
    response = run(read_case(made.path, [f"cams.intake.phase={-degrees} deg", "run.revolutions=0.001"]))
    channels = {n: float(v[0]) for n, v in response.channels.items()}
    beyond = max(lift - 8e-3, 0.0)
    clash = beyond * 2e6 / 4.0
    force = INSTALLED + 30e3 * lift + clash
    assert (beyond > 0.0) == (degrees == 80.0)
    assert cam == pytest.approx(lift, abs=1e-6)
    record(source=SOURCE, case=f"four parts at {1e3 * lift:.2f} mm", quantity="force that the cam gives", unit="N",
           reference=force, computed=channels["contacts.intake.force"], tolerance=1e-6, reason="rounding")  # fmt: skip
    record(source=SOURCE, case=f"four parts at {1e3 * lift:.2f} mm", quantity="clearance", unit="m",
           reference=8e-3 - lift, computed=channels["springs.valve.clearance"], tolerance=1e-12, absolute=True,
           reason="rounding")  # fmt: skip
    # Each of the four contacts in series carries the force; the channel is their sum.
    assert channels["springs.valve.clash"] == pytest.approx(4.0 * clash, rel=1e-6, abs=1e-9)


def test_clearance_of_surging_spring(case):
    """The clearance is that of the most compressed part, where coils touch before the complete spring is solid."""
    response = run(case(CLASH_SPRING.replace("8e-3", "12e-3"), "run.speed=3000 rpm"))
    parts = np.column_stack([response["springs.valve"].displacement, response["top.uy"].displacement])
    stretch = np.diff(parts, axis=1, prepend=0.0)
    clearance = response.channels["springs.valve.clearance"]
    np.testing.assert_allclose(clearance, 12e-3 - 4.0 * stretch.max(axis=1), atol=1e-12)
    touching = response.channels["springs.valve.clash"] > 0.0
    np.testing.assert_array_equal(touching, clearance < 0.0)
    assert clearance.min() < 12e-3 - response["top.uy"].displacement.max()


TRAVELS, FORCES = (0.0, 6e-3, 12e-3, 18e-3, 24e-3), (0.0, 250.0, 430.0, 850.0, 1400.0)
FORCE_TABLE = 'force_table = [[0, 0], ["6 mm", "250 N"], ["12 mm", "430 N"], ["18 mm", "850 N"], ["24 mm", "1.4 kN"]]'
INSTALLED_COMPRESSION = float(np.interp(INSTALLED, FORCES, TRAVELS))
"""Compression as installed."""


@pytest.mark.parametrize("elements", [1, 3])
@pytest.mark.parametrize("degrees", [0.0, 20.0, 80.0])
def test_static_force_of_force_table(record, case, elements, degrees):
    """The installed position is in the degressive part of the table; the progressive part begins at 1 mm of lift."""
    lift, channels = static_lift_and_channels(case(f"{FORCE_TABLE}\nelements = {elements}"), degrees)
    force = np.interp(INSTALLED_COMPRESSION + lift, TRAVELS, FORCES)
    record(source=SOURCE, case=f"table in {elements} parts, lift of {1e3 * lift:.2f} mm", unit="N",
           quantity="force that the cam gives", reference=force, computed=channels["contacts.intake.force"],
           tolerance=1e-6, reason="rounding")  # fmt: skip
    assert channels["springs.valve.force"] == pytest.approx(force, rel=1e-9)


def test_installed_position_on_force_table(case):
    """The position follows from force or compression and sets the stiffness; without both the table starts there."""
    by_force = build_model(case(FORCE_TABLE)).springs["valve"]
    assert by_force.installed_force == INSTALLED
    assert by_force.stiffness == pytest.approx(30e3, rel=1e-12)
    assert by_force.table[0][0] == pytest.approx(-11e-3, rel=1e-12)
    text = CASE.replace("installed_force = 400.0", 'installed_compression = "12 mm"')
    path = case(FORCE_TABLE).path
    path.write_text(text.format(spring=FORCE_TABLE), encoding="utf-8")
    by_travel = build_model(read_case(path)).springs["valve"]
    assert by_travel.installed_force == pytest.approx(430.0, rel=1e-12)
    assert by_travel.stiffness == pytest.approx(70e3, rel=1e-12)
    path.write_text(
        text.replace('installed_compression = "12 mm"', "").format(spring=FORCE_TABLE.replace("[0,", "[0.0,"))
    )
    assert build_model(read_case(path)).springs["valve"].installed_force == 0.0


TABLE_FILE = 'force_table = "spring.csv"'


def test_force_table_from_file(case, tmp_path):
    """The file has its columns in any order and units, and the same rows as the list."""
    (tmp_path / "spring.csv").write_text(
        "# on a tester\nforce [kN]; travel [cm]\n0;0\n0,25;0,6\n0,43;1,2\n0,85;1,8\n1,4;2,4\n"
    )
    rows = case(TABLE_FILE).record.springs["valve"].force_table
    np.testing.assert_allclose(rows, case(FORCE_TABLE).record.springs["valve"].force_table, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("travel [mm], load [N]\n0, 0\n1, 40\n2, 90\n", "columns travel and force. It has travel, load"),
        ("travel [mm], force [mm]\n0, 0\n1, 40\n2, 90\n", "expected a unit of force"),
        ("travel [mm], force [N]\n0, 0\n1, x\n2, 90\n", "got spring.csv, line 3: '1, x'"),
        ("travel [mm], force [N]\n0, 0\n1, 400\n2, 390\n", "expected rows of increasing travel and force"),
        (None, "spring.csv"),
    ],
)
def test_invalid_force_table_file_raises_error(case, tmp_path, text, message):
    if text is not None:
        (tmp_path / "spring.csv").write_text(text)
    with pytest.raises(InputError, match=r"springs\.valve\.force_table") as refusal:
        case(TABLE_FILE)
    assert message in str(refusal.value)


FAST_RUN = ("run.revolutions=1", "run.speed=3000 rpm")


def test_energy_balance_with_force_table(record, case):
    response = run(case(f'{FORCE_TABLE}\nmass = "60 g"\nelements = 4\ndamping = 4.0', *FAST_RUN))
    work, residual = (np.abs(response.channels[f"energy.{name}"]).max() for name in ("work", "residual"))
    record(source=SOURCE, case="table in 4 parts, a revolution at 3000 rpm", quantity="residual of the energy balance",
           unit="J", reference=0.0, computed=residual, tolerance=1e-6 * work, absolute=True,
           reason="steps across the corners of the table")  # fmt: skip


def test_straight_force_table_matches_linear_spring(case):
    one, other = (
        run(case(f'{force}\nmass = "60 g"\nelements = 4\ndamping = 4.0', *FAST_RUN))
        for force in ("stiffness = 40e3", "force_table = [[0, 0], [5e-3, 200.0], [15e-3, 600.0]]")
    )
    for name in one.channels.keys() - {"energy.residual", "energy.numerical"}:
        values = one.channels[name]  # the local iteration ends at 1e-12 of the forces
        np.testing.assert_allclose(other.channels[name], values, rtol=0, atol=1e-9 * max(np.abs(values).max(), 1e-9))


@pytest.mark.parametrize(
    "spring",
    [FORCE_TABLE, 'mass = "50 g"\nelements = 2\n' + FORCE_TABLE, "{two_rate}"],
    ids=["table", "parts", "two rates"],
)
def test_rigid_force_follows_spring_curve(record, case, spring):
    """The reference at 60 rpm is the spring curve with the inertia of the moved parts."""
    made = case(
        spring.replace("{two_rate}", TWO_RATE_COILS.replace("PARTS", "2")),
        'fidelity.model="rigid"',
        "run.revolutions=1",
        "run.speed=60 rpm",
    )
    response, model = run(made), build_model(made)
    lift, curve = response["top.uy"].displacement, spring_curve(model.springs["valve"])
    mass = 0.1 + np.pi * 0.02**2 * 0.05 * 1.0 + model.springs["valve"].mass / 3.0
    force = np.interp(lift, curve.travel, curve.force) + mass * response["top.uy"].acceleration
    error = np.abs(response.channels["contacts.intake.force"] - force).max()
    name = "coils of two pitches" if "two_rate" in spring else "table"
    record(source=SOURCE, case=f"rigid model, {name}, {len(model.springs['valve'].parts)} parts", unit="N",
           quantity="largest error of the force at the cam", reference=0.0, computed=error, tolerance=2e-4,
           absolute=True, reason="the mass of unequal parts moves in proportion to their compliance")  # fmt: skip


# Two coils 1 mm apart below four coils 5 mm apart, of equal wire and diameter.
TWO_RATE_COILS = """wire = { diameter = "4 mm", shear_modulus = "80 GPa" }
coils = [{ turns = 2, diameter = "24 mm", pitch = "5 mm" }, { turns = 4, diameter = "24 mm", pitch = "9 mm" }]
mass = "50 g"
elements = PARTS"""
COIL_STIFFNESS = 80e9 * 4e-3**4 / (8.0 * 24e-3**3)


def two_rate_force(travel):
    """Return the force over the travel from the free length: coils in series, then the first coils in contact."""
    close, far = COIL_STIFFNESS / 2.0, COIL_STIFFNESS / 4.0
    touching = 51.0 * close  # stiffness of the first coils and 50 times it of their contact
    soft, hard = 1.0 / (1.0 / close + 1.0 / far), 1.0 / (1.0 / touching + 1.0 / far)
    first = 2e-3 * close  # force that closes the first coils, each by a millimetre
    return np.where(travel < first / soft, soft * travel, first + hard * (travel - first / soft))


@pytest.mark.parametrize("elements", [1, 3])
@pytest.mark.parametrize(
    ("force", "degrees"), [(120.0, 0.0), (120.0, 30.0), (120.0, 80.0), (400.0, 0.0), (400.0, 80.0)]
)
def test_static_force_of_two_rate_spring(record, case, elements, force, degrees):
    """The coils of the small pitch close at 185 N: during the lift, or before it with the greater installed force."""
    made = case(TWO_RATE_COILS.replace("PARTS", str(elements)), f"springs.valve.installed_force={force} N")
    path = made.path
    path.write_text(path.read_text(encoding="utf-8").replace("400.0", f"{force}"), encoding="utf-8")
    lift, channels = static_lift_and_channels(read_case(path), degrees)
    travel = np.linspace(0.0, 30e-3, 300001)
    start = np.interp(force, two_rate_force(travel), travel)
    wanted = float(two_rate_force(start + lift))
    description = f"two pitches in {elements} parts each, {force:g} N installed, lift of {1e3 * lift:.2f} mm"
    record(source=SOURCE, case=description,
           quantity="force that the cam gives", unit="N", reference=wanted, computed=channels["contacts.intake.force"],
           tolerance=1e-6, reason="rounding")  # fmt: skip
    assert channels["springs.valve.surge"] < 1e-9
    solid = 4.0 * 5e-3 * COIL_STIFFNESS / 4.0  # force that closes the last coils
    left = np.interp(solid, two_rate_force(travel), travel) - start - lift
    assert channels["springs.valve.clearance"] == pytest.approx(left, abs=1e-9)
    assert channels["springs.valve.clash"] == 0.0


def test_energy_balance_of_two_rate_spring(record, case):
    """Newmark ends a step at each closing of the coils, so that the energy balance is exact."""
    response = run(
        case(
            TWO_RATE_COILS.replace("PARTS", "2"),
            "springs.valve.installed_force=150 N",
            *FAST_RUN,
            "run.integrator.method=newmark",
        )
    )
    work, residual = (np.abs(response.channels[f"energy.{name}"]).max() for name in ("work", "residual"))
    record(source=SOURCE, case="two pitches, 2 parts each, a revolution at 3000 rpm", unit="J",
           quantity="residual of the energy balance", reference=0.0, computed=residual, tolerance=1e-12 * work,
           absolute=True, reason="rounding")  # fmt: skip


def test_condensed_coils_conserve_inertia(case):
    """The parts of the static shape move linearly: m (a^2 + a b + b^2)/3 each, with a and b of both ends."""
    coils = build_model(case(TWO_RATE_COILS.replace("PARTS", "2"), "springs.valve.installed_force=150 N")).springs[
        "valve"
    ]
    end = np.cumsum([1.0 / part.stiffness for part in coils.parts])
    a, b = np.concatenate([[0.0], end[:-1]]) / end[-1], end / end[-1]
    inertia = sum(part.mass * (x * x + x * y + y * y) / 3.0 for part, x, y in zip(coils.parts, a, b, strict=True))
    assert condense_spring(coils).mass == pytest.approx(3.0 * inertia, rel=1e-12)


def test_straight_force_table_needs_no_local_force(case):
    made = case("force_table = [[0, 0], [0.01, 300], [0.03, 900]]")
    assert build_model(made).springs["valve"].stiffness == pytest.approx(30e3)
    assert not [one.name for one in prepare(made).problem.system.local_forces if "springs" in one.name]


def test_closed_coils_do_not_change_clearance(case):
    """The coils that closed first vibrate on each other; the clearance is that of the coils that close last."""
    made = case(TWO_RATE_COILS.replace("PARTS", "1"), "springs.valve.installed_force=150 N")
    curve = spring_curve(build_model(made).springs["valve"])
    travel = 0.5 * (curve.travel[-3] + curve.travel[-2])
    rest = curve.compression(np.array([travel]))
    displaced = rest + np.where(rest == rest.min(), 20e-6, 0.0)
    assert curve.travel_of(rest)[0] == pytest.approx(travel, rel=1e-9)
    assert curve.travel_of(displaced)[0] == pytest.approx(travel, rel=1e-9)


@pytest.mark.parametrize("parts", [1, 2])
def test_progressive_coils_do_not_clash(case, parts):
    """The impact of the closing coils exceeds the force that would make the spring solid."""
    response = run(case(TWO_RATE_COILS.replace("PARTS", str(parts)), "springs.valve.installed_force=150 N", *FAST_RUN))
    assert response.channels["springs.valve.clearance"].min() > 6e-3
    assert response.channels["springs.valve.clash"].max() == 0.0


def test_solid_two_rate_spring_clashes(case):
    """Beyond the travel to coil bind the clearance is negative and the coils of the large pitch carry force as well."""
    made = case(TWO_RATE_COILS.replace("PARTS", "1"), "springs.valve.installed_force=900 N")
    made.path.write_text(made.path.read_text(encoding="utf-8").replace("400.0", "900.0"), encoding="utf-8")
    _, channels = static_lift_and_channels(read_case(made.path), 80.0)
    assert channels["springs.valve.clearance"] < -5e-3
    assert channels["springs.valve.clash"] > 1e4


def test_equal_coils_match_uniform_spring(case):
    """Two entries of two parts, of equal pitch, match four parts with the travel of all coils."""
    wire = 'wire = { diameter = "4 mm", shear_modulus = "80 GPa"'
    more = '\nmass = "50 g"\ndamping = 3.0\n'
    half = '{ turns = 2.5, diameter = "24 mm", pitch = "7 mm" }'
    left = 5.0 * 3e-3 - INSTALLED / (COIL_STIFFNESS / 5.0)
    uniform = f'{wire}, coil_diameter = "24 mm", active_coils = 5 }}\nclash_travel = {left!r}\nelements = 4{more}'
    one, other = (
        run(case(spring, *FAST_RUN)) for spring in (uniform, f"{wire} }}\ncoils = [{half}, {half}]\nelements = 2{more}")
    )
    assert one.channels["springs.valve.clash"].max() > 0.0
    for name, values in one.channels.items():
        if not name.startswith("energy."):  # contacts that open and close multiply the rounding of the stiffness
            np.testing.assert_allclose(
                other.channels[name], values, rtol=0, atol=1e-7 * max(np.abs(values).max(), 1e-9)
            )


TAPERED_COILS = """wire = { diameter = "4 mm", shear_modulus = "80 GPa", density = "7850 kg/m^3" }
coils = [{ turns = 3, diameter = "26 mm", pitch = "8 mm" }, { turns = 2, diameter = [0.026, 0.016], pitch = "7 mm" }]
elements = 4"""


def test_stiffness_and_stress_of_tapered_coils(record, case):
    """The cone is Wahl's conical spring in four parts; a coil that tapers by 2.5 mm closes 3.12 mm below the next."""
    spring = build_model(case(TAPERED_COILS)).springs["valve"]
    cone = [part.stiffness for part in spring.coils[4:]]
    wanted = 80e9 * 4e-3**4 / (2.0 * 2.0 * (26e-3 + 16e-3) * (26e-3**2 + 16e-3**2))
    record(source=SOURCE, case="conical coils, 26 to 16 mm", quantity="stiffness", unit="N/m", reference=wanted,
           computed=1.0 / sum(1.0 / one for one in cone), tolerance=1e-12, reason="rounding")  # fmt: skip
    length = 3.0 * math.hypot(math.pi * 26e-3, 8e-3) + sum(
        0.5 * math.hypot(math.pi * D, 7e-3) for D in (24.75e-3, 22.25e-3, 19.75e-3, 17.25e-3)
    )
    assert spring.mass == pytest.approx(7850.0 * math.pi / 4.0 * 4e-3**2 * length, rel=1e-12)
    free = [part.travel + INSTALLED / part.stiffness for part in spring.coils]
    assert free[0] == pytest.approx(0.75 * 4e-3, rel=1e-9)
    assert free[-1] == pytest.approx(0.5 * (7e-3 - math.sqrt(4e-3**2 - 2.5e-3**2)), rel=1e-9)
    widest = max(part.wire.coil_diameter for part in spring.coils)
    _, channels = static_lift_and_channels(case(TAPERED_COILS), 0.0)
    C = widest / 4e-3
    wahl = (4.0 * C - 1.0) / (4.0 * C - 4.0) + 0.615 / C
    stress = wahl * 8.0 * channels["springs.valve.force"] * widest / (math.pi * 4e-3**3)
    assert channels["springs.valve.stress"] == pytest.approx(stress, rel=1e-9)


FIXED_SPRING = """format = 1
[nodes]
end = [0, 0, 0]
[supports]
end = ["ux", "uy", "uz"]
[masses]
end = { at = "end", mass = "0.1 kg" }
[springs]
coil = { at = "end", direction = "uy", stiffness = "40 kN/m", mass = "60 g", elements = PARTS }
[run]
speed = "60 rpm"
revolutions = 0.1
"""


@pytest.mark.parametrize("parts", [4, 8, 16, 32])
def test_first_surge_frequency_of_fixed_spring(record, tmp_path, parts):
    """With both ends fixed, f = 1/2 sqrt(k/m) for a continuous spring; the error decreases as (pi/p)^2/24."""
    path = tmp_path / "held.toml"
    path.write_text(FIXED_SPRING.replace("PARTS", str(parts)), encoding="utf-8")
    found = modes(read_case(path), 1).modes.frequencies[0]
    true = 0.5 * math.sqrt(40e3 / 0.06)
    record(source=SOURCE, case=f"fixed at both ends, {parts} parts", quantity="first natural frequency", unit="Hz",
           reference=true, computed=found, tolerance=1.1 * (math.pi / parts) ** 2 / 24.0,
           reason="elements that are linear between their ends")  # fmt: skip
    assert found / true - 1.0 == pytest.approx((math.pi / parts) ** 2 / 24.0, rel=0.1)


def test_surge_frequency_over_travel(record, case):
    """The frequency of a table follows from its slope; with coils in contact only the wire of the others surges."""
    table = build_model(case(f'{FORCE_TABLE}\nmass = "60 g"\nelements = 1')).springs["valve"]
    for travel, slope in ((0.0, 30e3), (4e-3, 70e3)):
        record(source=SOURCE, case=f"table, both ends fixed, {1e3 * travel:g} mm beyond installed", unit="Hz",
               quantity="first natural frequency", reference=0.5 * math.sqrt(slope / 0.06),
               computed=spring_frequencies(table, travel)[0], tolerance=2e-4, reason="64 parts")  # fmt: skip
    coils = build_model(case(TWO_RATE_COILS.replace("PARTS", "1"), "springs.valve.installed_force=150 N")).springs[
        "valve"
    ]
    closed = 0.5 * math.sqrt(COIL_STIFFNESS / 4.0 / (0.05 * 4.0 / 6.0))
    assert spring_frequencies(coils, 5e-3)[0] == pytest.approx(closed, rel=0.03)
