"""Friction between the springs of a nest, against closed forms.

The first mode of a spring fixed at both ends, sin(pi z), has the stiffness k pi^2/2; a friction F distributed over its
height has the modal force 2 F/pi. Coulomb friction reduces the modal amplitude by 4 F/k of the mode per cycle (J. P.
Den Hartog, Mechanical Vibrations, 4th ed., sec. 8.2), here 16 F/(pi^3 k).
"""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run, solve, valvetrain
from flexcam.analysis.run_metrics import compute_metrics
from flexcam.case.input_checks import check_values

SOURCE = "Friction between nested springs"
K, MASS, FORCE, AMPLITUDE = 20e3, 0.03, 4.0, 1e-3
OMEGA = math.pi * math.sqrt(K / MASS)
CASE = """
format = 1
nodes = {{ retainer = [0, 0, 0] }}
supports = {{ retainer = ["uy"] }}
[springs]
inner = {{ at = "retainer", direction = "-uy", stiffness = 20e3, mass = 0.03, elements = {inner} }}
outer = {{ at = "retainer", direction = "-uy", stiffness = {stiffness}, mass = 0.03, elements = {outer} }}
[friction]
nest = {{ spring = "inner", inside = "outer", force = {force}, friction_speed = 2e-4 }}
[run]
speed = {omega}
steps_per_revolution = 1500
start = {{ displacement = {{ {start} }} }}
[output]
probes = ["retainer"]
"""


def prepare_nest(folder, *, inner=16, outer=16, stiffness=2e8, mirrored=False, engine="kernel", turns=4.2):
    """Return the prepared run over four cycles of the first mode of the inner spring, excited by its displacement."""
    shape = {i: AMPLITUDE * math.sin(math.pi * i / inner) for i in range(1, inner)}
    start = [f'"springs.inner.{i}" = {x}' for i, x in shape.items()]
    start += [f'"springs.outer.{i}" = {-x}' for i, x in shape.items()] if mirrored else []
    start = ", ".join(start)
    text = CASE.format(inner=inner, outer=outer, stiffness=stiffness, force=FORCE, omega=OMEGA, start=start)
    (folder / "nest.toml").write_text(text, encoding="utf-8")
    return prepare(
        read_case(
            folder / "nest.toml", [f"run.engine={engine}", f"run.revolutions={turns}", "run.integrator.method=newmark"]
        )
    )


def solve_run(ready):
    """Return the response of a run."""
    found = solve(ready.problem, ready.scheme)
    assert found.status.ok
    return found


def surge_amplitudes(found, name):
    """Return the amplitudes of the first mode per cycle: the maxima of its coordinate, positive at the start."""
    shape = np.sin(np.pi * np.arange(1, 16) / 16)
    q = found[f"springs.{name}"].displacement @ shape / (shape @ shape)
    q *= np.sign(q[0])
    return np.concatenate([q[:1], q[1:-1][(q[1:-1] > q[:-2]) & (q[1:-1] >= q[2:])]])


@pytest.mark.parametrize(
    ("name", "outer", "stiffness", "mirrored"),
    [("inner", 16, 2e8, False), ("inner", 5, 2e8, False), ("inner", 16, K, True), ("outer", 16, K, True)],
)
def test_surge_decays_linearly(record, tmp_path, name, outer, stiffness, mirrored):
    """The outer spring is stiff, also with other parts, or equal and in opposite motion."""
    found = solve_run(prepare_nest(tmp_path, outer=outer, stiffness=stiffness, mirrored=mirrored))
    heights = surge_amplitudes(found, name)
    assert len(heights) == 5
    kind = "equal" if mirrored else "stiff"
    record(source=SOURCE, case=f"{name} spring of a nest, {kind} outer spring of {outer} parts",
           quantity="loss of amplitude per cycle", unit="m", reference=16.0 * FORCE / (math.pi**3 * K),
           computed=(heights[0] - heights[-1]) / 4.0, tolerance=2e-3,
           reason="reversal over 0.2 mm/s of 2.6 m/s, 16 parts, third mode")  # fmt: skip
    assert np.ptp(np.diff(heights)) < 1e-3 * heights[0]  # linear, whereas a damper has a ratio of 0.9 per cycle
    np.testing.assert_allclose(np.abs(found.channels["friction.nest.force"]).max(), FORCE, rtol=1e-6)
    assert np.abs(found.channels["energy.residual"]).max() < 1e-12  # of 0.05 J


