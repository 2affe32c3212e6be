"""What endangers a speed, each cause by its own test, on the published model and the engine."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "cases/tayeb/model-3-shm.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
QUICK = ("--set", "run.steps_per_revolution=360")


@pytest.mark.parametrize(("rpm", "verdict"), [(1000, []), (2000, []), (4000, ["resonance"])])
def test_published_claim(flexcam, rpm, verdict):
    """Unstable at 4000 rpm, says the paper: it is the loaded mode at 67.11 Hz = 4027 rpm, met by the first harmonic."""
    found = flexcam("stability", PUBLISHED, "--set", f"run.speed={rpm}rpm", *QUICK, "--json").json
    assert found["verdict"] == verdict
    assert found["resonances"][0]["rpm"] == pytest.approx(4026.9, abs=0.1)
    assert found["resonances"][0]["harmonic"] == 1
    assert abs(complex(*found["multipliers"][0])) == pytest.approx(1.0, abs=1e-6)  # undamped


def test_a_step_too_long_for_the_integrator(flexcam):
    told = ("--set", "run.integrator={method='newmark',beta=0.1667}", *QUICK)
    found = flexcam("stability", PUBLISHED, "--set", "run.speed=1000rpm", *told, "--json").json
    assert found["spectral_radius"] > 1.0
    assert "numerical" in found["verdict"]


def test_contact_lost(flexcam):
    found = flexcam(
        "stability", ENGINE, "--set", "run.crank_speed=7000rpm", "--set", "run.revolutions=1", *QUICK, "--json"
    )
    assert "contact loss" in found.json["verdict"]
    assert "off the cam" in flexcam("stability", PUBLISHED, *QUICK).out
