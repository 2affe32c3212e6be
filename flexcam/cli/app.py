"""Shared parts of the commands: application, options, reading of cases, checks of files, ignored keys.

`COMMANDS` lists the commands, `IGNORED_KEYS` the keys of a case that some of them ignore; a new command needs a row in
the first, and in the second if it does not use every key.
"""

from __future__ import annotations

import math
import os
import platform
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import wraps
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np
from cyclopts import App, Parameter

from flexcam import __version__, plotting
from flexcam.analysis.preparation import prepare_without_periodic_search
from flexcam.analysis.run_checks import check_input
from flexcam.case.case import Case
from flexcam.case.fault_report import parse_toml
from flexcam.case.input_checks import check_values
from flexcam.case.reader import read_case
from flexcam.core.errors import Fault, FlexcamError, InputError, collect_errors, refuse
from flexcam.core.units import RPM, UnitSystem, parse, set_unit_system
from flexcam.dynamics import Cause, Status
from flexcam.io import check_writable, write_text
from flexcam.report.terminal import print_json, print_message, result_console

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

# Commands by panel of the help, each with its file in this package
COMMANDS: Mapping[str, Mapping[str, str]] = {
    "Cases and runs": {
        "new": "case_files", "check": "case_files", "run": "run", "info": "result_files", "compare": "compare",
    },
    "Pictures and files": {"plot": "plot", "view": "result_files", "report": "result_files", "export": "result_files"},
    "Dynamics": {"modes": "modes", "stability": "limits", "limits": "limits", "campbell": "modes"},
    "Cams": {"law": "law", "cam": "cam", "synthesize": "synthesize"},
    "Studies": {
        "sweep": "sweep", "optimize": "optimize", "fit": "fit", "sensitivity": "sensitivity", "trade": "compare",
    },
    "Reference": {"selftest": "case_files", "schema": "case_files"},
}  # fmt: skip

COMMAND_FILES = {command: file for panel in COMMANDS.values() for command, file in panel.items()}
_MAX_SPEEDS = 10_000
_BARE = re.compile(r"\s*[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?\s*$")  # a number without unit
_TIME_UNITS = {"h": 3600.0, "min": 60.0, "s": 1.0, "ms": 1e-3}
_PART_OF_TIME = r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(h|min|ms|s)\s*"
_ACCURACY, _MODEL = ("tolerance", "estimate"), ("model", "masses", "modes", "reduction")
# Keys of [fidelity] that some commands ignore: the commands, the keys, and what the commands do instead
IGNORED_KEYS = (
    (("campbell", "compare", "limits", "plot", "stability", "view"), (*_ACCURACY, "norm"),
     "only flexcam run chooses a model and estimates errors; name the model by fidelity.model"),
    (("sensitivity", "optimize", "fit"), ("estimate",), "it estimates no errors of its runs"),
    (("trade",), (*_MODEL, *_ACCURACY), "it compares every model of the ladder with a converged one"),
    (("modes", "synthesize"), (*_MODEL, *_ACCURACY, "norm"),
     "natural modes are those of all degrees of freedom of the members"),
)  # fmt: skip


@dataclass
class RunState:
    """State shared by the signal handler and the current run, and the current command."""

    command: str = ""
    signals: list[int] = field(default_factory=list[int])
    solving: bool = False


run_state = RunState()

DEFAULT_PROBE = (
    "default: the valve end of a rocker, if listed in output.probes; otherwise the first listed point that a cam moves"
)
Probe = Annotated[str | None, Parameter(
    help="Valve end of a rocker (valve), or a component of another point (tappet.uy); "
    f"{DEFAULT_PROBE}.")]  # fmt: skip
