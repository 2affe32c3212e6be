"""Cam profile files: read the points of two columns or of a flexcam table, and write CSV and DXF."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, system_message
from flexcam.io.atomic_write import atomic_write_path
from flexcam.io.exports import write_polylines
from flexcam.io.paths import check_writable, read_lines

_LENGTHS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
_MAX_FAULTS = 10


def read_profile(path: Path, *, unit: str | None = None) -> FloatArray:
    """Read the points of a profile."""
    try:
        lines = read_lines(path)
    except (OSError, UnicodeDecodeError) as fault:
        raise refuse("profile", str(path), "a readable text file", system_message(fault)) from None
    rows = [(number, _split_row(line)) for number, line in enumerate(lines, start=1) if line.partition("#")[0].strip()]
    if not rows:
        raise refuse("profile", f"{path.name}, which is empty", "rows of x and y")
    head = [] if _numbers(rows[0][1], (0, 1)) else rows.pop(0)[1]
    columns = _columns(head, path)
    scale = _find_scale([head[column] for column in columns] if head else [], unit, path)
    bad = [Fault(f"{path.name}, line {number}", repr(",".join(parts)[:40]), "numbers", "", "correct or remove the row")
           for number, parts in rows if not _numbers(parts, columns)]  # fmt: skip
    if bad:
        raise InputError(bad[:_MAX_FAULTS])
    points = scale * np.array([_numbers(parts, columns) for _, parts in rows], dtype=float).reshape(-1, 2)
    closed = len(points) > 1 and bool(np.abs(points[0] - points[-1]).max() < 1e-9 * np.abs(points).max())
    return points[:-1] if closed else points


def _split_row(line: str) -> list[str]:
    return [part.strip() for part in re.split(r"[,;\t]", line.partition("#")[0])]


def _numbers(parts: list[str], columns: tuple[int, int]) -> list[float]:
    """Return the two numbers of a row; empty if there are none."""
    try:
        found = [float(parts[column]) for column in columns]
    except (ValueError, IndexError):
        return []
    return found if all(map(math.isfinite, found)) else []


def _words(name: str) -> list[str]:
    return re.findall(r"[a-z]+", name.lower())


def _columns(head: list[str], path: Path) -> tuple[int, int]:
    if not head:
        return 0, 1
    found: list[int] = []
    for axis in "xy":
        named = [i for i, name in enumerate(head) if axis in _words(name)]
        own = [i for i in named if head[i].lower().startswith("profile")]
        if len(own or named) != 1:
            given = ", ".join(head)[:60]
            raise refuse(f"{path.name}, head", given, "one column x and one y, such as x [mm], y [mm]", "", "name them")
        found += own or named
    return found[0], found[1]


def _find_scale(head: list[str], given: str | None, path: Path) -> float:
    """Return the unit of the column headers (the last word of each that is a unit) or the given one."""
    words = [[word for word in _words(name) if word in _LENGTHS] for name in head]
    named = [given or "", *(word[-1] for word in words if word)]
    units = list(dict.fromkeys(unit for unit in named if unit))
    where = f"{path.name}, unit"
    if len(units) > 1:
        why, remedy = "x, y and --unit contradict each other", "leave --unit out, or correct the head"
        raise refuse(where, " and ".join(units), "one unit", why, remedy)
    if not units or units[0] not in _LENGTHS:
        remedy = "add --unit mm, or a first row such as x [mm], y [mm]"
        raise refuse(where, given or ", ".join(head)[:60] or "no head", ", ".join(_LENGTHS), "", remedy)
    return _LENGTHS[units[0]]


# ezdxf does not type the attributes of its entities.


_MM = 1e3
_LAYERS = {"profile": 1, "pitch curve": 3, "cutter path": 5, "base circle": 8}
"""Layers of the drawing and their AutoCAD colour indices."""


@dataclass(frozen=True, eq=False)
class ProfileTable:
    """Curves and columns of a cam profile.

    Parameters
    ----------
    curves
        Closed curves by name, m, shape (n, 2): ``profile``, ``pitch curve``, ``cutter path``.
    base_radius
        Radius of the base circle, m.
    columns
        Further columns by header with unit, shape (n,).
    """

    curves: Mapping[str, FloatArray]
    base_radius: float
    columns: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])


def write_profile(table: ProfileTable, stem: Path, forms: Sequence[str], *, overwrite: bool = False) -> list[Path]:
    """Write a profile in one or more formats."""
    writers = {"csv": _csv, "dxf": _dxf, "vtp": _vtp}
    paths = [stem.with_name(f"{stem.name}.{form}") for form in forms]
    for path in paths:
        check_writable("profile", path, overwrite=overwrite)
    for form, path in zip(forms, paths, strict=True):
        with atomic_write_path(path) as draft:
            writers[form](table, draft)
    return paths


def _csv(table: ProfileTable, path: Path) -> None:
    columns = dict(table.columns)
    for name, curve in table.curves.items():
        columns |= {f"{name} x [mm]": _MM * curve[:, 0], f"{name} y [mm]": _MM * curve[:, 1]}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, fmt="%.12g", delimiter=",", header=",".join(columns), comments="")


def _dxf(table: ProfileTable, path: Path) -> None:
    import ezdxf
    from ezdxf import units

    drawing = ezdxf.new("R2010", units=units.MM)  # pyright: ignore[reportPrivateImportUsage]
    space = drawing.modelspace()
    for name, colour in _LAYERS.items():
        drawing.layers.add(name, color=colour)
    for name, curve in table.curves.items():
        space.add_lwpolyline((_MM * curve).tolist(), close=True, dxfattribs={"layer": name})
    space.add_circle((0.0, 0.0), _MM * table.base_radius, dxfattribs={"layer": "base circle"})
    drawing.saveas(path)


def _vtp(table: ProfileTable, path: Path) -> None:
    closed = [np.vstack([curve, curve[:1]]) for curve in table.curves.values()]
    flat = np.vstack(closed)
    points = np.column_stack([flat, np.zeros(len(flat))])
    data = {name: np.tile(np.append(column, column[0]), len(closed)) for name, column in table.columns.items()}
    write_polylines(
        path, points, [len(c) for c in closed], point_data=data, cell_data={"curve": np.arange(len(closed))}
    )
