"""Shared parts of the commands: application, signals, reading of cases, and keys that a command ignores.

`IGNORED_KEYS` lists the ignored keys; a new command, or a key that not every command uses, needs a row in it.
"""

from __future__ import annotations

import platform
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from flexcam import __version__
from flexcam.case.case import Case
from flexcam.case.reader import read_case
from flexcam.case.schema.base import Record
from flexcam.core.errors import refuse
from flexcam.core.units import RPM, parse
from flexcam.report.terminal import print_message


@dataclass(frozen=True)
class IgnoredKeys:
    """Keys that some commands ignore.

    Parameters
    ----------
    commands
        Names of the commands.
    keys
        Keys of the case, or its tables.
    why
        Behaviour of the commands instead.
    remedy
        Suggested action.
    laid
        Whether only keys set by ``--set`` are reported. A file is written for all commands, so its unused keys are not
        reported; an override is intended for the current command.
    but
        Exceptions below `keys` that the commands use.
    """

    commands: tuple[str, ...]
    keys: tuple[str, ...]
    why: str
    remedy: str
    laid: bool = False
    but: tuple[str, ...] = ()


_ACCURACY = ("fidelity.tolerance", "fidelity.estimate")
_MODEL = ("fidelity.model", "fidelity.masses", "fidelity.modes", "fidelity.reduction")
_NORM = ("fidelity.norm",)
_SPEEDS = ("run.speed", "run.crank_speed")
_OMIT_REMEDY = "leave it out"

IGNORED_KEYS = (
    IgnoredKeys(
        ("campbell", "compare", "limits", "orders", "parting", "plot", "stability", "view"),
        (*_ACCURACY, *_NORM),
        "it takes the model as the case names it",
        "flexcam run chooses a model and estimates errors; name its choice by fidelity.model",
    ),
    IgnoredKeys(
        ("sensitivity", "optimize"), ("fidelity.estimate",), "it asks many runs for numbers alone", _OMIT_REMEDY
    ),
    IgnoredKeys(
        ("trade",),
        (*_MODEL, *_ACCURACY),
        "it runs every model of the ladder against a converged one",
        "flexcam run acts on it",
    ),
    IgnoredKeys(
        ("modes", "synthesize"),
        (*_MODEL, *_ACCURACY, *_NORM),
        "natural modes are those of all unknowns of the members",
        _OMIT_REMEDY,
    ),
    IgnoredKeys(
        ("cam", "settings"), (*_MODEL, *_ACCURACY, *_NORM), "closed forms need no model of the train", _OMIT_REMEDY
    ),
    IgnoredKeys(
        ("modes",),
        ("run", "output"),
        "natural modes need no run",
        _OMIT_REMEDY,
        laid=True,
        but=(*_SPEEDS, "run.gravity", "run.fluctuation", "run.free_running"),
    ),
    IgnoredKeys(
        ("cam", "settings"),
        ("run", "output"),
        "closed forms need no run",
        _OMIT_REMEDY,
        laid=True,
        but=(*_SPEEDS, "run.free_running"),
    ),
    IgnoredKeys(
        ("cam",),
        ("springs", "masses", "loads", "materials", "sections", "bearings"),
        "it looks at the cams alone",
        _OMIT_REMEDY,
        laid=True,
    ),
    IgnoredKeys(("limits",), ("run.revolutions",), "it runs a few revolutions at each speed", _OMIT_REMEDY, laid=True),
)
"""Ignored keys by command."""

_REPORTING_COMMANDS = ("check", "run")
"""Commands that report ignored keys with their other warnings."""

_COMMAND_TABLES = {"paper": "compare", "settings": "settings", "sweep": "sweep"}
"""Tables used by a single command."""