CaseFile = Annotated[Path, Parameter(help="Case file (.toml).")]
Overrides = Annotated[
    list[str] | None, Parameter("--set", help="Override a value of the case, such as run.speed=4000rpm. Repeatable.")
]
Json = Annotated[bool, Parameter("--json", help="Print one JSON object instead of tables.")]
Units = Annotated[UnitSystem | None, Parameter("--units", help="Units shown, metric by default; messages stay metric.")]
Picture = Annotated[Path | None, Parameter("--plot", help="Also draw a figure to this file (.svg, .png or .pdf).")]
Csv = Annotated[Path | None, Parameter("--csv", help="Also write a table to this file (.csv).")]
Folder = Annotated[Path, Parameter(["-o", "--output"], help="Folder of the results.")]
Overwrite = Annotated[bool, Parameter("--overwrite", help="Replace existing files.")]
AllowLarge = Annotated[bool, Parameter("--allow-large", help="Run even if memory or disk space seem too small.")]
CamName = Annotated[str | None, Parameter("--cam", help="Name of the cam, if the case has several.")]
Lowest = Annotated[
    str | None, Parameter("--lowest", help="Lowest speed, such as 1000rpm; half the speed of the case by default.")
]
Highest = Annotated[
    str | None, Parameter("--highest", help="Highest speed; 1.5 times the speed of the case by default.")
]
HighestOfSearch = Annotated[
    str | None, Parameter("--highest", help="Highest speed; twice the speed of the case by default.")
]
Accuracy = Annotated[str, Parameter("--accuracy", help="Accuracy of the computed speeds.")]
Count = Annotated[int, Parameter("--count", help="Number of speeds, evenly spaced.")]


def _versions() -> str:
    packages = (f"{name} {version(name)}" for name in ("numpy", "scipy", "h5py", "meshio", "pydantic", "cyclopts"))
    return "\n".join([f"flexcam {__version__}", f"python {platform.python_version()}", *packages])


app = App(
    name="flexcam",
    version=_versions,
    help_format="plaintext",
    default_parameter=Parameter(negative=()),
    help="Simulate flexible valve trains and cam mechanisms by finite elements.",
    help_prologue="""\
flexcam new pushrod-engine -o engine.toml
flexcam check engine.toml
flexcam run engine.toml -o results --set run.crank_speed=4000rpm
flexcam plot results/engine.vtkhdf
flexcam compare engine.toml
""",
    suppress_keyboard_interrupt=False,
)
app.register_install_completion_command()  # pyright: ignore[reportUnknownMemberType]


def parse_quantity(where: str, text: str, dimension: str, unit: str) -> float:
    """Return the SI number of an option; a number without a unit is rejected, because it could be mistaken for SI."""
    if _BARE.match(text) and float(text) != 0.0:
        allowed = f"a number with its unit, such as '{text.strip()} {unit}'"
        raise refuse(where, text, allowed, "the unit is missing", f"write '{text.strip()} {unit}'")
    return parse(text, dimension, where, plain=False)


def parse_optional(where: str, text: str | None, dimension: str, unit: str) -> float | None:
    """Return the SI number of an option; None if it is not given."""
    return None if text is None else parse_quantity(where, text, dimension, unit)


def parse_duration(where: str, text: str) -> float:
    """Return a duration such as ``5min30s``, s."""
    parts: list[tuple[str, str]] = re.findall(_PART_OF_TIME, text)
    seconds = sum(float(number) * _TIME_UNITS[unit] for number, unit in parts)
    if not re.fullmatch(f"(?:{_PART_OF_TIME})+", text) or not 0.0 < seconds < math.inf:
        allowed = "a time above zero with its unit (h, min, s or ms), such as 90s, 5min30s or 2h"
        why = "the unit is missing" if _BARE.match(text) else ""
        raise refuse(where, text or "nothing", allowed, why, "write a time, or leave the option out")
    return seconds


def load_case(path: Path, overrides: Sequence[str] | None) -> Case:
    """Read a case with the overrides of ``--set``, and report keys that the command ignores."""
    case = read_case(path, overrides or ())
    warn_ignored_keys(overrides, case)
    return case


def warn_ignored_keys(overrides: Sequence[str] | None, case: Case | None = None) -> None:
    """Report the keys that the current command ignores; for a file of cams, only the overrides."""
    pairs, command = overrides or (), run_state.command
    keys = [pair.partition("=")[0].strip() for pair in pairs]
    for i, key in enumerate(keys):
        if (last := len(keys) - 1 - keys[::-1].index(key)) != i:
            print_message(f"Note: --set {pairs[i]} has no effect: --set {pairs[last]} replaces it; leave one out")
    if case is not None and "run.speed" in keys and "crank_speed" in parse_toml(case.text).get("run", {}):
        crank = f"the crankshaft turns at {2.0 * case.speed / RPM:.6g} rpm"
        text = f"replaces run.crank_speed: run.speed is the speed of the camshaft; {crank}"
        print_message(f"Note: --set {pairs[keys.index('run.speed')]} {text}")
    given = {} if case is None else case.record.fidelity.model_dump(exclude_unset=True, exclude_defaults=True)
    for commands, ignored, why in IGNORED_KEYS:
        if case is not None and command in commands and (changed := [key for key in ignored if key in given]):
            places, has = [case.place(("fidelity", key)) for key in changed], "has" if len(changed) == 1 else "have"
            print_message(f"Note: {', '.join(places)} {has} no effect in {command}: {why}")


