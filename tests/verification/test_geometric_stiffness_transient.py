"""Geometric stiffness within a run, against the theory of the beam column.

- A pinned column with a half-sine bow d0: under P it deflects further by d0 P/(Pcr - P), Pcr = pi^2 E I/L^2; its
  lateral frequency is f0 sqrt(1 - P/Pcr). S. P. Timoshenko and J. M. Gere, Theory of Elastic Stability, 2nd ed.
  (1961), secs. 1.4, 1.12; the frequency in W. Weaver, S. P. Timoshenko, D. H. Young, Vibration Problems in
  Engineering (1990), ch. 5.
- A deflection v of a beam shortens the distance of its ends by 1/2 int (v' + v0')^2 - v0'^2 dx. Under a force F at
  mid-span: F^2 L^5/(960 (E I)^2) + F d0 L^2/(pi^2 E I).
- P(t) = P1 cos(2 w t) on a straight column leads to Mathieu's equation: the motion grows as exp(P1/Pcr w t/4). V. V.
  Bolotin, The Dynamic Stability of Elastic Systems (1964), secs. 1-5.
"""

import math
from dataclasses import replace

import h5py
import numpy as np
import pytest

from flexcam import build_model, modes, prepare, read_case, run
from flexcam.analysis.run import open_result_file
from flexcam.dynamics import ConstantSpeed, Load, Problem, SaveAt, State, equilibrium, newmark, solve
from tests.pinned_rod import LENGTH, TUBE, across, pinned_rod, push

SOURCE = "Geometric stiffness within a run"
E, DENSITY = 207e9, 7800.0
EI, EA = E * TUBE.Iz, E * TUBE.A
EULER = math.pi**2 * EI / LENGTH**2
OMEGA = math.pi**2 / LENGTH**2 * math.sqrt(EI / (DENSITY * TUBE.A))
"""Lateral frequency without axial force, rad/s."""


@pytest.fixture
def column(tmp_path):
    """Return a function that builds the case of a pinned tube, free to shorten."""

    def make(bow, loads="", elements=4):
        path = tmp_path / "column.toml"
        path.write_text(pinned_rod(bow, loads, elements=elements), encoding="utf-8")
        return read_case(path)

    return make


def run_with_tip_force(case, force, step, steps, start=None):
    """Return the run of a column under a tip force over time."""
    system = prepare(case).problem.system
    pull = np.zeros(system.size)
    pull[system.names.index("tip.ux")] = 1.0
    load = Load("pull", pull, lambda motion: force(motion.angle))  # one radian per second: the angle is the time
    system = replace(system, loads=(load,))
    start = start or State.rest(system.size)
    return solve(Problem(system, ConstantSpeed(1.0), step, steps, start), newmark())


@pytest.mark.parametrize("part", [0.1, 0.4, 0.7, 0.9])
def test_static_deflection_of_bowed_column(record, column, part):
    """The bow is small against the length, so that the axial force is P everywhere."""
    bow = 1e-5
    response = run(column(bow, push(-part * EULER)))
    more = response["mid.uy"].displacement[-1]
    # Eight elements raise Euler's load by (pi/8)^4/720 = 3e-5; near it, P/(Pcr - P) amplifies that by 1/(1 - part).
    tolerance = 1e-4 / (1.0 - part)
    record(source=SOURCE, case=f"bowed column, P/Pcr = {part}", quantity="further deflection", unit="m",
           reference=bow * part / (1.0 - part), computed=more, tolerance=tolerance,
           reason="Euler's load of eight elements, enlarged by the nearness to buckling")  # fmt: skip
    record(source=SOURCE, case=f"bowed column, P/Pcr = {part}", quantity="whole deflection", unit="m",
           reference=bow / (1.0 - part), computed=bow + more, tolerance=tolerance, reason="as above")  # fmt: skip


@pytest.mark.parametrize("part", [0.4, 0.9])
def test_shortening_and_axial_force_of_bowed_column(record, column, part):
    """The tip moves by P L/EA and by the growth of the bow; the channels contain P and its ratio to Euler's load."""
    bow = 1e-3
    response = run(column(bow, push(-part * EULER), elements=4))
    total = bow / (1.0 - part)
    drawn = math.pi**2 / (4.0 * LENGTH) * (total**2 - bow**2)
    # The tube is inclined by up to pi d/L: lateral and axial forces are coupled by the square of it, which a shallow
    # arch neglects.
    record(source=SOURCE, case=f"bowed column, P/Pcr = {part}", quantity="shortening", unit="m",
           reference=part * EULER * LENGTH / EA + drawn, computed=-response["tip.ux"].displacement[-1],
           tolerance=1e-3 + 1e-4 / (1.0 - part),
           reason="Euler's load of eight elements, and chords of each instead of its curve")  # fmt: skip
    assert response.channels["members.rod.compression"][-1] == pytest.approx(part * EULER, rel=1e-9)
    assert response.channels["members.rod.buckling_use"][-1] == pytest.approx(part, rel=1e-4)


