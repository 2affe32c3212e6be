"""Records of the public interfaces of flexcam: the command line, its JSON and its result files.

No internal module is imported, so that records remain comparable after a rewrite of the package.
"""

from __future__ import annotations

import gc
import io
import json
import math
import os
import re
import runpy
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from hashlib import sha256
from pathlib import Path
from unittest import mock

import h5py
import numpy as np

Record = dict[str, object]
"""Quantity to a word, an integer, or a row of numbers: maximum, minimum, root mean square, samples."""

FULL, LIGHT, BARE = 28, 4, 0
"""Samples of a history: main run of a model, same run with another engine, and run without histories."""

DROPPED = {
    "seconds", "message", "remedy", "text", "result", "files", "file", "title", "about", "given", "allowed", "why",
    "memory_bytes", "result_bytes", "bytes", "cpu_seconds", "time", "times", "measured_seconds", "case",
    "multipliers", "reached", "installed", "rounding", "figures_of_merit",
}  # fmt: skip
"""Keys of JSON whose values are prose, paths, versions or times, or in an order that depends on rounding; figures of
merit are also in `train`."""

COUNTED = {"warnings", "doubts", "notes", "left_out", "sentences"}
"""Keys of JSON whose values are lists of sentences: only their number is recorded."""

ROUNDING = {"energy_lost", "imbalance", "periodicity"}
"""Keys of JSON whose values are rounding: recorded as zero below `NEGLIGIBLE`."""

UNSIGNED = {"mean"}
"""Keys of JSON whose sign depends on rounding: a section in bending has both."""

NEGLIGIBLE = 1e-7

WORD = re.compile(r"[\w.\-+#]{1,60}")
"""A code or a name; other text is prose."""


def run_command(words: Sequence[str], folder: Path) -> tuple[int, str]:
    """Run the command in this process within a folder; return its exit code and its standard output."""
    sys.modules.pop("flexcam.__main__", None)
    out = io.StringIO()
    quiet = (
        mock.patch.object(sys, "argv", ["flexcam", *words]), mock.patch.object(signal, "signal"),
        mock.patch.object(gc, "freeze"), chdir(folder), redirect_stdout(out), redirect_stderr(io.StringIO()),
    )  # fmt: skip
    code = 0
    with quiet[0], quiet[1], quiet[2], quiet[3], quiet[4], quiet[5]:
        try:
            runpy.run_module("flexcam", run_name="__main__")
        except SystemExit as ended:
            code = int(ended.code or 0)
    return code, out.getvalue()


def json_record(words: Sequence[str], folder: Path) -> Record:
    """Return the record of a command with JSON output."""
    code, out = run_command([*words, "--json"], folder)
    try:
        content = json.loads(out)
    except ValueError:
        return {"code": code, "json": "none"}
    return {"code": code, **dict(_flatten(content, ""))}


def run_record(words: Sequence[str], folder: Path, samples: int) -> Record:
    """Return the record of `flexcam run`: its output, and the histories of its result file if there is one."""
    record = json_record(["run", *words, "-o", "out", "--overwrite"], folder)
    if samples < FULL:  # metrics of the same histories
        record = {key: value for key, value in record.items() if key.partition("/")[0] not in ("train", "strength")}
    found = sorted((folder / "out").glob("*.vtkhdf"))
    if not found:
        return record
    try:
        record |= _result(found[0], samples)
    finally:
        for path in found:
            path.unlink()
    return record


def digest(words: Sequence[str], folder: Path) -> Record:
    """Return the record of a command with long constant JSON: a checksum over its keys and values without prose."""
    code, out = run_command([*words, "--json"], folder)
    kept = json.dumps(_without_prose(json.loads(out)), sort_keys=True)
    return {"code": code, "sha256": sha256(kept.encode()).hexdigest()}


def _without_prose(value: object) -> object:
    if isinstance(value, dict):
        return {key: _without_prose(inner) for key, inner in value.items() if key not in ("description", "title")}
    return [_without_prose(inner) for inner in value] if isinstance(value, list) else value


