"""Jamming of a rigid follower: friction carries the complete force, and no contact force gives equilibrium."""

import pytest

from flexcam import InputError, build_model, read_case
from flexcam.valvetrain import build_rigid

FINGER = """
format = 1
nodes = {{ cam = [0.0, 0.0, 0.0] }}
supports = {{ cam = ["ux", "uy", "uz", "rx"] }}
masses.valve = {{ at = "valve", mass = "0.05 kg" }}
springs.valve = {{ at = "valve", direction = "-uz", stiffness = "30 kN/m", installed_force = "300 N" }}
[rockers.finger]
model = "lever"
from = "pad"
to = "valve"
direction = "-uz"
arms = ["24 mm", "36 mm"]
inertia = "1e-5 kg m^2"
stiffness = "100 MN/m"
[cams.intake]
at = "cam"
axis = [1, 0, 0]
law = "4-5-6-7"
lift = "6 deg"
rise = 1.4
return = 1.4
base_radius = "24 mm"
rotation = "{turn}"
follower = {{ type = "swing", arm = "24 mm", distance = "28 mm", rotation = "clockwise", face = "23 mm" }}
[contacts.intake]
cam = "intake"
follower = "pad"
direction = "-uz"
model = "unilateral"
stiffness = "1 GN/m"
friction = {friction}
[run]
speed = "60 rpm"
"""


@pytest.mark.parametrize(
    ("friction", "turn", "jams"),
    [(0.9, "counterclockwise", False), (1.6, "counterclockwise", True), (1.6, "clockwise", False)],
)
def test_follower_jams_by_friction(tmp_path, friction, turn, jams):
    """The contact force is that of the train over 1 - mu face/q at the distance q of the contact from the pivot."""
    path = tmp_path / "finger.toml"
    path.write_text(FINGER.format(friction=friction, turn=turn), encoding="utf-8")
    model = build_model(read_case(path))
    if not jams:
        assert build_rigid(model, 6.28).prescribed_motion is not None
        return
    with pytest.raises(InputError, match="Friction alone would hold the rigid follower"):
        build_rigid(model, 6.28)
