"""Number of parts of springs with mass: rule against closed forms, user-defined numbers, and discretization error."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from flexcam import build_model, prepare, read_case
from flexcam.analysis.histories import distance
from flexcam.analysis.model_choice import estimate_errors, run_histories
from flexcam.cams import HarmonicLift
from flexcam.case.variants import with_elements
from flexcam.valvetrain import Spring, build_structure
from flexcam.valvetrain.springs import count_spring_parts, surge_frequency
from tests.thinning import mostly_slow

FINGER = Path("cases/direct-acting/finger.toml")
UP = np.eye(6)[1]
SPRING = Spring("valve", UP, stiffness=32e3, mass=0.04)
FAST = ['run.crank_speed="7000rpm"', "run.steps_per_revolution=720", "run.revolutions=1"]


@pytest.fixture
def case_without_parts(tmp_path):
    """Return the path of the finger case without the number of parts of its spring."""
    path = tmp_path / "finger.toml"
    text = FINGER.read_text(encoding="utf-8")
    path.write_text(text.replace("\nelements = 8\n", "\n"), encoding="utf-8")
    assert path.read_text(encoding="utf-8") != text
    return path


def test_frequency_error_of_four_parts_per_half_wave():
    """Bar fixed at both ends, p parts per half wave of its mode j: frequency error (pi/p)^2/24, to leading order."""
    for mode in (1, 2, 4):
        parts = 4 * mode
        inner = np.eye(parts - 1)
        off = np.eye(parts - 1, k=1) + np.eye(parts - 1, k=-1)
        stiffness, mass = parts * SPRING.stiffness, SPRING.mass / parts
        squares = eigh(stiffness * (2.0 * inner - off), mass / 6.0 * (4.0 * inner + off), eigvals_only=True)
        found = math.sqrt(squares[mode - 1]) / (2.0 * math.pi)
        error = found / (mode * surge_frequency(SPRING)) - 1.0
        assert error == pytest.approx((math.pi / 4.0) ** 2 / 24.0, rel=0.05)


@pytest.mark.parametrize(
    ("harmonic", "parts"), mostly_slow([(1, 4), (4, 4), (6, 6), (7, 7), (13, 13), (16, 16), (40, 16)])
)
def test_number_of_parts_for_single_harmonic(harmonic, parts):
    """At a quarter of the surge speed harmonic n has n/4 half waves in the spring, with four parts each."""
    speed = 2.0 * math.pi * surge_frequency(SPRING) / 4.0
    lift = HarmonicLift(5e-3, (*[0.0] * (harmonic - 1), 5e-3), (0.0,) * harmonic)
    assert count_spring_parts(SPRING, [lift], speed) == parts
    assert count_spring_parts(SPRING, [lift, HarmonicLift(1e-3, (1e-3,), (0.0,))], speed) == parts
    assert count_spring_parts(SPRING, [lift], 1e-3 * speed) == 4


def test_spring_without_surge_has_one_part():
    for spring in (Spring("valve", UP, 32e3), Spring("valve", UP, 0.0, mass=0.04)):
        assert count_spring_parts(spring, [], 100.0) == 1


def test_default_parts_of_springs_with_mass(case_without_parts):
    def parts(path, *overrides):
        return read_case(path, overrides).record.springs["valve"].elements

    assert [parts(case_without_parts, f'run.crank_speed="{n}rpm"') for n in (700, 3500, 7000)] == [4, 5, 16]
    assert [parts(case_without_parts, f"springs.valve.elements={n}") for n in (1, 3)] == [1, 3]
    assert parts(FINGER) == 8
    assert parts("cases/tayeb/model-1-shm.toml") == 1
    assert build_model(read_case(case_without_parts, FAST)).springs["valve"].elements == 16


@pytest.mark.slow
def test_default_parts_approximate_wave_equation(case_without_parts):
    """Cam and adjuster force within half a percent of the maximum with 32 parts; one part has an error of 14 %."""
    true = run_histories(read_case(case_without_parts, [*FAST, "springs.valve.elements=32"]), "valve")
    for overrides, most, least in (([], 5e-3, 0.0), (["springs.valve.elements=1"], 0.2, 0.1)):
        found = distance(run_histories(read_case(case_without_parts, [*FAST, *overrides]), "valve"), true)
        for name in ("force intake", "force adjuster"):
            assert least < found[name] / true.size(name) < most


@pytest.mark.slow
def test_error_estimate_covers_spring_with_one_part():
    case = read_case(FINGER, [*FAST, "springs.valve.elements=1"])
    finer = read_case(FINGER, [*FAST, "springs.valve.elements=16", "run.steps_per_revolution=1440"])
    true = distance(*(run_histories(one, "valve") for one in (case, finer)))
    for one in estimate_errors(case, "valve"):
        assert one.total >= true.get(one.quantity, 0.0)


def test_initial_state_of_spring_is_mapped_to_parts():
    """The initial state is interpolated linearly within the parts: 8 parts start as 2 do."""
    start = 'run.start={ displacement = { "valve" = "4 mm", "springs.valve.1" = "1 mm" }, velocity = {} }'
    case = read_case(FINGER, ["springs.valve.elements=2", start])
    finer = with_elements(case, factor=4)
    names, moved = build_structure(build_model(finer)).dofs.names, prepare(finer).problem.start.displacement
    along = [float(moved[names.index(f"springs.valve.{i}")]) for i in range(1, 8)]
    np.testing.assert_allclose(along, [0.25e-3, 0.5e-3, 0.75e-3, 1e-3, 1.75e-3, 2.5e-3, 3.25e-3], atol=1e-15)