def smooth_compression(end, first=1e-3, last=0.8):
    """Return a compression that increases smoothly between two parts of Euler's load."""

    def force(time):
        x = np.clip(time / end, 0.0, 1.0)
        return -EULER * (first + (last - first) * x**3 * (10.0 - 15.0 * x + 6.0 * x**2))

    return force


def test_slowly_increasing_force_follows_static_curve(record, column):
    """Over twenty lateral periods the force increases smoothly to 0.8 Pcr: the column follows its static curve."""
    bow, end, steps = 1e-5, 20.0 * 2.0 * math.pi / OMEGA, 400
    force = smooth_compression(end)
    start = equilibrium(
        prepare(column(bow, push(-1e-3 * EULER), elements=2)).problem.system, ConstantSpeed(1.0)
    )  # fmt: skip
    response = run_with_tip_force(column(bow, elements=2), force, end / steps, steps, start)
    part = -force(response.time) / EULER
    more = response["mid.uy"].displacement
    worst = np.abs(more - bow * part / (1.0 - part)).max()
    record(source=SOURCE, case="bowed column, P rises to 0.8 Pcr", quantity="largest distance from the static curve",
           unit="m", reference=0.0, computed=worst, tolerance=0.01 * bow * 4.0, absolute=True,
           reason="Pcr of four elements is 5e-4 high, five times that at the end; 0.5 % for its inertia")  # fmt: skip


def test_force_increasing_from_zero(column):
    end, steps = 20.0 * 2.0 * math.pi / OMEGA, 600
    response = run_with_tip_force(column(1e-5, elements=2), smooth_compression(end, 0.0), end / steps, 20)
    assert response.status.ok


def test_single_instant_block_succeeds(column):
    ready = prepare(column(1e-4, push(-100.0), elements=1))
    response = solve(ready.problem, ready.scheme, save=SaveAt(field_every=1, fields_per_block=1))
    assert response.status.ok


def zero_crossing_frequency(time, values):
    """Return the angular frequency from the zeros of a motion, by linear interpolation."""
    i = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    zeros = time[i] - values[i] * (time[i + 1] - time[i]) / (values[i + 1] - values[i])
    return math.pi * (len(zeros) - 1) / (zeros[-1] - zeros[0])


@pytest.mark.parametrize("part", [-1.0, 0.6])
def test_lateral_frequency_under_axial_force(record, column, part):
    """A small lateral velocity excites the column under a steady force (tension if the part is negative)."""
    case = column(0.0, push(-part * EULER), elements=2)
    system = prepare(case).problem.system
    still = equilibrium(system, ConstantSpeed(1.0))
    expected = OMEGA * math.sqrt(1.0 - part)
    shape = np.zeros(system.size)
    nodes = node_positions(case)
    for i, name in enumerate(system.names):
        node, component = name.rsplit(".", 1)
        if component in ("uy", "rz"):
            x = nodes[node] * math.pi / LENGTH
            shape[i] = math.sin(x) if component == "uy" else math.pi / LENGTH * math.cos(x)
    steps, periods = 200, 2
    step = 2.0 * math.pi / expected * periods / steps
    response = solve(Problem(system, ConstantSpeed(1.0), step, steps, State(still.displacement, 1e-6 * shape)),
                     newmark())  # fmt: skip
    found = zero_crossing_frequency(response.time, response["mid.uy"].displacement)
    record(source=SOURCE, case=f"column struck sideways, P/Pcr = {part}", quantity="angular frequency", unit="rad/s",
           reference=expected, computed=found, tolerance=5e-4 + 3e-4 / (1.0 - part),
           reason="(w dt)^2/24 = 2e-4 of the frequency, and Euler's load of four elements, 5e-4 high")  # fmt: skip


def node_positions(case):
    """Return x of every node by the name that its unknowns have."""
    mesh = build_model(case).mesh
    return {mesh.node_name(i): float(x) for i, x in enumerate(mesh.nodes[:, 0])}


