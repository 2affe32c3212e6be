"""Copies of a valve train by placeholders in names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, read_case
from flexcam.case.variants import get_number

CAMSHAFT = Path(__file__).parents[2] / "cases/camshaft-4cyl/camshaft.toml"

TRAIN = """format = 1
[repeat.cylinder]
{repeat}
[repeat.side]
names = ["a", "b"]
spacing = [0, 0, "5 mm"]

[nodes]
front = [0, 0, 0]
"lobe-{{cylinder}}" = ["40 mm", 0, 0]
"tappet-{{cylinder}}{{side}}" = ["40 mm", "20 mm", 0]

[materials]
steel = {{ E = "207 GPa", nu = 0.29, density = "7800 kg/m^3" }}

[sections]
round = {{ shape = "circle", diameter = "25 mm" }}

[members]
shaft = {{ material = "steel", section = "round", nodes = ["front", "lobe-{{cylinder}}"] }}

[supports]
front = ["ux", "uy", "uz", "rx", "ry", "rz"]
"tappet-{{cylinder}}{{side}}" = ["ux", "uz", "rx", "ry", "rz"]

[masses]
"{{cylinder}}{{side}}" = {{ at = "tappet-{{cylinder}}{{side}}", mass = "100 g" }}

[springs."{{cylinder}}{{side}}"]
at = "tappet-{{cylinder}}{{side}}"
direction = "uy"
stiffness = "30 kN/m"
installed_force = "200 N"

[cams."{{cylinder}}"]
at = "lobe-{{cylinder}}"
law = "cycloidal"
lift = "8 mm"
rise = "60 deg"
return = "60 deg"
{cam}

[contacts."{{cylinder}}{{side}}"]
cam = "{{cylinder}}"
follower = "tappet-{{cylinder}}{{side}}"
model = "bilateral"
stiffness = "10 MN/m"
direction = "uy"

[loads]
"{{cylinder}}" = {{ at = "tappet-{{cylinder}}a", direction = "-uy", table = "pressure.csv", area = "600 mm^2" }}

[run]
speed = "2000 rpm"

