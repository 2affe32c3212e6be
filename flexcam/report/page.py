"""Report as one self-contained HTML page: text, data and scripts in one file without network access.

Jinja writes the page and escapes every value except flexcam's own scripts; plotly.js from the package plotly draws the
curves. The content security policy allows only scripts with a known hash, so that content of a case cannot be executed.
"""

from __future__ import annotations

import base64
import hashlib
import json
import pkgutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexcam import __version__, plotting
from flexcam.analysis.comparison import Comparison, compare_responses
from flexcam.analysis.preparation import scalar_probe
from flexcam.analysis.run_checks import RunMonitor, check_run
from flexcam.analysis.run_metrics import compute_margins, compute_metrics
from flexcam.case.input_checks import check_shared_seat_load
from flexcam.core.errors import FlexcamError, InputError, capitalize
from flexcam.core.units import RPM
from flexcam.dynamics import scalar_history, scalar_probes
from flexcam.report import content
from flexcam.report.content import Chapter, Picture, Report, ReportOptions, ReportSubject, report_table
from flexcam.report.figures import Runs, build_albums, scene
from flexcam.report.tables import info_table
from flexcam.report.terminal import make_unique
from flexcam.valvetrain import Metric

_PAGE = Path(__file__).parent / "template"
_LARGE = 5000.0  # absolute value above which single precision is insufficient for cam angles
_SINGLE = 1e37  # maximum of single precision; a diverged run exceeds it
_ESCAPED = str.maketrans({character: f"\\u{ord(character):04x}" for character in "<>&\u2028\u2029"})


