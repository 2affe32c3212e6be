"""Figures of what a train did in a run are named by what they belong to, whatever its name is."""

from __future__ import annotations

from flexcam.fem.mesh import chain
from flexcam.valvetrain import Model, train_metric_names


def test_a_name_that_holds_the_end_of_a_channel_stays_as_it_is():
    model = Model(chain((0, 0, 0), (1, 0, 0), 1), {})
    assert train_metric_names(model, ["members.house use.buckling_use"]) == ["members.house use.buckling_margin"]