[output]
probes = ["tappet-{{cylinder}}{{side}}"]
"""

ORDER = 'firing_order = "1-3-4-2"\nspacing = ["90 mm", 0, 0]'


def write(folder: Path, repeat: str = ORDER, cam: str = 'phase = "10 deg"') -> Path:
    (folder / "pressure.csv").write_text("crank angle [deg],pressure [bar]\n0,40\n360,1\n720,40\n", encoding="utf-8")
    path = folder / "case.toml"
    path.write_text(TRAIN.format(repeat=repeat, cam=cam), encoding="utf-8")
    return path


def test_firing_order_delays_cams_and_loads(tmp_path: Path):
    record = read_case(write(tmp_path)).record
    delays = {"1": 0.0, "2": 270.0, "3": 90.0, "4": 180.0}
    assert {n: np.degrees(one.phase) for n, one in record.cams.items()} == pytest.approx(
        {n: 10.0 + delays[n] for n in delays}
    )
    assert {n: np.degrees(one.phase or 0.0) for n, one in record.loads.items()} == pytest.approx(delays)


def test_copies_have_all_combinations_of_placeholders(tmp_path: Path):
    case = read_case(write(tmp_path))
    assert list(case.record.output.probes) == [f"tappet-{n}{side}" for n in "1234" for side in "ab"]
    assert case.record.nodes["tappet-3b"] == pytest.approx((0.22, 0.02, 0.005))
    assert case.record.members["shaft"].nodes == ["front", "lobe-1", "lobe-2", "lobe-3", "lobe-4"]
    assert build_model(case).contacts.keys() == {f"{n}{side}" for n in "1234" for side in "ab"}


@pytest.mark.parametrize(("cam", "key", "first"), [
    ('centreline = "50 deg"', "centreline", 50.0),
    ('timing = { lift = "1 mm", opening = "30 deg" }', "opening", 30.0),
    ('tdc = "350 deg"', "tdc", 350.0),
])  # fmt: skip
def test_each_angle_key_of_cam_is_delayed(tmp_path: Path, cam: str, key: str, first: float):
    """Phases define an uneven order, and a list defines the offsets."""
    repeat = 'names = ["x", "y"]\nphases = ["0 deg", "33 deg"]\noffsets = [[0, 0, 0], ["-0.2 m", 0, 0]]'
    case = read_case(write(tmp_path, repeat, cam))
    cam_y = case.record.cams["y"]
    value = cam_y.timing.opening if cam_y.timing else getattr(cam_y, key)
    assert np.degrees(value) == pytest.approx((first + 33.0) % 360.0)
    assert case.record.nodes["lobe-y"] == pytest.approx((-0.16, 0.0, 0.0))


def test_bank_phases_follow_engine_firing_order(tmp_path: Path):
    repeat = 'names = ["1", "3", "5", "7"]\nfiring_order = "1-8-4-3-6-5-7-2"\nspacing = ["0.1 m", 0, 0]'
    cams = read_case(write(tmp_path, repeat)).record.cams
    assert [np.degrees(one.phase) for one in cams.values()] == pytest.approx([10.0, 145.0, 235.0, 280.0])


def test_override_changes_all_copies_or_one_copy(tmp_path: Path):
    path = write(tmp_path)
    all_changed = read_case(path, {"springs.{cylinder}{side}.stiffness": "50 kN/m", "cams.{cylinder}.phase": "20 deg"})
    assert {one.stiffness for one in all_changed.record.springs.values()} == {50e3}
    assert np.degrees(all_changed.record.cams["3"].phase) == pytest.approx(110.0)
    one = read_case(path, ["springs.3a.stiffness=50kN/m", "repeat.cylinder.firing_order=1-2-3-4"]).record
    assert [spring.stiffness for spring in one.springs.values()].count(50e3) == 1
    assert np.degrees(one.cams["2"].phase) == pytest.approx(100.0)


def test_get_number_returns_value_shared_by_copies(tmp_path: Path):
    case = read_case(write(tmp_path))
    found = get_number(case, "springs.{cylinder}{side}.stiffness", "--to")
    assert (found.value, found.unit) == (30e3, "N/m")
    with pytest.raises(InputError, match="a number that all copies share"):
        get_number(case, "cams.{cylinder}.phase", "--to")


@pytest.mark.parametrize(("repeat", "message"), [
    ('firing_order = "1-3-3-2"', r"repeat\.cylinder\.names \(line 2\): got 1, 2, 3, 3, expected each name once"),
    ('names = ["1", "9"]\nfiring_order = "1-2"', "repeat.cylinder.firing_order.*contains 1, 9 once"),
    ('names = ["1"]\nphases = [0, 1]', "repeat.cylinder.phases.*expected 1, one for each name"),
    ('names = ["1"]\nspacing = [0, 0, 0]\noffsets = [[0, 0, 0]]', "expected either offsets or spacing"),
    ("", "repeat.cylinder.names.*missing, expected names, or a firing_order"),
])  # fmt: skip
def test_invalid_repeat_is_refused(tmp_path: Path, repeat: str, message: str):
    with pytest.raises(InputError, match=message):
        read_case(write(tmp_path, repeat))


def test_fault_of_all_copies_is_reported_once(tmp_path: Path):
    with pytest.raises(InputError) as caught:
        read_case(write(tmp_path, cam='phase = "10 m"\nbase_radius = "3 kg"'))
    wheres = [fault.where for fault in caught.value.faults]
    assert [where.partition(" ")[0] for where in wheres] == ["cams.{cylinder}.phase", "cams.{cylinder}.base_radius"]
    assert all("line" in where for where in wheres)


def test_unknown_or_unused_placeholder_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"got 'b\{cyl\}'.*There is no \[repeat\.cyl\]"):
        read_case(write(tmp_path), ["nodes.b{cyl}=[1, 2, 3]"])
    with pytest.raises(InputError, match=r"repeat\.bank.*a part with \{bank\} in its name"):
        read_case(write(tmp_path), ['repeat.bank.names=["left"]'])


def test_equal_trains_have_separate_modes():
    """Eigenvectors of equal eigenvalues do not mix unconnected unknowns."""
    from flexcam.core import solve_eigenproblem

    one = np.array([[2.0, -1.0], [-1.0, 3.0]])
    _, vectors = solve_eigenproblem(np.eye(6), np.kron(np.eye(3), one))
    assert ((np.abs(vectors.reshape(3, 2, 6)).max(axis=1) > 0.0).sum(axis=0) == 1).all()
    values, shapes = solve_eigenproblem(np.eye(6), np.kron(np.eye(3), one))
    assert np.kron(np.eye(3), one) @ shapes == pytest.approx(shapes * values, abs=1e-12)


@pytest.mark.slow
def test_mean_chain_torque_equals_cam_torques():
    import flexcam

    changes = {"supports.sprocket": ["ux"], "run.fluctuation": {"orders": [4], "amplitudes": [0.0]}}
    chain = {"at": "sprocket", "direction": "rx", "stiffness": "5 kN m/rad", "damping": "5 N m s/rad"}
    response = flexcam.run(read_case(CAMSHAFT, {**changes, "springs.chain": chain}))
    channels, last = response.channels, response.angle >= response.angle[-1] - 2.0 * np.pi
    cams = sum(values for name, values in channels.items() if name.startswith("contacts.") and name.endswith(".torque"))
    mean = float(np.mean(cams[last]))
    assert mean > 0.3
    assert float(np.mean(channels["springs.chain.torque"][last])) == pytest.approx(mean, rel=0.02)