def _flatten(value: object, path: str) -> Iterator[tuple[str, object]]:
    """Yield the content of a JSON value, one quantity per path."""
    name = path.rpartition("/")[2]
    if name in DROPPED or path.endswith("smoothing/at"):  # several angles are equal there
        return
    if name in COUNTED and isinstance(value, list):
        yield f"{path}#", len(value)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _flatten(inner, f"{path}/{key}" if path else key)
    elif isinstance(value, list):
        yield from _flatten_list(value, path)
    elif (kept := _scalar(value, name)) is not None:
        yield path, kept


def _flatten_list(values: list[object], path: str) -> Iterator[tuple[str, object]]:
    if values and all(_is_number(value) for value in values):
        yield path, row([float(value) for value in values], FULL)
    elif values and all(isinstance(value, dict) for value in values) and len({tuple(value) for value in values}) == 1:
        for key in values[0]:
            yield from _flatten([value[key] for value in values], f"{path}/{key}")
    elif values and all(isinstance(value, bool) for value in values):
        yield path, "".join("FT"[value] for value in values)
    elif all(isinstance(value, str) for value in values):
        yield from _flatten_words(values, path)
    else:
        for number, value in enumerate(values):
            yield from _flatten(value, f"{path}/{number}")


def _flatten_words(values: list[str], path: str) -> Iterator[tuple[str, object]]:
    """Yield a list of words unchanged, places of invalid input without their lines, and the number of prose texts."""
    if path.endswith("/where"):
        yield path, [re.sub(r" \(line [^)]*\)", "", value) for value in values]
    elif values and all(WORD.fullmatch(value) for value in values):
        yield path, values
    else:
        yield f"{path}#", len(values)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _scalar(value: object, name: str) -> object:
    """Return the recorded form of a scalar, or None for prose."""
    if isinstance(value, str):
        return value if WORD.fullmatch(value) else None
    if value is None or isinstance(value, bool | int):
        return "null" if value is None else value
    if name in ROUNDING and abs(value) < NEGLIGIBLE:
        return 0.0
    return abs(value) if name in UNSIGNED else float(value)


def row(values: Sequence[float] | np.ndarray, samples: int) -> list[float]:
    """Return maximum, minimum and root mean square of a history, then even samples, or all values of a short one."""
    array = np.asarray(values, dtype=float).ravel()
    if not len(array):
        return []
    if not array.any():
        return [0.0]
    places = np.unique(np.linspace(0, len(array) - 1, min(samples, len(array))).round().astype(int))
    whole = [array.max(), array.min(), math.sqrt(float(np.mean(array * array)))]
    return [float(value) for value in (*whole, *array[places])]


def _result(path: Path, samples: int) -> Record:
    """Return status, metrics and histories of a result file."""
    with h5py.File(path) as file:
        status = file["status"]
        record: Record = {
            "cause": status["cause"][()].decode(),
            "kind": _kind(status),
            "stats/engine": str(status.attrs["engine"]),
            **{
                f"stats/{name}": int(status.attrs[name]) for name in ("steps", "size", "unknowns", "events", "rejected")
            },
        }
        if samples != BARE:
            record |= _histories(file["history"], samples)
        if samples == FULL:
            record |= _fields(file["VTKHDF/PointData"])
    return record


def _kind(status: h5py.Group) -> str:
    """Return whether contacts opened or closed, forces were found by iteration, or neither."""
    if status.attrs["events"]:
        return "switching"
    return "smooth" if status.attrs["iterations"] else "linear"


def _histories(history: h5py.Group, samples: int) -> Record:
    record: Record = {"history/cam_angle": row(history["cam_angle"][()], LIGHT)}
    for name, probe in history["probes"].items():
        components = [_text(component) for component in np.atleast_1d(probe.attrs["components"])]
        for kind in ("displacement", "velocity", "acceleration"):
            columns = np.atleast_2d(probe[kind][()].T)
            for component, column in zip(components, columns, strict=True):
                record[f"probes/{name}/{kind}/{component}"] = row(column, samples)
    for name, channel in history["channels"].items():
        record[f"channels/{name} [{_text(channel.attrs['units'])}]"] = row(channel[()], samples)
    return record


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _fields(fields: h5py.Group) -> Record:
    """Return rows of the saved fields as magnitudes: for equally loaded sides of a node, rounding selects either."""
    return {f"fields/{name}": row(np.abs(fields[name][()]), LIGHT) for name in fields if name != "node"}


def environment() -> None:
    """Set the environment of the commands independent of the user's: one thread, a plain terminal."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.pop("COLUMNS", None)
