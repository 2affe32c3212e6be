"""Journal of the finished rows of a sweep, and the table of all rows.

The journal has a line of JSON per chunk, so that an interrupted sweep can be resumed; its first line identifies the
plan. An incomplete last line after a crash is removed. Numbers are written so that reading them is exact.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.core.errors import InputError, refuse, system_message
from flexcam.dynamics import Cause, Status
from flexcam.io import create_folder, open_with_lock
from flexcam.io.sweep_table import Column, SweepTable
from flexcam.studies.plan import Plan, Row
from flexcam.studies.variables import column


def make_table(plan: Plan, rows: Sequence[Row], about: Mapping[str, str] | None = None) -> SweepTable:
    """Return the table of a plan."""
    inputs: list[Column] = []
    for axis, values in zip(plan.varied_axes, zip(*plan.points, strict=True), strict=True):
        if axis.is_numeric:
            inputs.append(Column(axis.key, axis.unit, np.array([value.number for value in values], dtype=float)))
        else:
            inputs.append(Column(axis.key, "", tuple(value.text for value in values)))
    units = {name: unit for row in reversed(rows) for name, unit in row.units.items()}
    names = list(dict.fromkeys(name for row in rows for name in row.scalars))
    scalars = {name: column(rows, name) for name in names}
    shape = plan.shape if plan.sample is None else ()
    statuses = tuple(row.status for row in rows)
    return SweepTable(tuple(inputs), scalars, {name: units[name] for name in names}, statuses, shape, about or {})


_WORDS = {  # the facts that identify a journal
    "format": "the format of the progress file",
    "flexcam": "the version of flexcam",
    "case": "the case, or a file it names",
    "plan": "the keys, their values, or how they are sampled",
    "histories": "whether histories are kept",
    "frequencies": "the natural frequencies among the results",
    "channels": "whether scalars other than those of the probes are computed",
}


class Journal:
    """Journal of a sweep, open for further rows.

    `belongs` identifies the sweep; `rows` are those in the journal, by the index of their chunk.
    """

    def __init__(
        self, path: Path, belongs: Mapping[str, Any], *, resume: bool = False, overwrite: bool = False
    ) -> None:
        if path.exists() and not (resume or overwrite):
            why, remedy = "a sweep was begun here", "--resume finishes it, --overwrite starts again"
            raise refuse("progress file", str(path), "none, or --resume", why, remedy)
        create_folder(path.parent)
        self._path, self._head, self._fresh = path, dict(belongs), True
        try:
            self._file = open_with_lock(path)
        except BlockingIOError:
            allowed, why = "one that no other process writes", "another sweep is running here"
            raise refuse("progress file", str(path), allowed, why, "wait for it") from None
        except OSError as fault:
            raise refuse("progress file", str(path), "a file that can be written", system_message(fault)) from None
        try:
            self.rows, self._end = _read_journal(path, belongs) if resume else (dict[int, list[Row]](), 0)
        except InputError:
            self.close()
            raise

    def add(self, index: int, rows: Sequence[Row]) -> None:
        """Append the rows of a chunk and flush them to disk."""
        if self._fresh:  # an existing file is kept until there are new rows
            os.ftruncate(self._file, self._end)
            os.lseek(self._file, self._end, os.SEEK_SET)
            self._fresh = False
            if not self._end:
                self._line(self._head)
        units = {name: unit for row in rows for name, unit in row.units.items()}
        texts = [
            {
                "cause": str(row.status.cause), "text": row.status.text, "remedy": row.status.remedy,
                "scalars": dict(row.scalars), "seconds": round(row.seconds, 3),
            }
            for row in rows
        ]  # fmt: skip
        self._line({"chunk": index, "units": units, "rows": texts})
        self.rows[index] = list(rows)

    def close(self) -> None:
        """Close the file; an empty journal is removed."""
        if not os.fstat(self._file).st_size:
            self._path.unlink(missing_ok=True)
        os.close(self._file)

    def _line(self, content: Mapping[str, Any]) -> None:
        data = (json.dumps({**content, "digest": _line_digest(content)}, allow_nan=False) + "\n").encode()
        while data:
            data = data[os.write(self._file, data) :]
        os.fsync(self._file)


def _line_digest(content: Mapping[str, Any]) -> str:
    """Return the checksum of a line of a journal; reading and writing JSON again gives the same text."""
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def journal_contains(path: Path, fact: str) -> bool:
    """Return whether an existing journal contains a given fact in its identification."""
    try:
        with path.open("rb") as file:
            return json.loads(file.readline())[fact] is True
    except (OSError, ValueError, KeyError, TypeError):
        return False


_START_AGAIN = "leave out --resume and use --overwrite to start again"


def _read_journal(path: Path, belongs: Mapping[str, Any]) -> tuple[dict[int, list[Row]], int]:
    """Return the rows of a journal, and the length of its complete lines in bytes."""
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    lines = content[:end].splitlines()
    if not lines:
        return {}, 0
    try:
        head, *chunks = contents = [json.loads(line) for line in lines]
        if any(entry.pop("digest", "") != _line_digest(entry) for entry in contents):
            raise ValueError("a line has changed since it was written")
        differences = [words for name, words in _WORDS.items() if head.get(name) != belongs.get(name)]
        if differences:
            why = f"{path} belongs to another sweep; what differs: {'; '.join(differences)}"
            raise refuse("progress file", str(path), "", why, f"{_START_AGAIN}, or name another folder")
        return {int(c["chunk"]): [_parse_row(row, c["units"]) for row in c["rows"]] for c in chunks}, end
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError) as fault:
        why = f"it is damaged: {fault}"
        raise refuse("progress file", str(path), "the progress of a sweep", why, _START_AGAIN) from None


def _parse_row(raw: Mapping[str, Any], units: Mapping[str, str]) -> Row:
    status, scalars = Status(Cause(raw["cause"]), raw["text"], raw["remedy"]), raw["scalars"]
    return Row(status, scalars, {name: units[name] for name in scalars}, raw["seconds"])