def ignored_key_warnings(command: str, overrides: Sequence[str], case: Case | None = None) -> list[str]:
    """Return messages about the given keys that a command ignores."""
    laid = [one.partition("=")[0].strip() for one in overrides]
    twice = [
        f"Note: --set {one} has no part: --set {overrides[last]} is laid over it; leave one out"
        for i, one in enumerate(overrides)
        if (last := len(laid) - 1 - laid[::-1].index(laid[i])) != i
    ]
    found: dict[tuple[str, str], list[str]] = {}
    for row in IGNORED_KEYS:
        if command in row.commands:
            told = [f"{key} (--set)" for key in laid if _is_below(key, row.keys) and not _is_below(key, row.but)]
            told = told if row.laid or case is None else [case.place(key) for key in _changed_keys(case, row.keys)]
            found.setdefault((row.why, row.remedy), []).extend(told)
    sentences = [_sentence(keys, command, *reason) for reason, keys in found.items() if keys]
    return [*twice, *sentences, *_other_command_overrides(command, laid), *_ineffective_keys(command, case)]


def _sentence(keys: Sequence[str], command: str, why: str, remedy: str) -> str:
    return f"Note: {', '.join(keys)} {'has' if len(keys) == 1 else 'have'} no part in {command}: {why}; {remedy}"


def _is_below(key: str, above: Sequence[str]) -> bool:
    """Return whether a key equals or is below one of several keys."""
    return any(key == one or key.startswith(f"{one}.") for one in above)


