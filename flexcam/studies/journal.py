"""Journal of finished rows: a line of JSON per chunk, so that an interrupted sweep can be resumed.

The first line identifies the plan. Only lines with a line end count; an incomplete last line after a crash is removed.
Numbers are written so that reading them is exact.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from flexcam.core.errors import InputError, refuse, system_message
from flexcam.dynamics import Cause, Status
from flexcam.io import create_folder, lock_file
from flexcam.studies.evaluation import Row

_WORDS = {
    "format": "the format of the journal",
    "flexcam": "the version of flexcam",
    "case": "the case, or a file it names",
    "plan": "the keys, their values, or how they are sampled",
    "histories": "whether histories are kept",
    "channels": "whether scalars beside those of the probes are computed",
}
"""Descriptions of the facts that identify a journal."""


class Journal:
    """Journal of a sweep, open for further rows.

    Parameters
    ----------
    path
        ``.jsonl`` file; its folder is created if necessary.
    belongs
        Identification of the sweep: values by name.
    resume
        Whether to resume an existing journal.
    overwrite
        Whether to replace an existing journal.

    Attributes
    ----------
    rows
        Rows read from an existing journal, by chunk index.
    """

    def __init__(
        self, path: Path, belongs: Mapping[str, Any], *, resume: bool = False, overwrite: bool = False
    ) -> None:
        if path.exists() and not (resume or overwrite):
            why, remedy = "a sweep was begun here", "--resume finishes it, --overwrite begins anew"
            raise refuse("journal", str(path), "none, or --resume", why, remedy)
        create_folder(path.parent)
        self._path, self._head, self._fresh = path, dict(belongs), True
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as fault:
            raise refuse("journal", str(path), "a file that can be written", system_message(fault)) from None
        try:
            _lock(self._file, path)
            self.rows, self._end = _read(path, belongs) if resume else (dict[int, list[Row]](), 0)
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
        self._line({"chunk": index, "units": units, "rows": [_format_identification(row) for row in rows]})

    def close(self) -> None:
        """Close the file; an empty journal is removed."""
        if not os.fstat(self._file).st_size:
            self._path.unlink(missing_ok=True)
        os.close(self._file)

    def _line(self, content: Mapping[str, Any]) -> None:
        left = (json.dumps(content, allow_nan=False) + "\n").encode()
        while left:
            left = left[os.write(self._file, left) :]
        os.fsync(self._file)


def journal_contains(path: Path, fact: str) -> bool:
    """Return whether an existing journal contains a given fact in its identification."""
    try:
        with path.open("rb") as file:
            return json.loads(file.readline())[fact] is True
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _lock(file: int, path: Path) -> None:
    """Lock the journal; raise an error if another sweep has locked it. The lock ends with the process."""
    try:
        lock_file(file)
    except BlockingIOError:
        raise refuse(
            "journal", str(path), "one that nobody writes", "another sweep is running here", "wait for it"
        ) from None


def _read(path: Path, belongs: Mapping[str, Any]) -> tuple[dict[int, list[Row]], int]:
    """Return the rows of a journal, and the length of its complete lines in bytes."""
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    lines = content[:end].splitlines()
    if not lines:
        return {}, 0
    try:
        head, *chunks = [json.loads(line) for line in lines]
        _check_identification(path, head, belongs)
        return {int(one["chunk"]): [_row(row, one["units"]) for row in one["rows"]] for one in chunks}, end
    except (ValueError, KeyError, TypeError, AttributeError) as fault:
        if isinstance(fault, InputError):
            raise
        raise refuse(
            "journal", str(path), "the journal of a sweep", f"it is damaged: {fault}", "--overwrite begins anew"
        ) from None


def _check_identification(path: Path, head: Mapping[str, Any], belongs: Mapping[str, Any]) -> None:
    other = [words for name, words in _WORDS.items() if head.get(name) != belongs.get(name)]
    if other:
        given = f"{path}, of another sweep"
        why = f"what differs: {'; '.join(other)}"
        raise refuse(
            "journal", given, "the journal of this sweep", why, "--overwrite begins anew, -o names another folder"
        )


def _format_identification(row: Row) -> dict[str, Any]:
    status = row.status
    told: dict[str, Any] = {"cause": str(status.cause), "text": status.text, "remedy": status.remedy}
    return {**told, "scalars": dict(row.scalars), "seconds": round(row.seconds, 3)}


def _row(told: Mapping[str, Any], units: Mapping[str, str]) -> Row:
    status, scalars = Status(Cause(told["cause"]), told["text"], told["remedy"]), told["scalars"]
    return Row(status, scalars, {name: units[name] for name in scalars}, told["seconds"])
