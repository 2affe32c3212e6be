"""The map of `flexcam limits` over two numbers of a case."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flexcam import study
from flexcam.case import CaseFile
from flexcam.checks import refuse
from flexcam.commands.answers import write_answer
from flexcam.commands.app import Overrides
from flexcam.commands.targets import free_targets
from flexcam.console.limit_map import axis_words, told_limit_map
from flexcam.limits import Search
from flexcam.response import Status
from flexcam.sweep import Axis, axis
from flexcam.sweep.validate import validated
from flexcam.terminal import counting
from flexcam.units import shaft_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def map_limits(
    path: Path, overrides: Overrides, settings: tuple[str | None, str | None], names: Sequence[str], search: Search,
    workers: int, csv: Path | None, plot: Path | None, *, overwrite: bool, as_json: bool,
) -> Status:  # fmt: skip
    """Map limits over two numbers of a case."""
    over, beside = settings
    if over is None or beside is None:
        given = "--over alone" if over else "--and alone" if beside else "--limit, --workers, --csv or --plot alone"
        raise refuse("limits", given, "--over KEY=SPEC and --and KEY=SPEC", "they belong to a map over two numbers")
    free_targets(csv, plot, path, overwrite=overwrite)
    file = CaseFile.opened(path)
    plan = study.grid_plan(_axis("--over", over), _axis("--and", beside), overrides or ())
    case = validated(file, plan)
    shaft = shaft_name(case.turns)
    asked = [f"limits.{name}" for name in names]
    with (
        counting(len(plan), "variants") as shown,
        study.evaluators(file, (), asked, search, workers=workers, runs=len(plan), advance=shown) as runs,
    ):
        kept = study.Kept(runs)
        found = study.limit_map(plan, names, kept).told_in(case)

    def draw() -> Figure:
        from flexcam.view import map_figure

        first, second = (np.array([value.number for value in one.values]) for one in found.axes)
        labels = [axis_words(one) for one in found.axes]
        return map_figure(second, first, found.rpm, (labels[1], labels[0]), shaft)

    write_answer((told_limit_map(found, shaft), draw), csv, plot, kept.status, overwrite=overwrite, as_json=as_json)
    return kept.status


def _axis(option: str, setting: str) -> Axis:
    key, equals, spec = setting.partition("=")
    if not equals:
        raise refuse(option, repr(setting), f"{option} KEY=SPEC, such as springs.valve.stiffness=40:70:5kN/m")
    if key.strip() in ("run.speed", "run.crank_speed"):
        why = "a limit is a speed, looked for from --lowest to --highest: that of the case has no part in it"
        raise refuse(option, key.strip(), "another number of the case", why, "vary a part")
    return axis(key.strip(), spec, where=f"{option} {setting}")
