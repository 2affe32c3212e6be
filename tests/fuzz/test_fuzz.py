"""Changed inputs are accepted or refused with an error of flexcam; includes inputs that failed in the past."""

from contextlib import suppress
from random import Random

import pytest

from flexcam import FlexcamError
from flexcam.dynamics import RunFailedError
from tests.fuzz import damage, targets
from tests.fuzz.run import fuzz
from tests.thinning import mostly_slow

INPUTS = 60


def test_changed_inputs_are_accepted_or_refused():
    """A few inputs of each kind; `test_many_*.py` test the others."""
    found = fuzz(INPUTS, 2026, 1)
    assert not found.broken
    assert {name for name, _ in found.outcomes} == set(targets.TARGETS), "not all kinds of input were tested"


def test_slow_tests_have_20000_inputs():
    assert sum(target.share for target in targets.TARGETS.values()) == 20_000
    assert sorted(name for names in targets.GROUPS.values() for name in names) == sorted(targets.TARGETS)


@pytest.fixture(scope="module", autouse=True)
def seeds():
    """Write the valid binary files once."""
    targets.make_seeds()


@pytest.mark.parametrize("name", targets.TARGETS)
def test_valid_seeds_are_accepted(name, tmp_path):
    """Without this test the refusal of all inputs would pass."""
    target = targets.TARGETS[name]
    for seed in target.seeds[::10]:
        path = targets.copy_seed(seed, tmp_path)
        assert target.feed(path, Random(1)) == "accepted", seed


PAST_FAILURES = {
    "a whole number of 50000 digits": ("case", lambda text: text + "\nx = " + "9" * 50_000),
    "brackets without end": ("case", lambda text: text + "\nx = " + "[" * 50_000),
    "brackets, closed": ("case", lambda text: text + "\nx = " + "[" * 400 + "]" * 400),
    "dots without end": ("case", lambda text: text + "\n" + "a." * 400 + "a = 1"),
    "a key of 50000 parts": ("case", lambda text: text + "\n" + "a." * 50_000 + "a = 1"),
    "a point of a profile that is nan": ("profile", lambda text: text.replace("20.000000, 0.000000", "nan, 0")),
    "a lift without end": ("lift", lambda text: text.replace("0.007308", "inf")),
}


@pytest.mark.parametrize("what", PAST_FAILURES)
def test_texts_of_past_failures_are_refused(what, tmp_path):
    name, change = PAST_FAILURES[what]
    seed = targets.TARGETS[name].seeds[0]
    changed = change(seed.read_text(encoding="utf-8"))
    (tmp_path / seed.name).write_text(changed, encoding="utf-8")
    with pytest.raises(FlexcamError):
        targets.TARGETS[name].feed(tmp_path / seed.name, Random(1))


def test_tube_of_8_km_gives_rounding_status(tmp_path):
    """Relative to the tube the other stiffnesses vanish in floating point."""
    text = (targets.ROOT / "cases/tayeb/model-2-cycloidal.toml").read_text(encoding="utf-8")
    text = text.replace("../../meshes", str(targets.ROOT / "meshes")).replace(
        'outer_diameter = "8 mm"', "outer_diameter = 8e3"
    )
    (tmp_path / "tube.toml").write_text(text, encoding="utf-8")
    with pytest.raises(RunFailedError, match="rounding"):
        targets.case(tmp_path / "tube.toml", Random(1))


def test_mass_on_zero_stiffness_spring_is_handled(tmp_path):
    """The message about inactive unknowns named their member, but this mass is on no member."""
    text = (targets.ROOT / "cases/checks/mathieu.toml").read_text(encoding="utf-8").replace("10 kN/m", "0 kN/m")
    (tmp_path / "mathieu.toml").write_text(text, encoding="utf-8")
    assert targets.command(tmp_path / "mathieu.toml", Random(4)) in ("accepted", "failed")


@pytest.mark.parametrize("change", damage.STRUCTURE)
@pytest.mark.parametrize("kind", mostly_slow(["result", "table"], 2))
def test_changed_structure_is_refused_or_harmless(kind, change, tmp_path):
    """Each change at two places is refused, or the data equal the written ones."""
    target = targets.TARGETS[kind]
    for i in range(2):
        path = tmp_path / f"{i}-{target.seeds[0].name}"
        damage.change_structure(target.seeds[0], path, Random(i), change)
        with suppress(FlexcamError):
            target.feed(path, Random(i))