@pytest.mark.parametrize("force", [20.0, -5.0])
@pytest.mark.parametrize("bow", [0.0, 1e-3])
def test_bending_shortens_beam(record, column, force, bow):
    """Without axial force the chord follows from bending alone; a deflection against the bow lengthens the beam."""
    response = run(column(bow, across(force), elements=4))
    deep = force * LENGTH**3 / (48.0 * EI)
    assert response["mid.uy"].displacement[-1] == pytest.approx(deep, rel=1e-6)
    drawn = force**2 * LENGTH**5 / (960.0 * EI**2) + force * bow * LENGTH**2 / (math.pi**2 * EI)
    record(source=SOURCE, case=f"{force:g} N across, bow {bow:g} m", quantity="shortening", unit="m", reference=drawn,
           computed=-response["tip.ux"].displacement[-1], tolerance=1e-4,
           reason="the bow's half sine in eight cubic pieces; without a bow the cubics are exact")  # fmt: skip
    assert abs(response.channels["members.rod.compression"]).max() < 1e-6 * abs(force)


def test_shortening_oscillates_at_twice_lateral_frequency(record, column):
    """A beam released from a bend oscillates with w and its tip with 2 w, as bending to either side shortens it."""
    case = column(0.0, across(10.0), elements=2)
    system = prepare(case).problem.system
    bent = equilibrium(system, ConstantSpeed(1.0))
    steps, periods = 400, 4
    step = 2.0 * math.pi / OMEGA * periods / steps
    free = replace(system, loads=())
    response = solve(Problem(free, ConstantSpeed(1.0), step, steps, bent), newmark())
    tip, mid = (response[name].displacement for name in ("tip.ux", "mid.uy"))
    deep = np.abs(mid).max()
    spectrum = np.abs(np.fft.rfft((tip[:-1] - tip[:-1].mean()) * np.hanning(steps)))
    record(source=SOURCE, case="bend let go", quantity="tip's swings per lateral swing", unit="1", reference=2.0,
           computed=float(np.argmax(spectrum[: 4 * periods])) / periods, tolerance=1e-9,
           reason="four whole periods are a line of the spectrum")  # fmt: skip
    # Mean of sin^2: half of pi^2 d^2/(4 L); the deflection under a point force is a half sine within 2 %.
    assert tip.mean() == pytest.approx(-(math.pi**2) * deep**2 / (8.0 * LENGTH), rel=0.05)