def warn_input(case: Case, *others: Case, integrates: bool = True) -> None:
    """Print the warnings of ``flexcam check`` about a case before its runs, and about values of other variants."""
    with suppress(FlexcamError):  # of a case that cannot be prepared: the command reports it
        warnings = check_input(prepare_without_periodic_search(case), integrates=integrates)
        for warning in dict.fromkeys([*warnings, *(text for other in others for text in check_values(other))]):
            print_message(warning)


def load_beams(path: Path, overrides: Sequence[str] | None) -> Case:
    """Read a case for a command that requires its beams; raise an error if it requests a coarser model."""
    case = load_case(path, overrides)
    for key, allowed in (("model", "beams"), ("modes", None)):
        if (value := getattr(case.record.fidelity, key)) != allowed:
            why, remedy = "this command needs all degrees of freedom of the members", f"leave fidelity.{key} out"
            raise refuse(case.place(("fidelity", key)), str(value), "beams with all degrees of freedom", why, remedy)
    return case


def check_number(option: str, number: int | None, low: int = 1, high: float = math.inf, why: str = "") -> None:
    """Raise an error if a number is outside of its range; None is an option not given."""
    if number is not None and not low <= number <= high:
        allowed = f"at least {low}" if math.isinf(high) else f"from {low} to {high}"
        raise refuse(option, number, f"a whole number{',' * math.isinf(high)} {allowed}", why)


def refuse_options(options: Mapping[str, object], why: str) -> None:
    """Raise an error for options that have no effect; None and False are options not given."""
    for option, value in options.items():
        if value is not None and value is not False:
            values = cast("list[object]", value) if isinstance(value, list) else [value]
            raise refuse(option, ", ".join(map(str, values)), "", why, f"leave {option} out")


def refuse_without(required: str, options: Mapping[str, object], *, present: bool) -> None:
    """Raise an error for options that have no effect without another one."""
    if not present:
        refuse_options(options, f"it applies only with {required}")


def _speed_range(lowest: str | None, highest: str | None, case: Case, most: float) -> tuple[float, float]:
    """Return the range of camshaft speeds of a command, rad/s; by default half to `most` times the case's speed."""
    speed, scale = case.speed, case.turns
    low = 0.5 * speed if lowest is None else parse_quantity("--lowest", lowest, "speed", "rpm") / scale
    high = most * speed if highest is None else parse_quantity("--highest", highest, "speed", "rpm") / scale
    if not high > low:
        text, why = highest or f"{scale * high / RPM:g} rpm", f"the default is {most:g} times the speed of the case"
        why, remedy = ("", "") if highest else (why, "give --highest")
        raise refuse("--highest", text, f"a speed above the lowest, {scale * low / RPM:g} rpm", why, remedy)
    if not low > 0.0:
        raise refuse("--lowest", lowest, "a speed above zero")
    return low, high


def spaced_speeds(lowest: str | None, highest: str | None, count: int, case: Case) -> list[float]:
    """Return evenly spaced camshaft speeds of the range of a command, rad/s, without rounding errors in rpm."""
    check_number("--count", count, 2, _MAX_SPEEDS, "a curve over speed needs several speeds")
    unit = RPM / case.turns
    low, high = _speed_range(lowest, highest, case, 1.5)
    return [float(f"{speed / unit:.12g}") * unit for speed in np.linspace(low, high, count).tolist()]


def joint_status(statuses: Sequence[Status], what: str) -> Status:
    """Return the status of a command over speeds or variants, which failed if it completed none of them."""
    if any(status.ok for status in statuses):
        return Status()
    first = statuses[0]
    remedy = "allow more time" if first.cause is Cause.TIME_LIMIT else first.remedy
    return Status(first.cause, f"none of {len(statuses)} {what} was completed; the first: {first.text}", remedy)


