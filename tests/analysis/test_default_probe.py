"""The probe that stands for a case is one that a cam moves, along the way it moves it."""

from __future__ import annotations

import pytest

from flexcam import prepare, read_case
from flexcam.analysis.preparation import driven_probe, scalar_probe
from flexcam.core.errors import InputError
from tests.thinning import mostly_slow

CAMSHAFT, BUCKET = "cases/camshaft-4cyl/camshaft.toml", "cases/direct-acting/bucket.toml"
ENGINE = "cases/pushrod-engine/intake.toml"


@pytest.mark.parametrize(
    ("path", "probes", "wanted"),
    mostly_slow(
        [
            (CAMSHAFT, '["sprocket", "intake-4", "intake-4-follower"]', "intake-4-follower.uy"),
            (CAMSHAFT, '["sprocket", "intake-4"]', "sprocket.uy"),
            (BUCKET, '["cam", "head"]', "head.uy"),
            (ENGINE, '["cam", "tappet", "valve"]', "valve"),
            (ENGINE, '["cam", "tappet"]', "tappet.uy"),
            ("cases/checks/cantilever.toml", '["tip"]', "tip.ux"),
        ],
        2,
    ),
)
def test_the_probe_that_stands_for_a_case(path, probes, wanted):
    """A rocker's point, else what a cam moves; where no cam moves any, the first."""
    assert scalar_probe(prepare(read_case(path, [f"output.probes={probes}"]))) == wanted


def test_a_valve_that_opens_downwards_has_a_positive_lift(tmp_path):
    found = driven_probe(prepare(read_case("flexcam/templates/measured-lift.toml")))
    assert (found.component, found.sign, found.contact) == ("retainer.uy", -1.0, "intake")
    assert driven_probe(prepare(read_case(ENGINE)), "valve").sign == 1.0


def test_a_case_without_probes_has_none():
    with pytest.raises(InputError, match="at least one point"):
        scalar_probe(prepare(read_case(ENGINE, ["output.probes=[]"])))


def test_a_held_component_stands_for_no_case():
    """The tip of the cantilever is held along x and swings along y."""
    case = read_case("cases/checks/cantilever.toml", ['output.probes=["tip"]', 'supports.tip=["ux"]'])
    assert scalar_probe(prepare(case)) == "tip.uy"
