"""Warnings about time steps, elements and equilibrium: their basis and their conditions."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import flexcam
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_result_file
from flexcam.analysis.run_checks import (
    RunMonitor,
    check_input,
    check_run,
    describe_balance,
    describe_decay,
    energy_share,
)
from flexcam.core.errors import InputError
from flexcam.dynamics import Block, ConstantSpeed, Outline, Problem, State, Stats, hht, newmark, solve
from flexcam.dynamics.energy import EquilibriumResidual
from flexcam.valvetrain import Resolution, ResolutionSink, build_structure

CASE = Path(__file__).parents[1] / "data/inline.toml"


def monitored_run(path, *settings):
    ready = prepare(flexcam.read_case(path, settings))
    seen = RunMonitor.of(ready)
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=seen.sinks)
    return ready, seen, response


def run_warnings(path, *settings):
    ready, seen, response = monitored_run(path, *settings)
    return check_run(ready, seen, [], response.stats)


def test_rounding_is_no_damping_of_a_mode():
    """The products with zero damping leave a damping ratio of 1e-29 in a mode of the pushrod."""
    case = flexcam.read_case("cases/pushrod-engine/lever.toml", ["run.damping.beta=0 s", "run.crank_speed=5600rpm"])
    text, decays = describe_decay(prepare(case), "pushrod")
    assert "is not damped, so the motion never repeats" in text
    assert not decays


def test_frequency_of_harmonic_motion():
    """The frequency of a harmonic motion is its own; all unknowns follow one sine here."""
    ready = prepare(flexcam.read_case(CASE))
    seen = RunMonitor.of(ready)
    sink, w, n = seen.resolution, 700.0, ready.problem.system.size
    t = np.linspace(0.0, 2.0 * math.pi / w, 400, endpoint=False)[:, None]
    block = solve(ready.problem, ready.scheme).fields
    moved = block._replace(displacement=np.sin(w * t) * np.ones(n), velocity=w * np.cos(w * t) * np.ones(n),
                    acceleration=-(w**2) * np.sin(w * t) * np.ones(n))  # fmt: skip
    time, channels = t[:, 0], np.zeros((len(t), len(seen.extremes.outline.channels)))
    sink.write(Block(time, time, moved, channels, time, time, moved))
    found = sink.evaluate()
    assert found.frequency == pytest.approx(w / (2.0 * math.pi), rel=1e-12)
    assert found.steps == pytest.approx(2.0 * math.pi / (w * ready.problem.step), rel=1e-12)


def test_elements_per_wave_match_beam_theory():
    """For a bending shaft: 2 pi/l (EI/(rho A w^2))^(1/4)."""
    _, seen, _ = monitored_run(CASE)
    found = seen.resolution.evaluate()
    radius, longest = 0.0125, 0.060
    rigidity, mass = 207e9 * math.pi / 4.0 * radius**4, 7800.0 * math.pi * radius**2
    wave = 2.0 * math.pi * (rigidity / (mass * (2.0 * math.pi * found.frequency) ** 2)) ** 0.25
    assert found.elements == {"camshaft": pytest.approx(wave / longest, rel=1e-9)}


def test_steps_of_impact_with_maximum_force():
    ready = prepare(flexcam.read_case(CASE))
    names = ["struck", "begins closed", "open"]
    channels = tuple((f"contacts.{name}.force", "N") for name in names)
    sink = ResolutionSink(build_structure(ready.model), ready.problem.system, Outline((), (), channels), 1e-4)
    first = np.array([[0.0, 1.0, 0.0], [2.0, 1.0, 0.0], [5.0, 2.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    sink.write(SimpleNamespace(channels=first, field_time=()))
    sink.write(SimpleNamespace(channels=np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), field_time=()))
    assert sink.evaluate().impacts == {"struck": 3}
    sink.write(SimpleNamespace(channels=np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), field_time=()))
    assert sink.evaluate().impacts == {"struck": 1}


def test_resolution_without_motion():
    ready = prepare(flexcam.read_case(CASE))
    assert RunMonitor.of(ready).resolution.evaluate() == Resolution(0.0, math.inf, {}, {})


def test_fine_run_has_no_warnings():
    assert run_warnings(CASE) == []


def test_coarse_steps_cause_warning():
    words = run_warnings(CASE, "run.steps_per_revolution=12")
    assert any("time steps per period;" in one for one in words)


@dataclass(frozen=True)
class FixedResolution:
    """Stand-in for a `ResolutionSink` with a given result."""

    resolution: Resolution

    def evaluate(self):
        return self.resolution


def test_coarse_elements_and_impacts_cause_warnings():
    ready, seen, response = monitored_run(CASE)
    coarse = Resolution(400.0, 30.0, {"shaft": 30.0, "camshaft": 1.9}, {"seat": 4, "tip": 5, "play": 1})
    run_warnings = check_run(ready, replace(seen, resolution=FixedResolution(coarse)), [], response.stats)
    longer = "use more steps per revolution"
    bend = "at 400 Hz a bending wave in member camshaft is only 1.9 elements long"
    elements = f"elements = {3 * ready.case.record.members['camshaft'].elements}"
    assert run_warnings == [
        f"Warning: {bend}; set {elements} in {ready.case.place(('members', 'camshaft'))}",
        f"Warning: the largest force of contact seat comes from an impact that lasts only 4 time steps: {longer}",
        f"Warning: the largest force of contact play comes from an impact that lasts only 1 time step: {longer}",
    ]


@pytest.mark.parametrize(("steps", "more"), [(19.9, 724), (7.0, 2058), (1.5, 9600)])
def test_warning_states_sufficient_steps(steps, more):
    """A period needs 20 of the 720 steps per revolution; the number of elements depends on its frequency."""
    ready, seen, response = monitored_run(CASE)
    found = FixedResolution(Resolution(400.0, steps, {"camshaft": 1.9}, {}))
    (run_warnings,) = check_run(ready, replace(seen, resolution=found), [], response.stats)
    assert run_warnings.endswith(f"use at least {more} steps per revolution and check again")


def test_monitor_from_response_matches_run():
    ready, seen, response = monitored_run(CASE)
    again = RunMonitor.from_response(ready, response)
    assert again.resolution.evaluate().frequency == pytest.approx(seen.resolution.evaluate().frequency, rel=1e-12)
    assert energy_share(again.extremes, "residual") == energy_share(seen.extremes, "residual")


@pytest.mark.parametrize("path", ["direct", "modal", "kernel"])
def test_equilibrium_residual_is_small(path):
    """Equilibrium holds to rounding with any engine; with HHT it holds between instants, and not at them."""
    ready = prepare(flexcam.read_case(CASE, [f"run.engine={path}"]))
    assert 0.0 < solve(ready.problem, ready.scheme).stats.imbalance < 1e-10
    between = solve(ready.problem, hht(alpha=-0.1)).stats.imbalance
    assert 1e-6 < between < 1e-2


def test_missing_force_increases_residual(system_of, monkeypatch):
    """The residual of a load that the equilibrium omits is the complete load."""
    push = (np.ones(1), lambda motion: np.ones_like(motion.angle))
    problem = Problem(system_of([[1.0]], [[0.0]], [[49.0]], (push,)), ConstantSpeed(1.0), 1e-2, 400, State.rest(1))
    assert solve(problem, newmark()).stats.imbalance < 1e-12
    made = EquilibriumResidual.__init__

    def omit_loads(self, system, forces, step):
        made(self, system, forces, step)
        self._vectors = 0.0 * self._vectors

    monkeypatch.setattr(EquilibriumResidual, "__init__", omit_loads)
    # The maximum force is that of the spring, twice the load; the residual is sampled every twentieth step.
    assert solve(problem, newmark()).stats.imbalance == pytest.approx(0.5, abs=0.02)


BALL = """
format = 1
nodes = { ball = [0, 0, 0] }
supports = { ball = ["ux", "uz"] }
masses.body = { at = "ball", mass = "1 kg" }
springs.soft = { at = "ball", direction = "uy", stiffness = "1 N/m" }
contacts.seat = { at = "ball", direction = "uy", model = "seat", stiffness = "1000 MN/m" }

