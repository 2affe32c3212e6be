"""Every command on engine cases: no traceback, and a run continued from a result equals the uninterrupted run."""

# ruff: noqa: E501 - tables, a row to a line

from pathlib import Path

import numpy as np
import pytest

from flexcam import read_result
from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
ENGINE = ROOT / "tests/data/every-engine.toml"
PUSHROD = ROOT / "cases/pushrod-engine/intake.toml"

LEVER = (
    '[rockers.rocker]\nmodel = "lever"\nfrom = "pushrod-top"\nto = "valve"\narms = ["25 mm", "40 mm"]\n'
    'angles = ["-8 deg", "-6 deg"]\ninertia = "6e-5 kg m^2"\nstiffness = "5 MN/m"\ndamping = "50 N s/m"\n'
)
LUMPED = (
    '[rockers.rocker]\nmodel = "lumped"\nfrom = "pushrod-top"\nto = "valve"\narms = ["25 mm", "40 mm"]\n'
    'inertia = "6e-5 kg m^2"\n'
)
LASH = 'lash = { at = "rocker", model = "lash", gap = "0.2 mm", stiffness = "20 MN/m", damping = "200 N s/m" }'
OIL = (
    'lash = { at = "rocker", model = "lash-adjuster", stiffness = "15 MN/m", leak = "100 kN s/m", '
    'refill = "200 N s/m", plunger_force = "20 N" }'
)
ENGINE_VARIANTS = {
    "adjuster": [(LASH, OIL)],
    "lever": [(LUMPED, LEVER)],
    "lever and adjuster": [(LUMPED, LEVER), (LASH, OIL)],
    "lever without play": [(LUMPED, LEVER), (LASH, "")],
    "bow": [('bow = "0.1 mm"', 'bow = "0.2 mm"')],
    "swinging speed": [("revolutions = 2", "revolutions = 2\nfluctuation = { orders = [2], amplitudes = [0.03] }")],
    "free running": [
        ("revolutions = 2", 'revolutions = 2\nfree_running = { cam = "intake", cam_mass = "2 kg", follower_mass = "0.1 kg" }'),
    ],
}  # fmt: skip


@pytest.fixture
def engine(tmp_path):
    """Return a function that writes the pushrod engine with replaced parts as NAME.toml to the working folder."""

    def write(name, *changes):
        text = PUSHROD.read_text(encoding="utf-8")
        for old, new in [*changes, ("elements = 8", "elements = 2")]:
            assert old in text, old
            text = text.replace(old, new, 1)
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
        return f"{name}.toml"

    return write


OPENING = (
    "--set",
    "run.steps_per_revolution=360",
    "--set",
    "run.revolutions=0.05",
    "--set",
    "cams.intake.phase=-20deg",
)
"""A few steps on the opening flank, where the train moves."""


