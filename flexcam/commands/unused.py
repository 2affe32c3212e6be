"""Keys of a case that a command does not act on: told where a user gave them, for silence would pass for an answer.

`UNUSED` is the one table of them; a new command, or a new key that not every command knows, is a row of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from flexcam.case import Case
from flexcam.case.tables.base import Record

__all__ = ["UNUSED", "Unused", "unused"]


@dataclass(frozen=True)
class Unused:
    """Keys that some commands do not act on.

    Parameters
    ----------
    commands
        Their names.
    keys
        Of the case, or tables of it.
    why
        What the commands do instead.
    remedy
        What to do.
    laid
        Whether only a key laid over the case by ``--set`` is told. A file is written for every command: its run is
        nothing to tell where no run is asked for. What is laid over is meant for the one command.
    but
        Keys below `keys` on which they do act.
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
_LEAVE = "leave it out"

UNUSED = (
    Unused(
        ("campbell", "compare", "limits", "orders", "parting", "plot", "stability", "view"),
        (*_ACCURACY, *_NORM),
        "it takes the model as the case names it",
        "flexcam run chooses a model and estimates errors; name its choice by fidelity.model",
    ),
    Unused(("sensitivity", "optimize"), ("fidelity.estimate",), "it asks many runs for numbers alone", _LEAVE),
    Unused(
        ("trade",), (*_MODEL, *_ACCURACY), "it runs every model of the ladder against a converged one",
        "flexcam run acts on it",
    ),
    Unused(
        ("modes", "synthesize"),
        (*_MODEL, *_ACCURACY, *_NORM),
        "natural modes are those of all unknowns of the members",
        _LEAVE,
    ),
    Unused(("cam", "settings"), (*_MODEL, *_ACCURACY, *_NORM), "closed forms need no model of the train", _LEAVE),
    Unused(
        ("modes",), ("run", "output"), "natural modes need no run", _LEAVE, laid=True,
        but=(*_SPEEDS, "run.gravity", "run.fluctuation", "run.free_running"),
    ),
    Unused(
        ("cam", "settings"), ("run", "output"), "closed forms need no run", _LEAVE, laid=True,
        but=(*_SPEEDS, "run.free_running"),
    ),
    Unused(
        ("cam",), ("springs", "masses", "loads", "materials", "sections", "bearings"),
        "it looks at the cams alone", _LEAVE, laid=True,
    ),
    Unused(("limits",), ("run.revolutions",), "it runs a few revolutions at each speed", _LEAVE, laid=True),
)  # fmt: skip
"""What no command may pass over in silence."""

_TELLS = ("check", "run")
"""Commands that tell it with everything else that is doubtful about a case."""

_OWN = {"paper": "compare", "settings": "settings", "sweep": "sweep"}
"""Tables that are there for one command."""


def unused(command: str, overrides: Sequence[str], case: Case | None = None) -> list[str]:
    """Return what a command does not act on of what a user gave, in words."""
    laid = [one.partition("=")[0].strip() for one in overrides]
    twice = [
        f"Note: --set {one} has no part: --set {overrides[last]} is laid over it; leave one out"
        for i, one in enumerate(overrides)
        if (last := len(laid) - 1 - laid[::-1].index(laid[i])) != i
    ]
    found: dict[tuple[str, str], list[str]] = {}
    for row in UNUSED:
        if command in row.commands:
            told = [f"{key} (--set)" for key in laid if _below(key, row.keys) and not _below(key, row.but)]
            told = told if row.laid or case is None else [case.place(key) for key in _given(case, row.keys)]
            found.setdefault((row.why, row.remedy), []).extend(told)
    sentences = [_sentence(keys, command, *reason) for reason, keys in found.items() if keys]
    return [*twice, *sentences, *_of_others(command, laid), *_idle(command, case)]


def _sentence(keys: Sequence[str], command: str, why: str, remedy: str) -> str:
    return f"Note: {', '.join(keys)} {'has' if len(keys) == 1 else 'have'} no part in {command}: {why}; {remedy}"


def _below(key: str, above: Sequence[str]) -> bool:
    """Tell whether a key is one of some keys, or stands below one."""
    return any(key == one or key.startswith(f"{one}.") for one in above)


def _given(case: Case, keys: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the keys, each of a table of the case, that were given other values than they have by default."""
    for table, name in (key.split(".") for key in keys):
        record: Record = getattr(case.record, table)
        default: object = type(record).model_fields[name].default
        if name in record.model_fields_set and getattr(record, name) != default:
            yield table, name


def _of_others(command: str, laid: Sequence[str]) -> Iterator[str]:
    """Yield what is laid over the table of another command."""
    for key in laid:
        its = _OWN.get(key.partition(".")[0])
        if its not in (None, command) and command != "check":
            yield _sentence([f"{key} (--set)"], command, f"that table is for flexcam {its}", _LEAVE)


def _idle(command: str, case: Case | None) -> Iterator[str]:
    """Yield keys that another key of the same case leaves without a part, whatever is asked."""
    if (
        case is None
        or command in _TELLS
        or any(command in row.commands and "fidelity.masses" in row.keys for row in UNUSED)
    ):
        return
    if case.record.fidelity.model != "chain" and (given := list(_given(case, ["fidelity.masses"]))):
        why = f"they are those of a chain, and the model is {case.record.fidelity.model}"
        yield _sentence([case.place(key) for key in given], "this case", why, 'give fidelity.model = "chain"')
