"""The default probe of a case is at a point that a cam moves, along its motion."""

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
            (BUCKET, '["cam", "head"]', "head.uy"),
            (CAMSHAFT, '["sprocket", "intake-4", "intake-4-follower"]', "intake-4-follower.uy"),
            (ENGINE, '["cam", "tappet"]', "tappet.uy"),
            (CAMSHAFT, '["sprocket", "intake-4"]', "sprocket.uy"),
            (ENGINE, '["cam", "tappet", "valve"]', "valve"),
            ("cases/checks/cantilever.toml", '["tip"]', "tip.ux"),
        ],
        2,
    ),
)
def test_default_probe(path, probes, wanted):
    """A rocker's point, else a point that a cam moves, else the first probe."""
    assert scalar_probe(prepare(read_case(path, [f"output.probes={probes}"]))) == wanted


def test_lift_of_downward_opening_valve_is_positive(tmp_path):
    found = driven_probe(prepare(read_case("flexcam/templates/measured-lift.toml")))
    assert (found.component, found.sign, found.contact) == ("retainer.uy", -1.0, "intake")
    assert driven_probe(prepare(read_case(ENGINE)), "valve").sign == 1.0


def test_case_without_probes_raises_error():
    with pytest.raises(InputError, match="at least one point"):
        scalar_probe(prepare(read_case(ENGINE, ["output.probes=[]"])))


def test_supported_component_is_not_default_probe():
    """The tip of the cantilever is supported along x and vibrates along y."""
    case = read_case("cases/checks/cantilever.toml", ['output.probes=["tip"]', 'supports.tip=["ux"]'])
    assert scalar_probe(prepare(case)) == "tip.uy"
