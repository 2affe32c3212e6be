"""Loads from tables over time and over the cam angle, against closed forms and against the rigid train.

A mass on a spring, at rest, under a force that grows as r t up to t1 and is constant after it: x = r/k (t - sin(w t)/w)
up to t1, and x = r/k (t1 - (sin(w t) - sin(w (t - t1)))/w) after it (R. W. Clough and J. Penzien, Dynamics of
Structures, 3rd ed., ch. 6, Duhamel's integral).
"""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, prepare, read_case, solve
from flexcam.analysis.stability import assess_stability

SOURCE = "Loads from tables"
OSCILLATOR_CASE = """
format = 1
nodes = { mass = [0, 0, 0] }
masses = { one = { at = "mass", mass = "1 kg" } }
springs = { one = { at = "mass", direction = "ux", stiffness = "10 kN/m" } }
loads = { push = { at = "mass", direction = "ux", table = "push.csv" } }
run = { speed = "600 rpm", steps_per_revolution = 1000, revolutions = 2, start = "rest" }
output = { probes = ["mass"] }
"""
SLOPE, END = 2e4, 0.03
"""Slope of the force, N/s, and end of its growth, s."""


def ramp_response(time):
    """Return the closed-form displacement, m."""
    w = math.sqrt(1e4)
    after = np.maximum(time - END, 0.0)
    return SLOPE / 1e4 * (np.minimum(time, END) - (np.sin(w * time) - np.sin(w * after)) / w)


def write_case(folder, rows, case=OSCILLATOR_CASE, **overrides):
    """Write a case and its table, and return the case with overrides."""
    (folder / "push.csv").write_text(rows)
    (folder / "one.toml").write_text(case)
    return read_case(folder / "one.toml", tuple(f"{key}={value}" for key, value in overrides.items()))


def solve_case(case):
    ready = prepare(case)
    found = solve(ready.problem, ready.scheme)
    assert found.status.ok
    return found


@pytest.mark.parametrize(
    ("rows", "overrides"),
    [
        ("time [ms],force [N]\n0,0\n30,600\n300,600\n", {}),
        ("crank angle [deg],force [kN]\n0,0\n216,0.6\n9000,0.6\n", {"loads.push.repeat": "false"}),
        ("cam angle [deg],pressure [bar]\n-90,0\n18,2\n9000,2\n",
         {"loads.push.repeat": "false", "loads.push.area": '"30 cm^2"', "loads.push.phase": '"90 deg"'}),
    ],
    ids=["time", "crank angle", "pressure over cam angle"],
)  # fmt: skip
def test_ramp_response(rows, overrides, record, tmp_path):
    """The collocation integrates a force that is linear over every step without error."""
    found = solve_case(write_case(tmp_path, rows, **overrides, **{"run.integrator": '{ method = "collocation" }'}))
    record(source=SOURCE, case=f"force that grows and stays, {rows.partition(' [')[0]}",
           quantity="largest error of the displacement", unit="m", reference=0.0,
           computed=np.abs(found["mass"].displacement[:, 0] - ramp_response(found.time)).max(), tolerance=1e-12,
           absolute=True,
           reason="rounding: the force is linear over every step")  # fmt: skip


@pytest.mark.parametrize("rows", [
    "time [ms],force [N]\n0,0\n30,600\n300,600\n", "cam angle [deg],force [N]\n0,0\n90,400\n330,0\n",
], ids=["time", "cam angle"])  # fmt: skip
def test_engines_agree_with_load_table(rows, tmp_path):
    """Direct and modal engine evaluate the load at their own instants, the kernel engine in blocks."""
    direct, modal, kernel = (
        solve_case(write_case(tmp_path, rows, **{"run.engine": f'"{engine}"', "run.revolutions": 3}))[
            "mass"
        ].displacement[:, 0]
        for engine in ("direct", "modal", "kernel")
    )
    for other in (modal, kernel):
        np.testing.assert_allclose(other, direct, atol=1e-11 * np.abs(direct).max())


def test_comments_in_table_are_ignored(tmp_path):
    """Comments end a row or fill a line; in the heading a # is part of a name."""
    rows = "# bench 2\ntime [ms],push #1 [N]\n0,0\n30,600  # valve open, held\n\n300,600\n"
    load = write_case(tmp_path, rows).record.loads["push"].table
    assert load.given == "push.csv"
    np.testing.assert_array_equal(load.values, [0.0, 600.0, 600.0])


@pytest.mark.parametrize(
    "rows",
    [
        "crank_deg,pressure_bar\n0,1.5\n300,12\n720,1.5\n",
        "Bench 7\r\ncrank angle [deg];pressure [bar]\r\n0;1,5\r\n300;12\r\n720;1,5\r\n",
        "# bench 7\ncrank_rad\tpressure_MPa\tnote\n0\t0.15\t\n5.235987755982989\t1.2\t3\n12.566370614359172\t0.15\t\n",
        'shot 3, 2026\n"Crank Angle (deg)" , "pressure (bar)"\n 0 , 1.5\n 300 , 12\n 720 , 1.5\n',
        "crank_deg  pressure_kPa\n0  150\n300  1200\n720  150\n",
    ],
)
def test_table_formats(rows, tmp_path):
    """Loggers and spreadsheets differ in separators, decimal commas, preamble, empty cells and units in the names."""
    table = FOLLOWER_CASE.replace('table = "push.csv"', 'table = { file = "push.csv", column = "pressure" }')
    load = prepare(write_case(tmp_path, rows, table)).model.loads["gas"].size
    np.testing.assert_allclose(load.at, np.radians([0.0, 150.0]), rtol=1e-15)
    np.testing.assert_allclose(load.size, [120.0, 960.0], rtol=1e-14)  # 1.5 and 12 bar on 8 cm^2, in N