def test_friction_power_matches_dissipation(tmp_path):
    """Friction is the only dissipation."""
    ready = prepare_nest(tmp_path)
    found = solve_run(ready)
    metrics = {one.name: one.value for one in compute_metrics(ready, found)}
    lost = np.interp(found.time[-1] - np.array([2.0 * math.pi / OMEGA, 0.0]), found.time,
                     found.channels["energy.dissipated"])  # fmt: skip
    power = np.diff(lost)[0] * OMEGA / (2.0 * math.pi)
    np.testing.assert_allclose(metrics["friction.nest.friction_power.mean"], power, rtol=1e-4)  # 1500 trapezoids


@pytest.mark.slow
def test_engines_agree(tmp_path):
    direct, kernel = (
        solve_run(prepare_nest(tmp_path, outer=5, engine=engine, turns=1.0)) for engine in ("direct", "kernel")
    )
    moved = [one["springs.inner"].displacement for one in (direct, kernel)]
    np.testing.assert_allclose(moved[1], moved[0], atol=1e-9 * AMPLITUDE)
    force = [one.channels["friction.nest.force"] for one in (direct, kernel)]
    np.testing.assert_allclose(force[1], force[0], atol=1e-6 * FORCE)  # steep at the reversal


HYSTERESIS_CASE = """
format = 1
nodes = { retainer = [0, 0, 0] }
[masses]
retainer = { at = "retainer", mass = 0.1 }
[springs]
drive = { at = "retainer", direction = "uy", stiffness = 1e7, damping = 1e3 }
outer = { at = "retainer", direction = "-uy", stiffness = 30e3, mass = 0.04, elements = 2, damping = 2 }
[springs.inner]
at = "retainer"
direction = "-uy"
installed_compression = "6 mm"
elements = 1
damping = 2
wire = { diameter = "3 mm", shear_modulus = "80 GPa", density = 7850 }
coils = [
    { turns = 4, diameter = "20 mm", pitch = "6 mm" },
    { turns = 2, diameter = "20 mm", pitch = "12 mm" },
]
[friction]
nest = { spring = "inner", inside = "outer", force = "10 N", friction_speed = "1 mm/s" }
[loads]
drive = { at = "retainer", direction = "-uy", table = "drive.csv" }
[run]
speed = "600 rpm"
revolutions = 5
steps_per_revolution = 1000
[output]
probes = ["retainer"]
"""
TRAVEL, STROKE = 8e-3, 0.1