@pytest.mark.slow
@pytest.mark.parametrize("variant", ENGINE_VARIANTS)
def test_restarted_run_equals_uninterrupted_run(variant, engine, flexcam, tmp_path):
    """Two halves of 0.1 revolutions on the opening flank; a step does not depend on the start of its run."""
    options = ("--set", "run.steps_per_revolution=720", "--set", "cams.intake.phase=0", "--set", "output.field_every=6")
    engine("whole", *ENGINE_VARIANTS[variant])
    engine("first", *ENGINE_VARIANTS[variant])
    engine("second", *ENGINE_VARIANTS[variant])
    second = (tmp_path / "second.toml").read_text(encoding="utf-8")
    (tmp_path / "second.toml").write_text(
        second.replace('start = "equilibrium"', 'start = { result = "out/first.vtkhdf" }'), encoding="utf-8"
    )
    for name, part in (("whole", 0.1), ("first", 0.05), ("second", 0.05)):
        done = flexcam("run", f"{name}.toml", "-o", "out", *options, "--set", f"run.revolutions={part}")
        assert done.code == 0, done.err
    uninterrupted, second = (read_result(tmp_path / f"out/{name}.vtkhdf").response for name in ("whole", "second"))
    assert second.time == pytest.approx(uninterrupted.time[36:], rel=1e-12)
    assert second.angle == pytest.approx(uninterrupted.angle[36:], rel=1e-9)
    pairs = {name: (uninterrupted[name].displacement, second[name].displacement) for name in ("valve", "tappet")}
    pairs |= {name: (values, second.channels[name]) for name, values in uninterrupted.channels.items()}
    for name, (expected, continued) in pairs.items():
        if not name.startswith("energy."):  # counted from the beginning of a run
            tolerance = 1e-9 * np.abs(expected).max()
            np.testing.assert_allclose(continued, expected[36:], rtol=0.0, atol=tolerance, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize(
    "variant", mostly_slow(["lever without play", "free running"], 2)
)  # the other parts are in every-engine.toml
def test_check_modes_and_compare_on_engine_variants(variant, engine, flexcam):
    case = engine("case", *ENGINE_VARIANTS[variant])
    options = (*OPENING, "--json")
    for verb in ("check", "modes", "compare"):
        done = flexcam(verb, case, *options)
        assert done.code == 0, f"{verb}: {done.err}"
        assert "NaN" not in done.out, verb
        assert done.json["status"]


@pytest.mark.slow
def test_commands_on_case_with_every_engine_part(flexcam, tmp_path):
    options = (*OPENING, "--set", "run.revolutions=0.02")
    for verb in ("check", "modes", "compare"):
        done = flexcam(verb, ENGINE, *options)
        assert done.code == 0, f"{verb}: {done.err}"
        assert " nan" not in done.out, verb
    assert flexcam("run", ENGINE, "-o", "out", *options).code == 0
    assert read_result(tmp_path / "out/every-engine.vtkhdf").response.status.ok
    exported = flexcam("export", "out/every-engine.vtkhdf", "--format", "pvd", "--json")
    assert exported.code == 0
    assert all((tmp_path / name).is_file() for name in exported.json["files"])


@pytest.mark.slow
def test_compare_with_finger_follower(flexcam):
    done = flexcam("compare", ENGINE, *OPENING, "--set", "cams.exhaust.phase=-20deg", "--set", "run.revolutions=0.02", "--set", 'output.probes=["exhaust"]', "--json")  # fmt: skip
    assert done.code == 0
    assert "NaN" not in done.out


@pytest.mark.slow
def test_result_without_adjuster_state_is_refused_as_start(engine, flexcam, tmp_path):
    options = ("--set", "run.revolutions=0.01", "--set", "run.steps_per_revolution=360")
    engine("first")
    engine("case", (LASH, OIL), ('start = "equilibrium"', 'start = { result = "out/first.vtkhdf" }'))
    assert flexcam("run", "first.toml", "-o", "out", *options).code == 0
    done = flexcam("run", "case.toml", "-o", "out", *options)
    assert done.code == 2
    assert "internal states" in done.err


@pytest.mark.slow
def test_result_of_lumped_rocker_is_refused_for_lever(engine, flexcam, tmp_path):
    options = ("--set", "run.revolutions=0.01", "--set", "run.steps_per_revolution=360")
    engine("first")
    engine("case", (LUMPED, LEVER), ('start = "equilibrium"', 'start = { result = "out/first.vtkhdf" }'))
    assert flexcam("run", "first.toml", "-o", "out", *options).code == 0
    done = flexcam("run", "case.toml", "-o", "out", *options)
    assert done.code == 2
    assert "rockers.rocker" in done.err


def test_initial_displacement_of_lever_is_length(engine, flexcam):
    case = engine("case", (LUMPED, LEVER), ('start = "equilibrium"', 'start = { displacement = { "rockers.rocker" = "1 um" } }'))  # fmt: skip
    done = flexcam("check", case)
    assert done.code == 0, done.err


def test_check_refuses_restitution_at_massless_node(engine, flexcam):
    case = engine(
        "case", ('valve = { at = "valve", mass = "0.09 kg" }\n', ""), ('mass = "60 g"\n', ""),
        ('damping = "1 kN s/m" }', 'restitution = 0.3 }'),
    )  # fmt: skip
    done = flexcam("check", case)
    assert done.code == 2
    assert "contacts.seat" in done.err


def test_compare_refuses_lever_arms_too_short_for_lift(engine, flexcam):
    case = engine("case", (LUMPED, LEVER.replace('"25 mm", "40 mm"', '"2.5 mm", "4 mm"')))
    done = flexcam("compare", case, "--set", "run.revolutions=0.5", "--set", "run.steps_per_revolution=360", "--json")
    assert done.code == 2
    assert done.json["errors"][0]["where"].startswith("rockers.rocker.arms")


@pytest.mark.slow
@pytest.mark.parametrize("words", [["cam"], ["synthesize", "polydyne", "--speed", "3000rpm", "-o", "lift.toml"]])
def test_cam_commands_with_finger_follower(words, flexcam):
    done = flexcam(*words, ENGINE, *(["--cam", "exhaust"] if len(words) > 1 else []))
    assert done.code == 0, done.err