def test_table_repeats_each_revolution(tmp_path):
    """The force repeats each revolution, across the end of the table; by default only for tables over an angle."""
    rows = "cam angle [deg],force [N]\n30,100\n90,400\n330,0\n"
    case = write_case(tmp_path, rows)
    load = prepare(case).problem.system.loads[0]
    drive = prepare(case).problem.drive
    time = np.linspace(0.0, 0.1, 101)
    first, third = (load.history(drive.at(start + time)) for start in (0.0, 0.2))
    np.testing.assert_allclose(third, first, atol=1e-9)
    assert first[0] == pytest.approx(50.0)  # half way from 330 to 390 deg
    found = solve_case(write_case(tmp_path, rows, **{"run.start": '"periodic"', "run.damping": "{ alpha = 20.0 }"}))
    assert found.stats.periodicity < 1e-9


FOLLOWER_CASE = (
    (Path(__file__).parent / "cam-follower.toml").read_text(encoding="utf-8")
    + """
[loads]
gas = { at = "mass", direction = "-uy", table = "push.csv", area = "8 cm^2" }
"""
)
GAS_TABLE = "crank angle [deg],pressure [bar]\n0,1\n180,3\n300,12\n480,2\n720,1\n"


def test_cam_force_with_gas_pressure(record, tmp_path):
    """The force of a rigid train is F = m s'' w^2 + k s + F0 + p A; a stiff one differs by its vibration."""
    case = write_case(tmp_path, GAS_TABLE, FOLLOWER_CASE)
    rigid = solve_case(write_case(tmp_path, GAS_TABLE, FOLLOWER_CASE, **{"fidelity.model": '"rigid"'}))
    cam = prepare(case).model.cams["c"].event
    angle = rigid.angle
    pressure = 1e5 * np.interp(np.degrees(angle), [0, 90, 150, 240, 360], [1, 3, 12, 2, 1], period=360)
    force = 0.1 * cam(angle, 2) * (20.0 * math.pi) ** 2 + 4e4 * cam(angle, 0) + 300.0 + 8e-4 * pressure
    computed = rigid.channels["contacts.k.force"]
    record(source=SOURCE, case="cam and follower under gas pressure, rigid", quantity="largest error of the force",
           unit="N", reference=0.0, computed=np.abs(computed - force).max(), tolerance=1e-9, absolute=True,
           reason="rounding of 2 kN")  # fmt: skip
    flexible = solve_case(case)
    assert flexible.channels["contacts.k.force"] == pytest.approx(force, abs=0.02 * force.max())


@pytest.mark.parametrize(
    ("rows", "overrides", "message"),
    [
        ("time [s],force [mm]\n0,0\n1,1\n", {}, "a unit of force such as N"),
        ("time [s],force [N]\n0,0\n0,1\n", {}, "increasing values"),
        ("time [s],force [N]\n0,0\n1,\n", {}, "a number in every row"),
        ("force [N]\n0\n1\n", {}, "'crank angle'"),
        ("time [s],gas [N],drag [N]\n0,0,0\n1,1,1\n", {}, "gas, drag"),
        ("cam angle [deg],force [N]\n0,0\n360,1\n", {}, "the same value in the first and the last row"),
        ("cam angle [deg],force [N]\n0,0\n720,0\n", {}, "up to 360 deg"),
        ("time [s],force [N]\n0,0\n1,1\n", {"loads.push.phase": '"90 deg"'}, "no phase"),
        ("time [s],force [N]\n0,0\n1,1\n", {"loads.push.direction": '"rx"', "loads.push.area": 1.0}, "no area"),
        ("time [s],force [N]\n0,0\n1,1\n", {"loads.push.force": 1.0}, "either 'at' with one of 'force' and 'table'"),
        ("time [s],force [N]\n0,0\n1,1\n", {"loads.push.table": '"none.csv"'}, "none.csv"),
        ("time [s],gas [bar]\n0,0\n1,1\n", {}, r"gas \[bar\].*Give the load an area"),
        ("time [s],force\n0,0\n1,1\n", {}, "force, without a unit"),
        ("time [s]\n0\n1\n", {}, "push.csv with only time"),
        ("time [s],force [N]\n0,0\n1,1,2\n", {}, "line 3: '1,1,2'"),
        ("crank angle [deg],force [N]\n120,0\n180,400\n240,0\n", {}, "60 of 360 deg of cam angle"),
    ],
)  # fmt: skip
def test_invalid_table_raises_error(rows, overrides, message, tmp_path):
    with pytest.raises(InputError, match=message):
        write_case(tmp_path, rows, **overrides)


def test_partial_table_repeats_with_repeat_true(tmp_path):
    case = write_case(tmp_path, "cam angle [deg],force [N]\n60,0\n90,400\n120,0\n", **{"loads.push.repeat": "true"})
    assert prepare(case).problem.system.loads[0].history(prepare(case).problem.drive.at(np.array([0.075])))[0] == 0.0


def test_no_multipliers_for_load_over_time(tmp_path):
    """The load does not repeat with the camshaft."""
    case = FOLLOWER_CASE.replace(', area = "8 cm^2"', "")
    found = assess_stability(write_case(tmp_path, "time [s],force [N]\n0,0\n1,1\n", case))
    assert found.floquet is None
    assert "loads.gas.table" in found.why_not


def test_periodic_start_with_load_over_time_raises_error(tmp_path):
    case = write_case(tmp_path, "time [s],force [N]\n0,0\n1,1\n", **{"run.start": '"periodic"'})
    with pytest.raises(InputError, match="repeats each revolution"):
        prepare(case)
