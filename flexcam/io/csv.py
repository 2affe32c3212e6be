"""Histories as CSV text, for spreadsheets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flexcam.checks import refuse
from flexcam.fem import ROTATIONS
from flexcam.io.target import free_to_write, made_folder
from flexcam.io.vtkhdf import SERIES
from flexcam.io.whole import whole
from flexcam.linalg import FloatArray
from flexcam.response import Response


def write_csv(
    response: Response, path: Path, *, probes: Sequence[str] | None = None, every: int = 1, overwrite: bool = False
) -> Path:
    """Write time, cam angle, probe histories and channels, a row per step."""
    if every < 1:
        raise refuse("every", every, "a whole number from 1")
    free_to_write("export", path, overwrite=overwrite)
    columns: dict[str, FloatArray] = {"time [s]": response.time, "cam angle [deg]": np.degrees(response.angle)}
    for name in probes or [name for name, _ in response.outline.probes]:
        history = response[name]
        for series, unit in SERIES.items():
            values = getattr(history, series).reshape(len(response.time), -1)
            for component, column in zip(history.components, values.T, strict=True):
                full = name if len(history.components) == 1 else f"{name}.{component}"
                columns[f"{full} {series} [{component_unit(component, unit)}]"] = column
    units = dict(response.outline.channels)
    columns.update({f"{name} [{units[name]}]": values for name, values in response.channels.items()})
    header = ",".join(columns)
    rows = np.column_stack(list(columns.values()))[::every]
    with whole(path) as draft:
        np.savetxt(draft, rows, fmt="%.17g", delimiter=",", header=header, comments="")
    return path


def component_unit(component: str, unit: str) -> str:
    """Return the SI unit of one component of a motion."""
    return unit.replace("m", "rad", 1) if component in ROTATIONS else unit


def write_text(path: Path, text: str, *, overwrite: bool = False) -> Path:
    """Write a text file, such as a table."""
    free_to_write("output", path, overwrite=overwrite)
    made_folder(path.parent)
    with whole(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return path
