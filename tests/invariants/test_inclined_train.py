"""A pushrod train inclined by 45 deg with stiff guide springs moves as the upright train with supports."""

import math
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, read_case, run
from flexcam.case.input_checks import check_oblique_springs

PATH = Path(__file__).parents[2] / "cases/pushrod-engine/intake.toml"
HALF = math.sqrt(0.5)
ALONG, ACROSS, ABOUT = [0, HALF, HALF], [0, -HALF, HALF], [0, 0, 0, 0, HALF, HALF]
GUIDES = {
    "tappet-guide": f'at = "tappet"\ndirection = {ACROSS}\nstiffness = "1 GN/m"',
    "top-guide": f'at = "pushrod-top"\ndirection = {ACROSS}\nstiffness = "1 GN/m"',
    "tappet-key": f'at = "tappet"\ndirection = {ABOUT}\nstiffness = "1 MN m/rad"',
}
CHANGES = {
    '"24 mm", "0 mm"]': f"{0.024 * HALF}, {0.024 * HALF}]", '"274 mm", "0 mm"]': f"{0.274 * HALF}, {0.274 * HALF}]",
    'tappet = ["ux", "uz", "ry", "rx"]': 'tappet = ["ux", "rx"]', 'pushrod-top = ["ux", "uz"]': 'pushrod-top = ["ux"]',
    "\n[springs.tappet]": "".join(f"\n[springs.{name}]\n{keys}\n" for name, keys in GUIDES.items())
    + "\n[springs.tappet]",
}  # fmt: skip
WORDS = "run.revolutions=0.4", "run.steps_per_revolution=1800"


@pytest.fixture
def inclined_path(tmp_path):
    text = PATH.read_text(encoding="utf-8")
    for old, new in CHANGES.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "inclined.toml").write_text(text, encoding="utf-8")
    return tmp_path / "inclined.toml"


@pytest.mark.parametrize(("model", "tolerance"), [pytest.param("beams", 2e-3, marks=pytest.mark.slow), ("rigid", 1e-6)])
def test_inclined_train_matches_upright_train(inclined_path, model, tolerance):
    """Guides of 1 GN/m deflect by less than a thousandth of the motion of the pushrod."""
    lines = [f"springs.{name}.direction={ALONG}" for name in ("valve", "tappet")]
    cases = ((PATH, WORDS), (inclined_path, [*WORDS, *lines]))
    runs = [run(read_case(path, [*words, f"fidelity.model={model}"])) for path, words in cases]
    for read in (lambda one: one["valve"].displacement, lambda one: one.channels["contacts.intake.force"]):
        upright, bank = (read(one) for one in runs)
        np.testing.assert_allclose(bank, upright, atol=tolerance * np.abs(upright).max())


def test_oblique_spring_at_rocker_causes_warning(inclined_path):
    (warning,) = check_oblique_springs(build_model(read_case(inclined_path)))
    assert "springs.valve: its direction is at 45 deg" in warning
    assert "[0.0, 0.7071, 0.7071]" in warning
    assert not list(check_oblique_springs(build_model(read_case(PATH))))


def test_oblique_support_error_suggests_spring(inclined_path):
    with pytest.raises(InputError, match="stiff spring with this direction"):
        read_case(inclined_path, ['supports.tappet=["ux", [0, 1, -1]]'])