def test_hysteresis_of_progressive_in_uniform_spring(record, tmp_path):
    """Both springs have two parts, so that one coil of each spring moves between the ends.

    The narrow coils below the border at the height h have 2/3 of the compression, so that the border moves by u = 2 x/3
    for the motion x of the retainer; the middle of the outer spring moves by x/2. Friction acts at 1/4 and 3/4 of the
    height.
    """
    (tmp_path / "drive.csv").write_text(
        "time [s],force [N]\n" + "".join(f"{STROKE * t},{1e7 * TRAVEL * (t % 2)}\n" for t in range(6)), encoding="utf-8"
    )
    (tmp_path / "pressed.toml").write_text(HYSTERESIS_CASE, encoding="utf-8")
    found = solve_run(prepare(read_case(tmp_path / "pressed.toml")))
    k1 = 80e9 * 0.003**4 / (8.0 * 4.0 * 0.02**3)
    k2, ko = 2.0 * k1, 60e3
    h = (0.024 - 0.004) / (0.048 - 0.006)  # installed: 2/3 and 1/3 of the 6 mm compressed
    low, high = 0.25 / h, (0.75 - h) / (1.0 - h)
    # Rows: equilibrium of the inner border u and the middle of the outer spring v, with f = 5 N at both heights.
    slid = 5.0 * np.array([low + 1.0 - high, -1.0])
    u, middle = -slid / np.array([k1 + k2, 2.0 * ko])
    width = 2.0 * (5.0 * (high - 0.5) - k2 * u - ko * middle)
    x, v = -found["retainer"].displacement[:, 1], -found["retainer"].velocity[:, 1]
    # Load less spring and damper of the drive, and the dampers of both springs.
    pushed = 1e7 * TRAVEL * np.interp(found.time / STROKE, range(6), [0, 1] * 3) - 1e7 * x - (1e3 + 4.0) * v
    up, down = (np.flatnonzero(found.time // STROKE == one) for one in (2, 3))
    at = np.array([0.4, 0.5, 0.6]) * TRAVEL
    rising = np.interp(at, x[up], pushed[up])
    falling = np.interp(at, x[down][::-1], pushed[down][::-1])
    for place, wide in zip(at, rising - falling, strict=True):
        record(source=SOURCE, case=f"progressive spring in a uniform one, at {1e3 * place:.1f} mm",
               quantity="width of the hysteresis loop", unit="N", reference=width, computed=wide, tolerance=1e-3,
               reason="springs that ring from the reversal")  # fmt: skip


INTERFERENCE_CASE = """
format = 1
nodes = { retainer = [0, 0, 0] }
[masses]
retainer = { at = "retainer", mass = 0.1 }
[springs.drive]
at = "retainer"
direction = "uy"
stiffness = 1e7
damping = 1e3
[springs.outer]
at = "retainer"
direction = "-uy"
mass = "40 g"
elements = 16
damping = 10
wire = { diameter = "4 mm", coil_diameter = "27.9 mm", active_coils = 5, shear_modulus = "80 GPa" }
[springs.inner]
at = "retainer"
direction = "-uy"
installed_compression = "6 mm"
elements = 8
damping = 10
wire = { diameter = "3 mm", shear_modulus = "78 GPa", density = 7850 }
coils = [
    { turns = 4, diameter = "21 mm", pitch = "6 mm" },
    { turns = 2, diameter = "21 mm", pitch = "12 mm" },
]
[friction]
nest = { spring = "inner", inside = "outer", coefficient = 0.1, friction_speed = "0.02 mm/s" }
[loads]
drive = { at = "retainer", direction = "-uy", table = "drive.csv" }
[run]
speed = "600 rpm"
revolutions = 4
steps_per_revolution = 1000
[output]
probes = ["retainer"]
"""
OVERLAP = 0.5 * (21e-3 + 3e-3) - 0.5 * (27.9e-3 - 4e-3)


def interference_case(folder, *options):
    """Return the case of a nest with interference."""
    rows = "".join(f"{STROKE * t},{1e7 * TRAVEL * (t % 2)}\n" for t in range(6))
    (folder / "drive.csv").write_text(f"time [s],force [N]\n{rows}", encoding="utf-8")
    (folder / "interference.toml").write_text(INTERFERENCE_CASE, encoding="utf-8")
    return read_case(folder / "interference.toml", options)


def normal_force(interference):
    """Return the force between the coils; it acts on both wires as a line load E I/R^4 times their displacement.

    Forces are compared per angle around the axis and all turns: q R times 2 pi n is the same for both.
    """

    def displacement_by_force(young, wire, diameter, turns):
        R, inertia = 0.5 * diameter, math.pi * wire**4 / 64.0
        line_load = 1.0 / (2.0 * math.pi * turns * R)
        return line_load * R**4 / (young * inertia)

    return interference / (displacement_by_force(2.6 * 80e9, 4e-3, 27.9e-3, 5.0)
                           + displacement_by_force(2.6 * 78e9, 3e-3, 21e-3, 6.0))  # fmt: skip


def squeezed_helix(wire, diameter, turns, displacement, *, young=206e9, per_turn=72):
    """Return the forces of a rigid bore on the nodes of a plane helix with free ends, and the length per node.

    Straight frame elements along the wire; the bore is narrower than the helix by the displacement and acts in
    compression only.
    """
    R, inertia, area = 0.5 * diameter, math.pi * wire**4 / 64.0, math.pi * wire**2 / 4.0
    n = per_turn * turns
    angle, h = 2.0 * math.pi * turns * np.arange(n + 1) / n, 2.0 * R * math.sin(math.pi / per_turn)
    a, b = young * area / h, young * inertia / h**3
    element = np.array([
        [a, 0, 0, -a, 0, 0], [0, 12 * b, 6 * b * h, 0, -12 * b, 6 * b * h],
        [0, 6 * b * h, 4 * b * h**2, 0, -6 * b * h, 2 * b * h**2],
        [-a, 0, 0, a, 0, 0], [0, -12 * b, -6 * b * h, 0, 12 * b, -6 * b * h],
        [0, 6 * b * h, 2 * b * h**2, 0, -6 * b * h, 4 * b * h**2],
    ])  # fmt: skip
    K = 1e-9 * young * inertia / R**3 * np.eye(3 * (n + 1))
    for i in range(n):
        c, s = np.cos(along := 0.5 * (angle[i] + angle[i + 1] + math.pi)), np.sin(along)
        T = np.kron(np.eye(2), [[c, s, 0], [-s, c, 0], [0, 0, 1]])
        K[3 * i : 3 * i + 6, 3 * i : 3 * i + 6] += T.T @ element @ T
    outward = np.zeros((n + 1, 3 * (n + 1)))
    outward[np.arange(n + 1), 3 * np.arange(n + 1)] = np.cos(angle)
    outward[np.arange(n + 1), 3 * np.arange(n + 1) + 1] = np.sin(angle)
    length = np.full(n + 1, h)
    length[[0, -1]] *= 0.5
    stiff, touching = 1e4 * young * inertia / R**4 * length, np.ones(n + 1, dtype=bool)
    for _ in range(50):
        B, k = outward[touching], stiff[touching]
        u = np.linalg.solve(K + B.T @ (k[:, None] * B), -B.T @ (k * displacement))
        force = stiff * (outward @ u + displacement)
        if ((force > 0.0) == touching).all():
            return np.where(touching, force, 0.0), length
        touching = force > 0.0
    raise AssertionError


@pytest.mark.parametrize("turns", [3, 5])
def test_radial_stiffness_of_coils_matches_helix(record, turns):
    """A rigid bore compresses the coils; at the ends the contact opens over an arc, which costs 0.31 R of wire."""
    wire, diameter = 4e-3, 28e-3
    spring = valvetrain.Spring("retainer", np.eye(6)[1], valvetrain.Wire(wire, diameter).rate(206e9 / 2.6, turns))
    force, length = squeezed_helix(wire, diameter, turns, 50e-6)
    total = valvetrain.radial_stiffness(spring, turns) * 50e-6
    middle = slice(len(force) // 3, 2 * len(force) // 3)
    line_load = force[middle].sum() / length[middle].sum()
    record(source=SOURCE, case=f"{turns} coils squeezed by a bore", quantity="line load", unit="N/m",
           reference=line_load, computed=total / (math.pi * diameter * turns), tolerance=0.01,
           reason="72 straight elements per turn")  # fmt: skip
    assert force.sum() / total == pytest.approx(1.0 - 0.31 / (math.pi * turns), abs=0.01)


@pytest.mark.parametrize("given", [None, 80e-6])
def test_friction_force_of_interference(record, tmp_path, given):
    """The friction is Coulomb's coefficient times the force between the coils, by diameters or given interference."""
    options = () if given is None else (f"friction.nest.interference={given}",)
    nested = build_model(interference_case(tmp_path, *options)).friction["nest"]
    kind = "by the diameters" if given is None else "given"
    record(source=SOURCE, case=f"interference {kind}", quantity="friction", unit="N",
           reference=0.1 * normal_force(given or OVERLAP), computed=nested.force, tolerance=1e-9,
           reason="closed form")  # fmt: skip
    assert nested.breakaway_force == nested.force
    assert nested.springs == ("inner", "outer")


def test_energy_of_slow_cycles_with_interference(record, tmp_path):
    """The energy is 4 F times the sliding amplitude per cycle, for a friction too small to change the motion.

    The border between the coils of the inner spring, at the height h, has 2/3 of the motion of the retainer, and the
    uniform spring there h: the sliding has a triangular distribution over the height with the mean |2/3 - h|/2.
    """
    found = solve_run(prepare(interference_case(tmp_path, "friction.nest.coefficient=1e-4")))
    h = (0.024 - 0.004) / (0.048 - 0.006)  # installed: 2/3 and 1/3 of the 6 mm compressed
    amplitude = 0.5 * TRAVEL * 0.5 * (2.0 / 3.0 - h)
    cycle = (found.time >= 2.0 * STROKE) & (found.time <= 4.0 * STROKE)
    energy = -np.trapezoid(found.channels["friction.nest.power"][cycle], found.time[cycle])
    record(source=SOURCE, case="slow cycle with interference", quantity="friction energy", unit="J",
           reference=4.0 * 1e-4 * normal_force(OVERLAP) * amplitude, computed=abs(energy), tolerance=0.01,
           reason="reversal over 0.02 mm/s, 16 heights, elastic coils")  # fmt: skip


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (('springs.outer.wire={ diameter = "4 mm", coil_diameter = "27.9 mm" }', "springs.outer.stiffness=24e3"),
         r"friction.nest.*'outer' without such coils.*[Aa]dd coil_diameter, active_coils and shear_modulus"),
        (('springs.inner.coils=[{ turns = 6, diameter = ["21 mm", "18 mm"], pitch = "8 mm" }]',),
         r"'inner' without such coils"),
        (("springs.outer.wire.coil_diameter=30e-3",), r"radial clearance of 0.001 m.*Correct the diameters"),
        (("springs.outer.wire.coil_diameter=30e-3", "friction.nest.interference=5e-5"), r"radial clearance of 0.001 m"),
        (('friction.nest.spring="outer"', 'friction.nest.inside="inner"'), r"Exchange spring and inside"),
        (("friction.nest.force=3",), r"either force, or coefficient and interference"),
        (("friction.nest.breakaway_force=3",), r"no breakaway_force with coefficient"),
        (('friction.nest={ at = "retainer", direction = "uy", coefficient = 0.1 }',), r"for a nest with interference"),
        (('friction.nest={ spring = "inner", inside = "outer" }',), r"a force, or for a nest with interference"),
    ],
)  # fmt: skip
def test_invalid_interference_raises_error(tmp_path, options, message):
    with pytest.raises(InputError, match=f"(?s){message}"):
        build_model(interference_case(tmp_path, *options))


def test_given_interference_of_touching_coils(tmp_path):
    case = interference_case(tmp_path, "springs.outer.wire.coil_diameter=28e-3", "friction.nest.interference=5e-5")
    assert build_model(case).friction["nest"].force > 0.0


def test_overlapping_coils_without_friction_cause_warning(tmp_path):
    message = "coils overlap those of 'outer' by 0.05 mm"
    assert not [one for one in check_values(interference_case(tmp_path)) if "overlap" in one]
    bare = INTERFERENCE_CASE.replace(INTERFERENCE_CASE.split("[friction]")[1].split("[loads]")[0], "\n")
    interference_case(tmp_path)
    (tmp_path / "bare.toml").write_text(bare, encoding="utf-8")
    assert [one for one in check_values(read_case(tmp_path / "bare.toml")) if message in one]
    wide = "springs.outer.wire.coil_diameter=29e-3"
    assert not [one for one in check_values(read_case(tmp_path / "bare.toml", (wide,))) if "overlap" in one]
    barrel = 'springs.inner.coils=[{ turns = 6, diameter = ["20 mm", "23 mm"], pitch = "8 mm" }]'  # wide at its top
    found = check_values(read_case(tmp_path / "bare.toml", (wide, barrel)))
    radius = 0.5 * (20e-3 + 15.0 / 16.0 * 3e-3 + 3e-3)  # the middle of the last of eight parts
    assert [one for one in found if f"by {1e3 * (radius - 12.5e-3):.3g} mm" in one]


INVALID_NESTS = {
    "another end": 'springs.outer.to="seat"',
    "another direction": 'springs.outer.direction="uy"',
    "no mass": "springs.outer.mass=0",
    "one part": "springs.inner.elements=1",
    "itself": 'friction.nest.inside="inner"',
}


@pytest.mark.parametrize("change", INVALID_NESTS)
def test_springs_that_form_no_nest_raise_error(tmp_path, change):
    prepare_nest(tmp_path)
    with pytest.raises(InputError, match="two springs of a nest"):
        build_model(read_case(tmp_path / "nest.toml", ["nodes.seat=[0, -0.04, 0]", INVALID_NESTS[change]]))


@pytest.mark.parametrize(
    "table", ['{ spring = "inner", force = 1 }', '{ at = "retainer", force = 1 }',
              '{ at = "retainer", direction = "uy", spring = "inner", inside = "outer", force = 1 }',
              '{ spring = "inner", inside = "outer", to = "retainer", force = 1 }'],
)  # fmt: skip
def test_friction_with_two_locations_raises_error(tmp_path, table):
    prepare_nest(tmp_path)
    with pytest.raises(InputError, match="either the keys 'at' and 'direction', or 'spring' and 'inside'"):
        read_case(tmp_path / "nest.toml", [f"friction.nest={table}"])


def test_unknown_spring_raises_error(tmp_path):
    prepare_nest(tmp_path)
    with pytest.raises(InputError, match=r"'iner', expected a spring of the case: inner, outer. Did you mean 'inner'"):
        read_case(tmp_path / "nest.toml", ['friction.nest.spring="iner"'])


@pytest.mark.parametrize("model", ["rigid", "chain"])
def test_springs_without_surge_have_no_friction(tmp_path, model):
    """The springs of the rigid model and of chains have a single part."""
    text = (Path(__file__).parent / "cam-follower.toml").read_text(encoding="utf-8")
    outer = '{ at = "mass", direction = "uy", stiffness = "9 kN/m", mass = "20 g" }'
    inner = HYSTERESIS_CASE.split("[springs.inner]")[1].split("[friction]")[0]
    text += "[springs.inner]" + inner.replace("retainer", "mass").replace("-uy", "uy")
    (tmp_path / "follower.toml").write_text(text, encoding="utf-8")
    friction = "{ spring = 'inner', inside = 'outer', force = 20 }"
    tables = [f"springs.outer={outer}", f"friction.nest={friction}", f"fidelity.model={model}", "fidelity.masses=1"]
    found = run(read_case(tmp_path / "follower.toml", tables if model == "chain" else tables[:-1]))
    assert found.channels["friction.nest.force"] == pytest.approx(0.0, abs=1e-9)