def search_range(lowest: str | None, highest: str | None, accuracy: str, case: Case) -> tuple[float, float, float]:
    """Return the lowest and highest speed of a search for speed limits and its accuracy, rad/s."""
    low, high = _speed_range(lowest, highest, case, 2.0)
    width = parse_quantity("--accuracy", accuracy, "speed", "rpm") / case.turns
    if not width > 0.0:
        why = "the search halves the interval until it is this narrow"
        raise refuse("--accuracy", accuracy, "a speed above zero", why)
    return low, high, width


def check_distinct_files(written: Mapping[str, Path | None], read: Sequence[Path] = ()) -> None:
    """Raise an error if output files coincide with each other or with an input file, regardless of overwriting."""
    owners = {os.path.realpath(path): "the input" for path in read}
    faults: list[Fault] = []
    for option, path in written.items():
        if path is not None and (other := owners.setdefault(os.path.realpath(path), option)) != option:
            why = "it would be lost" if other == "the input" else "one would replace the other"
            faults.append(Fault(option, str(path), f"a file other than {other}", why, "name another file"))
    if faults:
        raise InputError(faults)


def check_targets(
    csv: Path | None, plot: Path | None, *read: Path, overwrite: bool, target: Path | None = None
) -> None:
    """Raise an error if a table, a figure or a case cannot be written, before a computation."""

    def check_case() -> None:
        if target is not None:
            check_writable("output", target, overwrite=overwrite)
            if target.suffix != ".toml":
                raise refuse("--output", str(target), "a name that ends in .toml", "the output is a case file")

    collect_errors(
        lambda: check_distinct_files({"--output": target, "--csv": csv, "--plot": plot}, read),
        lambda: None if csv is None else check_writable("output", csv, overwrite=overwrite),
        lambda: None if plot is None else plotting.figures.check_figure_path(plot, overwrite=overwrite),
        check_case,
    )


def describe_lift_file(path: Path, phase: float = 0.0) -> str:
    """Return the name of a lift file, and the keys of a case with which it replaces the lift of a cam."""
    delay = f', phase = "{math.degrees(phase):.10g} deg"' if phase else ""
    keys = "law, return_law, lift, rise, dwell, return, ramps, phase, centreline and timing"
    return f'{path}  (in the case, replace {keys} with: lift_table = "{path.name}"{delay})'


@dataclass(frozen=True)
class CommandOutput:
    """Output of a command."""

    parts: Sequence[Table | str]  # tables and sentences, printed with empty lines between them
    json: Mapping[str, object]  # content as one JSON object; null for missing numbers
    csv: str = ""  # content as CSV text for --csv
    draw: Callable[[], Figure] | None = None  # function that draws the figure for --plot
    title: str = ""  # title of the figure
    files: Sequence[Path] = ()  # further files that the command wrote
    describe_file: Callable[[Path], str] = str  # text that names a file
    status: Status = field(default_factory=Status)  # status of the command, also in its JSON
    text: str = ""  # text printed last, with its own lines

    def figure(self) -> Figure:
        """Return the figure with its title."""
        if self.draw is None:
            raise NotImplementedError
        return plotting.figures.add_title(self.draw(), self.title)


def command(
    examples: str, *, group: App = app
) -> Callable[[Callable[..., CommandOutput | None]], Callable[..., Status | None]]:
    """Register a function as a command, whose output is written as its --csv, --plot, --overwrite and --json ask."""

    def register(function: Callable[..., CommandOutput | None]) -> Callable[..., Status | None]:
        @wraps(function)
        def execute(*arguments: object, **keywords: object) -> Status | None:
            options = cast("Mapping[str, Any]", keywords)
            set_unit_system(options.get("units") or "metric")
            output = function(*arguments, **options)
            if output is None:  # printed by the command itself
                return None
            files, overwrite = list[Path](), options.get("overwrite", False)
            if csv := options.get("csv"):
                files.append(write_text(csv, output.csv, overwrite=overwrite))
            if output.draw and (picture := options.get("plot")):  # `cam` and `synthesize` save their own
                files.append(plotting.figures.save_figure(output.figure(), picture, overwrite=overwrite))
            files += output.files
            if options.get("as_json"):
                status = "ok" if output.status.ok else output.status.cause
                print_json({"status": status, **output.json, "files": output.json.get("files", files)})
                return output.status
            for i, part in enumerate(output.parts):
                result_console().print(*([""] if i else []), part, sep="\n")
            for path in files:
                result_console().print(output.describe_file(path))
            if output.text:
                result_console().print(output.text, soft_wrap=True)
            return output.status

        group.command(execute, help_prologue=examples)
        return execute

    return register
