"""From results to a report: what is said of each, put together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from flexcam import fidelity
from flexcam.case import Case
from flexcam.checks import FlexcamError, InputError, refuse
from flexcam.console.doubts import run_doubts
from flexcam.console.watched import Watched
from flexcam.console.words import told_apart
from flexcam.fidelity import Comparison
from flexcam.limits import margins
from flexcam.report import words
from flexcam.report.content import Chapter, Picture, Report
from flexcam.report.curves import Runs, albums, left_over, scalars
from flexcam.report.extras import Asked, extras
from flexcam.report.scene import scene
from flexcam.report.sheets import origin, sheets
from flexcam.report.subject import Known, Subject
from flexcam.runner import figures_of, scalar_probe
from flexcam.train import Figure
from flexcam.units import RPM
from flexcam.untold import shared


def report_of(subjects: Sequence[Subject], *, probe: str | None = None, asked: Asked | None = None) -> Report:
    """Return a report on results."""
    names = _names(subjects)
    mains = [_main(one, probe) for one in subjects]
    chapters = tuple(
        _chapter(one, name, main, asked or Asked(), len(subjects))
        for one, name, main in zip(subjects, names, mains, strict=True)
    )
    runs = {name: (one.result.response, one.rigid) for name, one in zip(names, subjects, strict=True)}
    main = next(filter(None, mains), "")
    title = chapters[0].title if len(chapters) == 1 else ", ".join(names)
    return Report(title, chapters, tuple(albums(runs, main)), tuple(left_over(runs)), _still(runs, main))


def _names(subjects: Sequence[Subject]) -> list[str]:
    """Return what tells results apart: nothing for a single one."""
    speeds = [one.known.case.told_speed if one.known else "" for one in subjects]
    return told_apart([one.stem for one in subjects], speeds) if len(subjects) > 1 else [""]


def _main(about: Subject, probe: str | None) -> str:
    """Return the probe that stands for a result; empty where it has none."""
    response = about.result.response
    saved = scalars(response.outline)
    if probe is not None:
        history = response[probe]
        if history.displacement.ndim != 1:
            raise refuse("probe", repr(probe), "one scalar: " + ", ".join(f"{probe}.{c}" for c in history.components))
        return probe
    if about.known is None or not about.known.ready.model.probes:
        return next(iter(saved), "")
    return scalar_probe(about.known.ready)


def _chapter(about: Subject, name: str, main: str, asked: Asked, share: int) -> Chapter:
    kept, known, status = about.result.about, about.known, about.result.response.status
    title = kept.get("title", "") or about.stem
    ended = [] if status.ok else [f"The run did not reach its end. {status}"]
    if known is None:
        return Chapter(
            name, title, (), (), (*ended, *about.lacking), tuple(sheets(about, None, [])), (), scene(about, share),
            kept.get("case", ""), origin(about),
        )  # fmt: skip
    figures = figures_of(known.ready, known.response)
    compared, lacking = _compared(about, known, main)
    more = extras(known.case, main, asked) if status.ok and main else []
    summary = [*words.modelled(about, known, figures), *_in_hand(known.case)]
    doubts = _doubts(known, figures, drawn_rigid=about.rigid is not None) if len(known.response.time) else []
    return Chapter(
        name=name,
        title=f"{title}, {known.case.told_speed}",
        verdict=tuple(words.verdict(compared)) if compared and status.ok else (),
        summary=(*summary, *chain.from_iterable(one.sentences for one in more)),
        warnings=(*ended, *doubts, *about.lacking, *lacking),
        sheets=(*chain.from_iterable(one.sheets for one in more), *sheets(about, compared, figures)),
        pictures=tuple(chain.from_iterable(one.pictures for one in more)),
        scene=scene(about, share),
        case=known.case.text,
        origin=origin(about),
    )


def _doubts(known: Known, figures: list[Figure], *, drawn_rigid: bool) -> list[str]:
    """Return what is doubtful, in a place that says already that these are warnings."""
    watched = Watched.again(known.ready, known.response)
    found = run_doubts(known.ready, watched, figures, known.response.stats)
    found += shared(known.ready.model, known.case.speed) if drawn_rigid else []
    told = [one.removeprefix("Warning: ") for one in found]
    return [f"{one[:1].upper()}{one[1:]}." for one in told]


def _compared(about: Subject, known: Known, main: str) -> tuple[Comparison | None, list[str]]:
    """Return a result against its rigid train, or why that cannot be."""
    if about.rigid is None or not main:
        return None, []
    if not np.ptp(about.rigid[main].displacement):
        remedy = "name a point that the cam moves under output.probes"
        return None, [f"Not in this report: the comparison with a rigid train; nothing moves {main} in it: {remedy}."]
    try:
        speed = known.case.speed / RPM
        return fidelity.between(about.result.response, about.rigid, main, speed, ("flexible", "rigid")), []
    except InputError as refusal:
        return None, [f"Not in this report: the comparison with a rigid train; {refusal}"]


def _in_hand(case: Case) -> list[str]:
    try:
        return words.left_in_hand(margins(case), case.turns)
    except FlexcamError:  # a train without balance at full lift has nothing in hand; its run says why
        return []


def _still(runs: Runs, main: str) -> Picture | None:
    """Return the motion of the main probe as a picture."""
    moved = {name: pair for name, pair in runs.items() if len(pair[0].time) and main in scalars(pair[0].outline)}
    if not moved:
        return None
    from flexcam.view import contact_forces, motion_figure, png_of

    own = {name: one for name, (one, _) in moved.items()}
    rigid = {name: one for name, (_, one) in moved.items() if one is not None}
    common = [
        name for name in contact_forces(next(iter(own.values()))) if all(name in one.channels for one in own.values())
    ]
    figure = motion_figure(own, main, common[:1], rigid=rigid)
    words = f"Displacement, velocity and acceleration of {main} over the cam angle; the page says it in words below."
    return Picture(f"Motion of {main}", png_of(figure), words)
