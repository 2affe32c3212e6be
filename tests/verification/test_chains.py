"""Condensed mass chains: static condensation is exact, and more masses converge to the beam model.

Guyan's condensation is exact in statics for forces at retained points (R. J. Guyan, AIAA J. 3 (2), 1965, p. 380), and
its frequencies are above those of the full model: the shapes are Rayleigh's (R. W. Clough and J. Penzien, Dynamics of
Structures).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, prepare, read_case, run, solve
from flexcam.analysis.preparation import set_initial_state
from flexcam.dynamics import modes
from flexcam.valvetrain import build_chain, build_structure, follower_train

ROOT = Path(__file__).parents[2]
SOURCE = "Chains of masses from the beam model"
TAYEB = ROOT / "cases/tayeb/model-3-shm.toml"
LI = ROOT / "cases/li/valve-train.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
FINE = ["members.pushrod.elements=4"]


def elastic_frequencies(system):
    found = modes(system.mass, system.stiffness, free=system.free)
    return found.frequencies[found.rigid :]


def mass_chain(case, count, **options):
    return build_chain(build_model(case), case.speed, count, **options)


def prepare_mass_chain(case, count):
    """Return a run of the equations of the chain; a given initial state is projected by least squares."""
    ready, found = prepare(case), mass_chain(case, count)
    problem = replace(ready.problem, system=found.system, start=None)
    if case.record.run.start in ("rest", "equilibrium", "periodic"):
        return replace(ready, problem=set_initial_state(case, ready.model, problem))
    start = ready.problem.start
    motion = np.column_stack([start.displacement, start.velocity])
    moved, moving = np.linalg.lstsq(found.shapes, motion, rcond=None)[0].T
    return replace(ready, problem=replace(problem, start=replace(start, displacement=moved, velocity=moving)))


@pytest.fixture(scope="module")
def beam_model():
    case = read_case(TAYEB, FINE)
    return case, prepare(case).problem.system


@pytest.mark.parametrize("count", [1, 2, 5])
def test_condensation_preserves_static_stiffness(record, beam_model, count):
    """A unit force acts at the follower; the displacements of follower and valve are compared."""
    case, system = beam_model
    found = mass_chain(case, count).system
    tappet = system.names.index("tappet.uy")
    push, own = np.eye(system.size)[tappet], np.eye(found.size)[0]
    beams = np.linalg.lstsq(system.stiffness.dense(), push, rcond=None)[0]
    masses = np.linalg.solve(found.stiffness.dense(), own)
    record(source=SOURCE, case=f"Tayeb and Sliman, model 3, {count} masses", quantity="stiffness at the follower",
           unit="N/m", reference=1.0 / beams[tappet], computed=1.0 / masses[0], tolerance=1e-9,
           reason="static condensation is exact there")  # fmt: skip
    valve = [next(p for p in one.probes if p.name == "valve").rows[0] for one in (system, found)]
    assert valve[1] @ masses == pytest.approx(valve[0] @ beams, rel=1e-9)


FIRST_MODE_ERROR = {1: 2e-3, 2: 2e-5, 3: 1e-5, 13: 1e-9}
"""Relative error of the first mode, from above, by number of masses: Rayleigh's quotient of the static shapes."""


@pytest.mark.parametrize("count", FIRST_MODE_ERROR)
def test_first_mode_converges_from_above(record, beam_model, count):
    case, system = beam_model
    found = elastic_frequencies(mass_chain(case, count).system)[0]
    assert found >= elastic_frequencies(system)[0] * (1.0 - 1e-10)
    record(source=SOURCE, case=f"Tayeb and Sliman, model 3, {count} masses", quantity="first mode of the follower",
           unit="Hz", reference=elastic_frequencies(system)[0], computed=found, tolerance=FIRST_MODE_ERROR[count],
           reason="above it, by what the static shapes miss")  # fmt: skip