@pytest.mark.parametrize(("orders", "grows"), [(2.0, True), (1.5, False)])
def test_parametric_growth_under_pulsating_force(record, column, orders, grows):
    """At twice the lateral frequency the oscillation of the column grows, at 1.5 times it does not."""
    part, bow, periods, per_period = 0.2, 1e-6, 20, 40
    step = 2.0 * math.pi / OMEGA / per_period
    case = column(bow, elements=1)
    start = equilibrium(prepare(column(bow, push(part * EULER), elements=1)).problem.system, ConstantSpeed(1.0))
    response = run_with_tip_force(
        case, lambda time: part * EULER * np.cos(orders * OMEGA * time), step, periods * per_period, start
    )
    mid = np.abs(response["mid.uy"].displacement).reshape(-1)[1:]
    tops = mid.reshape(periods, per_period).max(axis=1)
    if not grows:
        # The forced motion of the bow is part/(1 - orders^2) of it, the free motion of equal size; both beat without
        # growth.
        assert tops.max() < 3.0 * bow * part
        return
    rate = np.polyfit(np.arange(periods // 2) * 2.0 * math.pi, np.log(tops[periods // 2 :]), 1)[0]
    record(source=SOURCE, case="P = 0.2 Pcr cos(2 w t)", quantity="growth per radian of w t", unit="1",
           reference=part / 4.0, computed=rate, tolerance=0.02,
           reason="Bolotin's first order is part/4 (1 - O(part^2)); axial inertia adds 0.4 %")  # fmt: skip


TRAIN = """
format = 1
[nodes]
drive = [0.0, 0.0, 0.0]
cam = [0.06, 0.0, 0.0]
rear = [0.12, 0.0, 0.0]
tappet = [0.06, 0.024, 0.0]
top = [0.06, 0.274, 0.0]
[materials.steel]
E = "207 GPa"
nu = 0.29
density = "7800 kg/m^3"
[sections]
shaft = { shape = "circle", diameter = "30 mm" }
tube = { shape = "tube", outer_diameter = "8 mm", inner_diameter = "5 mm" }
[members]
camshaft = { nodes = ["drive", "cam", "rear"], material = "steel", section = "shaft" }
[members.pushrod]
nodes = ["tappet", "top"]
elements = 4
material = "steel"
section = "tube"
geometric_stiffness = true
bow = "0.3 mm"
[supports]
drive = ["ux", "uy", "uz", "rx"]
rear = ["uy", "uz"]
tappet = ["ux", "uz", "ry", "rx"]
top = ["ux", "uz"]
[masses]
follower = { at = "tappet", mass = "0.06 kg" }
valve = { at = "top", mass = "0.2 kg" }
[springs]
valve = { at = "top", direction = "uy", stiffness = "100 kN/m", installed_force = "900 N" }
[cams.intake]
at = "cam"
law = "4-5-6-7"
lift = "6 mm"
rise = "90 deg"
return = "90 deg"
phase = "10 deg"
base_radius = "24 mm"
width = "12 mm"
follower = { type = "flat" }
[contacts]
intake = { cam = "intake", follower = "tappet", model = "unilateral", stiffness = "hertz" }
[run]
speed = "1500 rpm"
revolutions = 0.55
steps_per_revolution = 2400
start = "equilibrium"
[output]
probes = ["tappet", "top"]
"""


def test_energy_conservation_of_undamped_train(record, tmp_path):
    """The contact stays closed at 2400 steps per revolution, so that no event dissipates energy.

    The balance is also checked independently: the work of the cam is the integral of its torque.
    """
    path = tmp_path / "train.toml"
    path.write_text(TRAIN, encoding="utf-8")
    response = run(read_case(path))
    channels = response.channels
    assert channels["contacts.intake.force"].min() > 0.0
    assert channels["members.pushrod.buckling_use"].max() > 0.1  # bow and axial force interact
    most = np.abs(channels["energy.work"]).max()
    for part in ("residual", "dissipated", "numerical"):
        record(source=SOURCE, case="train with bow and Hertz contact, 2400 steps", quantity=f"{part} energy over work",
               unit="1", reference=0.0, computed=np.abs(channels[f"energy.{part}"]).max() / most, tolerance=1e-6,
               absolute=True, reason="nothing in it loses energy; what curves within a step")  # fmt: skip
    angle, event = response.angle, build_model(read_case(path)).cams["intake"].event
    # Work of the cam at its own angle: the penetration is s + s' twist, so that the work is F (s' + s'' twist) dtheta.
    torque = channels["contacts.intake.torque"]
    torque = torque + channels["contacts.intake.force"] * event(angle, 2) * channels["cams.intake.twist"]
    work = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]) * np.diff(angle))])
    stored = sum(channels[f"energy.{part}"] for part in ("kinetic", "strain", "contact"))
    springs = -900.0 * response["top.uy"].displacement  # the installed force is a load, not a strain
    springs -= springs[0]
    record(source=SOURCE, case="train with bow and Hertz contact, 2400 steps", quantity="integral of the cam's torque",
           unit="J", reference=0.0, computed=np.abs(work + springs - (stored - stored[0])).max() / most, tolerance=1e-5,
           absolute=True, reason="trapezoids of the torque, and the Hertz law changing with the curvature")  # fmt: skip


def test_unloaded_train_with_bow_runs(tmp_path):
    path = tmp_path / "train.toml"
    text = TRAIN.replace(', installed_force = "900 N"', "").replace('start = "equilibrium"', 'start = "rest"')
    text = text.replace('model = "unilateral", stiffness = "hertz"', 'model = "bilateral", stiffness = "100 MN/m"')
    path.write_text(text.replace("revolutions = 0.55", "revolutions = 0.01"), encoding="utf-8")
    assert run(read_case(path)).status.ok


def test_result_file_contains_section_force_of_bowed_column(column, tmp_path):
    ready = prepare(column(1e-3, push(-0.5 * EULER)))
    sink = open_result_file(ready, tmp_path / "results")
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    with h5py.File(sink.path) as file:
        axial = np.array(file["VTKHDF/PointData/section_force"])[:, 0]
    np.testing.assert_allclose(axial, -0.5 * EULER, rtol=1e-3)


def test_modes_of_loaded_bowed_column(column):
    """Out of the plane of the bow, the lowest frequency is that of a straight column under P."""
    found = modes(column(1e-3, push(-0.5 * EULER)), 3, prestress="equilibrium").modes.frequencies
    expected = OMEGA * math.sqrt(0.5) / (2.0 * math.pi)
    assert np.abs(np.asarray(found) - expected).min() < 2e-3 * expected