def _changed_keys(case: Case, keys: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the keys of a table of the case with values other than their defaults."""
    for table, name in (key.split(".") for key in keys):
        record: Record = getattr(case.record, table)
        default: object = type(record).model_fields[name].default
        if name in record.model_fields_set and getattr(record, name) != default:
            yield table, name


def _other_command_overrides(command: str, laid: Sequence[str]) -> Iterator[str]:
    """Yield the overrides of tables of other commands."""
    for key in laid:
        its = _COMMAND_TABLES.get(key.partition(".")[0])
        if its not in (None, command) and command != "check":
            yield _sentence([f"{key} (--set)"], command, f"that table is for flexcam {its}", _OMIT_REMEDY)


def _ineffective_keys(command: str, case: Case | None) -> Iterator[str]:
    """Yield the keys without effect because of another key of the case."""
    if (
        case is None
        or command in _REPORTING_COMMANDS
        or any(command in row.commands and "fidelity.masses" in row.keys for row in IGNORED_KEYS)
    ):
        return
    if case.record.fidelity.model != "chain" and (given := list(_changed_keys(case, ["fidelity.masses"]))):
        why = f"they are those of a chain, and the model is {case.record.fidelity.model}"
        yield _sentence([case.place(key) for key in given], "this case", why, 'give fidelity.model = "chain"')


@dataclass
class RunState:
    """State shared by the signal handler and the current run, and the current command."""

    command: str = ""
    signals: list[int] = field(default_factory=list[int])
    solving: bool = False

    def is_stopped(self) -> bool:
        """Return whether a signal requested the end of the run."""
        return bool(self.signals)


run_state = RunState()

CaseFile = Annotated[Path, Parameter(help="Case file (TOML).")]
ResultPath = Annotated[Path, Parameter(help="Result file (.vtkhdf).")]
Overrides = Annotated[
    list[str] | None,
    Parameter("--set", negative=(), help="Lay a value over the case's: run.speed=4000rpm. May be repeated."),
]
Json = Annotated[bool, Parameter("--json", negative=(), help="Print one JSON object.")]
Picture = Annotated[Path | None, Parameter("--plot", help="Also draw it (.svg, .png or .pdf).")]
Folder = Annotated[Path, Parameter(["-o", "--output"], help="Folder of the results.")]
Overwrite = Annotated[bool, Parameter("--overwrite", negative=(), help="Replace existing results.")]
AllowLarge = Annotated[
    bool, Parameter("--allow-large", negative=(), help="Run even if memory or disk seem too small for it.")
]


def _versions() -> str:
    runs_on = ("numpy", "scipy", "h5py", "meshio", "pydantic", "cyclopts")
    return f"flexcam {__version__}\npython {platform.python_version()}\n" + "\n".join(
        f"{n} {version(n)}" for n in runs_on
    )


app = App(
    name="flexcam",
    version=_versions,
    help_format="plaintext",
    help="Flexible valve trains and cam mechanisms by finite elements.",
    help_prologue="""\
flexcam check cases/tayeb/model-3-shm.toml
flexcam compare cases/tayeb/model-3-shm.toml --set run.speed=4000rpm
flexcam run cases/tayeb/model-3-shm.toml -o results
flexcam export results/model-3-shm.vtkhdf --format pvd
""",
    suppress_keyboard_interrupt=False,
)
app.register_install_completion_command()  # pyright: ignore[reportUnknownMemberType]


_BARE = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*$")


def parse_quantity(where: str, text: str, dimension: str, unit: str) -> float:
    """Return the SI number of an option; a number without a unit is rejected, because it could be mistaken for SI."""
    if _BARE.match(text) and float(text) != 0.0:
        allowed = f"a number with its unit, such as '{text.strip()} {unit}'"
        raise refuse(where, text, allowed, "a bare number could be anything", f"write '{text.strip()} {unit}'")
    return parse(text, dimension, where)


def load_case(path: Path, overrides: Sequence[str] | None) -> Case:
    """Read a case with the overrides of ``--set``, and report keys that the command ignores."""
    case = read_case(path, overrides or ())
    warn_ignored_keys(overrides, case)
    return case


def warn_ignored_keys(overrides: Sequence[str] | None, case: Case | None = None) -> None:
    """Report the keys that the current command ignores; for a file of cams, only the overrides."""
    for sentence in ignored_key_warnings(run_state.command, overrides or (), case):
        print_message(sentence)


def load_beams(path: Path, overrides: Sequence[str] | None) -> Case:
    """Read a case for a command that requires its beams; raise an error if it requests a coarser model."""
    case = load_case(path, overrides)
    asked = case.record.fidelity
    for key, given, allowed in (("model", asked.model, "beams"), ("modes", asked.modes, None)):
        if given != allowed:
            why, remedy = "this is asked of all unknowns of the members", f"leave fidelity.{key} out"
            raise refuse(case.place(("fidelity", key)), str(given), "beams with every unknown", why, remedy)
    return case


def check_positive(option: str, number: int) -> None:
    """Raise an error if a number is less than 1."""
    if number < 1:
        raise refuse(option, number, "a whole number from 1")


_MOST_SPEEDS = 10_000


def speed_range(
    lowest: str | None, highest: str | None, count: int, speed: float, scale: float, most: float = 1.5
) -> tuple[float, float]:
    """Return the range of camshaft speeds of a command, rad/s; by default half to `most` times the case's speed."""
    if not 2 <= count <= _MOST_SPEEDS:
        raise refuse("--count", count, f"a whole number from 2 to {_MOST_SPEEDS}", "each speed is a run")
    low = 0.5 * speed if lowest is None else parse_quantity("--lowest", lowest, "speed", "rpm") / scale
    high = most * speed if highest is None else parse_quantity("--highest", highest, "speed", "rpm") / scale
    if not high > low:
        given = highest or f"{scale * high / RPM:g} rpm, {most:g} times that of the case"
        raise refuse("--highest", given, f"above the lowest speed, {scale * low / RPM:g} rpm")
    if not low > 0.0:
        raise refuse("--lowest", lowest, "a speed above zero")
    return low, high


def parse_speed_tolerance(option: str, text: str, scale: float) -> float:
    """Return the tolerance of a speed search, of the camshaft in rad/s."""
    width = parse_quantity(option, text, "speed", "rpm") / scale
    if not width > 0.0:
        raise refuse(option, text, "a speed above zero", "a bracket is halved until it is as narrow")
    return width


def check_figure_path(plot: Path | None, overwrite: bool) -> None:
    """Raise an error if a figure cannot be written, before a computation."""
    if plot is not None:
        from flexcam.plotting.figures import check_figure_path

        check_figure_path(plot, overwrite=overwrite)