@pytest.mark.parametrize("lumped", [False, True])
def test_second_mode_converges_with_number_of_masses(record, beam_model, fitted_order, lumped):
    """The second mode is that of the pushrod between tappet and valve; equal lumped parts have second order."""
    case, system = beam_model
    exact, counts = elastic_frequencies(system)[1], (4, 7, 13)
    errors = [abs(elastic_frequencies(mass_chain(case, k, lumped=lumped).system)[1] / exact - 1.0) for k in counts]
    assert errors[2] < 0.3 * errors[1] < 0.3 * errors[0]
    if lumped:
        order = fitted_order([1.0 / (k - 1.0) for k in counts[:2]], errors[:2])
        assert order > 1.5
    kind = "uncoupled" if lumped else "condensed"
    record(source=SOURCE, case=f"Tayeb and Sliman, model 3, 13 {kind} masses", quantity="error of the second mode",
           unit="1", reference=0.0, computed=errors[2], tolerance=1e-3 if lumped else 1e-9, absolute=True,
           reason="lumped in place of consistent masses" if lumped else "every node of the train is kept")  # fmt: skip


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_total_mass_matches_rigid_train(record, beam_model, count):
    case, _ = beam_model
    structure = build_structure(build_model(case))
    contact = next(iter(structure.model.cam_contacts.values()))
    found = mass_chain(case, count, lumped=True)
    rigid = follower_train(structure, contact, "test").mass
    allowed, reason = (8e-3, "the pushrod yields") if count == 1 else (1e-9, "momentum of the rigid motion")
    record(source=SOURCE, case=f"Tayeb and Sliman, model 3, {count} uncoupled masses",
           quantity="their sum, as felt at the follower", unit="kg", reference=rigid, computed=found.masses.sum(),
           tolerance=allowed, reason=reason)  # fmt: skip
    series = case.record.materials["steel"].E * np.pi * (0.008**2 - 0.005**2) / 4.0 / 0.25
    if count > 1:
        assert 1.0 / np.sum(1.0 / found.stiffnesses) == pytest.approx(series, rel=1e-9)


