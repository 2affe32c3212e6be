"""Names of the metrics of a train."""

from flexcam.fem.mesh import chain
from flexcam.valvetrain import Model, train_metric_names


def test_metric_of_member_named_like_channel():
    model = Model(chain((0, 0, 0), (1, 0, 0), 1), {})
    assert train_metric_names(model, ["members.house use.buckling_use"]) == ["members.house use.buckling_margin"]