[run]
speed = "60 rpm"
revolutions = 1
steps_per_revolution = 1000
gravity = [0, "-9.81 m/s^2", 0]
start = { displacement = { "ball.uy" = "100 mm" } }
"""


@pytest.mark.slow
def test_numerical_dissipation_causes_warning(tmp_path):
    """A ball falls with 1 J on a seat that is much too stiff for the time steps."""
    path = tmp_path / "ball.toml"
    path.write_text(BALL, encoding="utf-8")
    ready, seen, response = monitored_run(path, 'run.integrator={method="bathe"}')
    energy = response.channels
    share = energy["energy.numerical"].max() / max(np.ptp(energy[f"energy.{n}"]) for n in ("work", "kinetic", "strain"))
    assert share > 0.5
    assert energy_share(seen.extremes, "numerical") == pytest.approx(share, rel=1e-12)
    removed = f"energy removed by the integrator {share:.2g} (of the largest energy)"
    assert removed in describe_balance(seen.extremes, response.stats)
    (words,) = (one for one in check_run(ready, seen, [], response.stats) if "dissipates" in one)
    assert words.startswith(f"Warning: the time integration dissipates {100.0 * share:.3g} % of the largest energy")
    assert words.endswith("use more steps per revolution, or leave run.integrator out")


@pytest.mark.parametrize("text", ["", BALL], ids=["average acceleration", "collocation"])
def test_energy_added_by_integrator_causes_warning(text, tmp_path):
    """A case without the integrator key uses the default method: the warning does not suggest to omit it."""
    path = tmp_path / "ball.toml"
    path.write_text(text, encoding="utf-8")
    ready, seen, response = monitored_run(path if text else CASE)
    at = [name for name, _ in response.outline.channels].index("energy.numerical")
    largest = max(np.ptp(response.channels[f"energy.{name}"]) for name in ("work", "kinetic", "strain"))
    seen.extremes._channels.least[at] = -0.9 * largest
    assert "energy added by the integrator 0.9 (of" in describe_balance(seen.extremes, response.stats)
    words = [one for one in check_run(ready, seen, [], response.stats) if "time integration" in one]
    assert len(words) == 1
    assert " adds " in words[0]
    assert words[0].endswith("use more steps per revolution")


def test_residual_is_independent_of_units(system_of):
    push = (np.array([1.0, 0.0]), lambda motion: np.ones_like(motion.angle))
    K, M = np.array([[50.0, -10.0], [-10.0, 40.0]]), np.diag([1.0, 2.0])
    shares = []
    for scale in (1.0, 1e6):
        S = np.diag([1.0, scale])
        system = system_of(S @ M @ S, np.zeros((2, 2)), S @ K @ S, (push,))
        shares.append(solve(Problem(system, ConstantSpeed(1.0), 1e-2, 400), hht(alpha=-0.2)).stats.imbalance)
    assert shares[0] == pytest.approx(shares[1], rel=1e-6)


def test_equilibrium_residual_causes_warning():
    ready, seen, response = monitored_run(CASE)
    words = check_run(ready, seen, [], replace(response.stats, imbalance=0.02))
    assert words == [
        (
            "Warning: forces are out of balance by up to 2 % of the largest: the steps are too long for the motion; "
            "use more steps per revolution"
        )
    ]
    assert "equilibrium of forces within" in describe_balance(seen.extremes, response.stats)
    assert describe_balance(seen.extremes, Stats()).endswith("forces not checked")


@pytest.mark.parametrize("path", ["direct", "modal", "kernel"])
@pytest.mark.parametrize("steps", [1, 5, 19])
def test_residual_of_short_run_is_computed(path, steps, monkeypatch):
    """The last step is sampled; without the loads, most of the early forces, the residual is large."""
    ready = prepare(flexcam.read_case(CASE, [f"run.engine={path}"]))
    short = replace(ready.problem, steps=steps)
    assert 0.0 < solve(short, ready.scheme).stats.imbalance < 1e-10
    look = EquilibriumResidual.evaluate

    def omit_loads(self, track, seen, inputs, rows):
        look(self, track, replace(seen, histories=0.0 * seen.histories), inputs, rows)

    monkeypatch.setattr(EquilibriumResidual, "evaluate", omit_loads)
    assert solve(short, ready.scheme).stats.imbalance > 0.1


def test_unchecked_residual_is_not_reported_as_zero(tmp_path):
    """The run stops before the first saved field."""
    asked = count()
    ready = prepare(flexcam.read_case(CASE, ["run.engine=direct"]))
    seen, sink = RunMonitor.of(ready), open_result_file(ready, tmp_path)
    sinks = [*seen.sinks, sink]
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=sinks, stop=lambda: next(asked) > 3)
    assert response.stats.imbalance < 0.0
    assert describe_balance(seen.extremes, response.stats).endswith("forces not checked")
    assert check_run(ready, seen, [], response.stats) == []
    (left,) = tmp_path.glob("*.vtkhdf")
    assert flexcam.read_result(left).response.stats.imbalance < 0.0


def test_large_displacements_cause_warning():
    """Linear beams compute any deflection."""
    soft = run_warnings(CASE, "materials.steel.E=2 MPa")
    assert any("member camshaft leaves the range of small displacements" in one for one in soft)
    assert not any("small displacements" in one or "turns by" in one for one in run_warnings(CASE))


def test_rigid_rotation_is_no_deformation():
    """A stiff arm rotates by the lift of its cam, 18 deg; one clamped at its pivot deforms."""
    arm = Path(__file__).with_name("arm.toml")
    clamped = 'supports.pivot=["ux", "uy", "uz", "rx", "ry", "rz"]', "materials.steel.E=40 MPa"
    (stiff,) = (one for one in run_warnings(arm) if "member" in one)
    assert re.search(r"member arm turns by 1[78]\.\d deg, .*: its rotation remains valid", stiff)
    assert any("member arm leaves the range" in one for one in run_warnings(arm, *clamped))


@pytest.mark.parametrize(
    ("override", "fault"),
    [
        ('contacts.main.direction="uy"', "expected [0.0, 0.8192, 0.5736]. The roller moves perpendicular to its arm"),
        ("cams.main.follower.arm=120mm", "follower.arm (--set cams.main.follower.arm=120mm): got 120 mm, expected 130"),
        ('cams.main.follower.rotation="clockwise"', "got clockwise, expected counterclockwise. Pivot, about which"),
    ],
)
def test_arm_on_a_shaft_must_agree_with_its_nodes(override, fault):
    """The supports of the shaft are on the axis of the pivot, and do not hide it."""
    with pytest.raises(InputError) as refusal:
        prepare(flexcam.read_case(Path(__file__).with_name("arm.toml"), [override]))
    assert fault in str(refusal.value)


def test_pivot_and_roller_away_from_their_places_are_reported():
    case = flexcam.read_case(Path(__file__).with_name("arm.toml"), ['nodes.cam=["0 mm", "0 mm", "-30 mm"]'])
    warnings = [one for one in check_input(prepare(case)) if "cam centre" in one]
    assert [re.search(r"is ([\d.]+) mm from .* should be ([\d.]+) mm", one).groups() for one in warnings] == [
        ("220", "190"),
        ("135.8", "112"),
    ]


def test_result_file_contains_warnings(tmp_path):
    ready = prepare(flexcam.read_case(CASE))
    asked = []
    sink = open_result_file(
        ready, tmp_path, warnings=lambda stats: asked.append(stats.steps) or ["Warning: one", "two"]
    )
    solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink])
    read = flexcam.read_result(sink.path)
    assert read.warnings == ("Warning: one", "two")
    assert asked == [ready.problem.steps]
    assert read.response.stats.imbalance == pytest.approx(0.0, abs=1e-10)


def test_equilibrium_residual_with_contacts_is_small():
    ready = prepare(flexcam.read_case(CASE.with_name("every-contact.toml"), ["run.revolutions=0.2"]))
    response = solve(ready.problem, ready.scheme)
    assert np.abs(response.channels["contacts.intake.force"]).max() > 1.0
    assert 0.0 < response.stats.imbalance < 1e-9