def test_chain_of_lumped_train_is_identical():
    case = read_case(LI)
    found, own = mass_chain(case, 3), prepare(case).problem.system
    assert found.points == ("tappet", "rocker", "valve")
    np.testing.assert_allclose(found.system.mass.dense(), own.mass.dense(), atol=1e-15)
    np.testing.assert_allclose(found.system.stiffness.dense(), own.stiffness.dense(), rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(found.masses, [0.25, 0.18, 0.21], rtol=1e-12)
    np.testing.assert_allclose(found.stiffnesses, 4e6, rtol=1e-9)


@pytest.mark.parametrize(("count", "allowed"), [(1, 1e-2), (2, 1e-3)])
def test_valve_displacement_of_chain_matches_beams(record, count, allowed):
    """The published load acts at 3000 rpm; the channels are those of the beam model.

    A chain of one mass does not include the pushrod, so its compression is not a channel.
    """
    case = read_case(TAYEB)
    ready, beams = prepare_mass_chain(case, count), run(case)
    found = solve(ready.problem, ready.scheme, save=ready.save)
    assert found.status.ok
    pushrod = {"members.pushrod.compression", "members.pushrod.buckling_use"}
    assert set(beams.channels) - set(found.channels) == (pushrod if count == 1 else set())
    x = beams["valve"].displacement
    record(source=SOURCE, case=f"Tayeb and Sliman, model 3, {count} masses, 3000 rpm", quantity="largest difference of "
           "the valve's displacement from the beams', of its largest", unit="1", reference=0.0,
           computed=np.abs(found["valve"].displacement - x).max() / np.abs(x).max(), tolerance=allowed, absolute=True,
           reason="the mode at 67 Hz answers; two revolutions near its resonance")  # fmt: skip


@pytest.mark.parametrize("rpm", [1000.0, 3000.0, 5200.0])
def test_single_mass_matches_analytical_oscillator(rpm):
    """Mass, stiffness and response are analytical: ``M x'' + K x = K h/2 (1 - cos W t)`` from rest.

    The rod follows its ends; above it valve and rocker move by the ratio of rod and spring stiffness. The preload,
    which the installed spring balances, causes no displacement and excites no vibration.
    """
    case = read_case(ROOT / "cases/tayeb/model-1-shm.toml", [
        f"run.speed={rpm}rpm", "run.steps_per_revolution=3600", "run.revolutions=1", "fidelity.model=sdof",
    ])  # fmt: skip
    area, ratio = np.pi / 4.0 * (0.008**2 - 0.005**2), 40.0 / 25.0
    rod, spring, head = 207e9 * area / 0.25, ratio**2 * 40e3, ratio**2 * 0.1 + 1e-4 / 0.025**2
    share = rod / (rod + spring)
    M = 0.1 + head * share**2 + 7800.0 * area * 0.25 / 3.0 * (1.0 + share + share**2)
    own, driven = np.sqrt(share * spring / M), rpm * np.pi / 30.0
    found, r2 = run(case), (driven / own) ** 2
    moved = 0.003 * (1.0 - (np.cos(driven * found.time) - r2 * np.cos(own * found.time)) / (1.0 - r2))
    missed = found["valve"].displacement - ratio * share * moved
    # The period error of Newmark's method is (w dt)^2/12: at most 1e-5 over the four periods of a revolution at 1000
    # rpm.
    assert np.abs(missed).max() < 1e-4 * np.ptp(moved)
    assert abs(found["valve"].displacement[0]) < 1e-12


@pytest.mark.parametrize("sensed", [0, 1])
def test_condensation_preserves_contact_compliance(record, sensed):
    """The contact compliance includes camshaft and bearings, and the twist over the tilt."""
    case = read_case(ENGINE)
    rows, given = [], []
    for system in (prepare(case).problem.system, mass_chain(case, 2).system):
        force = next(one for one in system.local_forces if one.name == "contacts.intake")
        row = force.sense[0].vectors[sensed]
        given.append(row)
        rows.append(row @ np.linalg.lstsq(system.stiffness.dense(), row, rcond=1e-14)[0])
    quantity, unit = (("compliance along the lift", "m/N"), ("compliance of twist and tilt", "rad/(N m)"))[sensed]
    record(source=SOURCE, case="pushrod engine, 2 masses, at the cam's contact", quantity=quantity, unit=unit,
           reference=rows[0], computed=rows[1], tolerance=1e-6,
           reason="static condensation keeps what contacts sense")  # fmt: skip


def test_chain_of_engine_with_contact_matches_beams(record):
    """Camshaft, contact, lash and seat remain next to the chain, below the speeds of surge and bending."""
    case = read_case(ENGINE, ["run.crank_speed=2000rpm", "run.steps_per_revolution=1800", "run.engine=kernel"])
    ready, beams = prepare_mass_chain(case, 3), run(case)
    found = solve(ready.problem, ready.scheme, save=ready.save)
    assert found.status.ok
    assert ready.problem.system.size < 0.2 * prepare(case).problem.system.size
    lift = beams["valve"].displacement
    record(source=SOURCE, case="pushrod engine, 3 masses, 2000 crank rpm", quantity="largest difference of the valve's "
           "displacement from the beams', of its lift", unit="1", reference=0.0,
           computed=np.abs(found["valve"].displacement - lift).max() / np.ptp(lift), tolerance=1e-2, absolute=True,
           reason="surge of the spring and the pushrod's bow are left out")  # fmt: skip
    energy = found.channels["energy.residual"]
    assert np.abs(energy).max() < 1e-2 * np.abs(found.channels["energy.work"]).max()


def test_initial_state_of_chain(beam_model):
    """A given initial state is projected on the chain; rest and equilibrium are computed anew."""
    case = read_case(LI, ['run.start={ displacement = { "valve.uy" = "1 mm" }, velocity = { "tappet.uy" = 2 } }'])
    start = prepare_mass_chain(case, 3).problem.start
    np.testing.assert_allclose(start.displacement, [0.0, 0.0, 1e-3], atol=1e-15)
    np.testing.assert_allclose(start.velocity, [2.0, 0.0, 0.0], atol=1e-12)
    balanced = prepare_mass_chain(read_case(LI, ["run.start=equilibrium"]), 2)
    assert not balanced.problem.start.displacement.any()


@pytest.mark.parametrize("count", [0, 99])
def test_invalid_count_raises_error(beam_model, count):
    with pytest.raises(InputError, match="1 to"):
        mass_chain(beam_model[0], count)