def render_page(report: Report) -> str:
    """Return a report as HTML."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    def data_url(picture: Picture) -> str:
        return "data:image/png;base64," + base64.b64encode(picture.png).decode()

    trusted = Markup  # unescaped content: own scripts, and data escaped by `embed_json`
    plotly = (pkgutil.get_data("plotly", "package_data/plotly.min.js") or b"").decode()  # importing plotly takes long
    curves, shapes, style = ((_PAGE / name).read_text("utf-8") for name in ("curves.js", "shapes.js", "page.css"))
    scripts = [plotly, curves, shapes]
    jinja = Environment(loader=FileSystemLoader(_PAGE), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
                        lstrip_blocks=True)  # fmt: skip
    data = {"albums": report.albums, "scenes": [chapter.scene for chapter in report.chapters]}
    hashes = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    policy = f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:"
    return jinja.get_template("page.html").render(
        report=report, version=__version__, style=trusted(style), scripts=[trusted(script) for script in scripts],
        policy=policy, data=trusted(embed_json(data)), image=data_url,
    )  # fmt: skip


def embed_json(value: object) -> str:
    r"""Return a value as JSON that is safe inside a script element for any strings."""
    return json.dumps(value, allow_nan=False, default=_to_json).translate(_ESCAPED)


def _to_json(value: object) -> object:
    """Return an array packed, and a dataclass as a mapping of its fields."""
    return _numbers(np.asarray(value, dtype=float)) if isinstance(value, np.ndarray) else vars(value)


def _numbers(values: NDArray[np.float64]) -> Mapping[str, str]:
    """Return an array in the format of plotly.js: base64 of its bytes, in single precision if that is sufficient."""
    largest = float(np.abs(values).max(initial=0.0))
    increasing = values.ndim == 1 and bool((np.diff(values) >= 0.0).all())
    kind = "f8" if largest > _SINGLE or (largest > _LARGE and increasing) else "f4"
    return {"dtype": kind, "bdata": base64.b64encode(np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()).decode()}


def build_report(
    subjects: Sequence[ReportSubject], *, probe: str | None = None, asked: ReportOptions | None = None
) -> Report:
    """Return a report on results."""
    speeds = [subject.case.speed_text for subject in subjects]
    names = make_unique([subject.stem for subject in subjects], speeds) if len(subjects) > 1 else [""]
    mains = [_main_probe(subject, probe) for subject in subjects]
    chapters = tuple(
        _chapter(subject, name, main, asked or ReportOptions(), len(subjects))
        for subject, name, main in zip(subjects, names, mains, strict=True)
    )
    runs = {name: (subject.result.response, subject.rigid) for name, subject in zip(names, subjects, strict=True)}
    main = next(filter(None, mains), "")
    title = chapters[0].title if len(chapters) == 1 else ", ".join(names)
    albums, notes = build_albums(runs, main)
    return Report(title, chapters, tuple(albums), tuple(notes), _motion_image(runs, main))


def _main_probe(about: ReportSubject, probe: str | None) -> str:
    response = about.result.response
    saved = scalar_probes(response.outline)
    if probe is not None:
        scalar_history(response, probe)  # raises an error for a probe of several scalars
        return probe
    return scalar_probe(about.ready) if about.ready.model.probes else next(iter(saved), "")


def _chapter(about: ReportSubject, name: str, main: str, options: ReportOptions, share: int) -> Chapter:
    case, status = about.case, about.result.response.status
    figures = compute_metrics(about.ready, about.response)
    compared, lacking = _compare_rigid(about, main)
    sentences, sheets, pictures = (
        content.additional_content(case, main, options) if status.ok and main else ([], [], [])
    )
    warnings = [] if status.ok else [f"The run did not reach its end. {status}"]
    if len(about.response.time):
        warnings += _warnings(about, figures)
    result = replace(about.result, response=about.response)
    summary = content.describe_model(about, figures)
    with suppress(FlexcamError):  # without static equilibrium at full lift there are no margins; the run has the reason
        summary += content.describe_margins(compute_margins(case), case.turns)
    return Chapter(
        name=name,
        title=f"{case.record.title or about.stem}, {case.speed_text}",
        verdict=tuple(content.describe_verdict(compared)) if compared and status.ok else (),
        summary=(*summary, *sentences),
        warnings=(*warnings, *about.lacking, *lacking),
        sheets=(*sheets, *content.result_tables(about, compared, figures)),
        pictures=tuple(pictures),
        scene=scene(about, share),
        case=case.text,
        origin=replace(report_table(info_table(result)), title="The result file"),
    )


def _warnings(about: ReportSubject, figures: list[Metric]) -> list[str]:
    """Return the warnings without the prefix, for a list with the title of warnings."""
    monitor = RunMonitor.from_response(about.ready, about.response)
    warnings = check_run(about.ready, monitor, figures, about.response.stats)
    warnings += check_shared_seat_load(about.ready.model) if about.rigid is not None else []
    sentences = [warning.removeprefix("Warning: ") for warning in warnings]
    return [f"{capitalize(sentence)}." for sentence in sentences]


def _compare_rigid(about: ReportSubject, main: str) -> tuple[Comparison | None, list[str]]:
    """Return the comparison of a result with its rigid train, or the reason why there is none."""
    if about.rigid is None or not main:
        return None, []
    why = f"nothing moves {main} in it: run a whole revolution, or name a point that the cam moves under output.probes."
    if np.ptp(about.rigid[main].displacement):
        try:
            names = ("flexible", "rigid")
            return compare_responses(about.result.response, about.rigid, main, about.case.speed / RPM, names), []
        except InputError as refusal:
            why = str(refusal)
    return None, [f"Not in this report: the comparison with a rigid train; {why}"]


def _motion_image(runs: Runs, main: str) -> Picture | None:
    drawn = {name: run for name, (run, _) in runs.items() if len(run.time) and main in scalar_probes(run.outline)}
    if not drawn:
        return None
    rigid = {name: run for name, (_, run) in runs.items() if name in drawn and run is not None}
    forces = plotting.histories.contact_forces(next(iter(drawn.values())))
    common = [name for name in forces if all(name in run.channels for run in drawn.values())]
    figure = plotting.histories.motion_figure(drawn, main, common[:1], rigid=rigid)
    words = f"Displacement, velocity and acceleration of {main} over the cam angle; the text below describes it."
    return Picture(f"Motion of {main}", plotting.figures.render_png(figure), words)
