"""Files of cams: measured lift tables, profiles (CSV, DXF, VTK), and laws and lifts as TOML for a case.

Tables are text: ``#`` starts a comment, and a first row of names may give the units.
"""

# pyright: reportUnknownMemberType=false
# ezdxf does not type the attributes of its entities.

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from flexcam.cams import KINDS, HarmonicLift, Law
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, refuse, system_message
from flexcam.io.exports import write_polylines
from flexcam.io.files import atomic_write_path, check_writable, create_folder, format_toml, read_text, write_text

_LENGTHS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "μm": 1e-6, "inch": 0.0254, '"': 0.0254}
_MAX_FAULTS = 10

Row = tuple[int, str]
"""Line number, counted from 1, and text of a row."""


def _read_rows(path: Path, where: str, content: str, text: str | None = None) -> list[Row]:
    """Return the rows of a file, or of its known text, without comments and empty lines.

    Lines are those of a text editor: `str.splitlines` also splits at characters such as U+0085.
    """
    try:
        lines = (read_text(path) if text is None else text).split("\n")
    except OSError as fault:
        raise refuse(where, str(path), "a readable text file", system_message(fault)) from None
    rows = [(number, line.partition("#")[0].strip()) for number, line in enumerate(lines, start=1)]
    rows = [(number, line) for number, line in rows if line]
    if not rows:
        raise refuse(where, f"{path.name}, which is empty", content)
    return rows


AngleKind = Literal["cam", "crank"]

_DEGREE = math.pi / 180.0
_ANGLES = {"deg": _DEGREE, "°": _DEGREE, "degree": _DEGREE, "degrees": _DEGREE, "rad": 1.0}
_SEPARATOR = re.compile(r"[,;\t]|\s+")
_DECIMAL_COMMA = re.compile(r"\d,\d+\s*[;\t]")


@dataclass(frozen=True, eq=False)
class LiftColumns:
    """Content of a lift file in SI units."""

    angle: FloatArray  #: cam angle, rad, shape (n,)
    lift: FloatArray  #: lift, m, shape (n,)
    lines: tuple[int, ...]  #: line numbers in the file, counted from 1, length n


def read_lift(
    path: Path, *, angle: AngleKind | None = None, unit: str | None = None, text: str | None = None
) -> LiftColumns:
    """Read a table of angle and lift from a file, or from its known text.

    Rows contain two numbers separated by commas, semicolons, tabs or blanks; ``#`` starts a comment. An optional header
    names the columns, such as ``crank_deg, lift_mm``: an angle of ``cam`` or ``crank`` in ``deg`` or ``rad``, a lift in
    ``mm``, ``um``, ``m`` or ``in``. Without a header, both units must be given as arguments; there is no default.
    """
    rows = _read_rows(path, "lift table", "rows of angle and lift", text)
    head = rows.pop(0)[1] if not _pair(rows[0][1]) else ""
    of_angle, of_lift = _lift_columns(head, path)
    to_rad = _angle_factor(of_angle, angle, head, path)
    scale = _lift_factor(of_lift, unit, head, path)
    bad = [(number, text) for number, text in rows if not _pair(text)]
    if bad:
        raise InputError(
            Fault(f"{path.name}, line {number}", repr(text[:40]), "an angle and a lift", "",
                  "write decimal points: 90.5; 1.25" if _DECIMAL_COMMA.search(text) else "correct or remove the row")
            for number, text in bad[:_MAX_FAULTS]
        )  # fmt: skip
    values = np.array([_pair(text) for _, text in rows], dtype=float).reshape(-1, 2)
    return LiftColumns(values[:, 0] * to_rad, values[:, 1] * scale, tuple(number for number, _ in rows))


def write_lift_table(path: Path, angle: FloatArray, lift: FloatArray, *, overwrite: bool = False) -> Path:
    """Write a table of angle and lift that `read_lift` reads."""
    if path.suffix != ".csv":
        raise refuse("output", str(path), "a name that ends in .csv", "a case recognizes a table by this ending")
    check_writable("output", path, overwrite=overwrite)
    create_folder(path.parent)
    rows = np.column_stack([np.degrees(angle), 1e3 * lift])
    with atomic_write_path(path) as draft:
        np.savetxt(draft, rows, fmt="%.12g", delimiter=",", header="cam_deg,lift_mm", comments="")
    return path


def _pair(text: str) -> tuple[float, float] | None:
    """Return the two numbers of a row; None if it has others."""
    try:
        first, second = (float(part) for part in _SEPARATOR.split(text) if part)
    except ValueError:
        return None
    return first, second


def _lift_columns(head: str, path: Path) -> tuple[str, str]:
    """Return the headers of both columns; empty strings without a header."""
    if not head:
        return "", ""
    parts = [part.strip() for part in re.split(r"[,;\t]", head) if part.strip()]
    parts = parts if len(parts) == 2 else head.split()
    if len(parts) != 2:
        raise refuse(f"{path.name}, head", repr(head), "two names, such as cam_deg, lift_mm", "there are two columns")
    if _header_words(parts[1])[:1] in (["cam"], ["crank"], ["angle"]) or "lift" in _header_words(parts[0]):
        raise refuse(f"{path.name}, head", repr(head), "the angle first, then the lift", "", "swap the columns")
    return parts[0], parts[1]


def _header_words(head: str) -> list[str]:
    plain = unicodedata.normalize("NFKC", head).lower()  # Unicode has two micro signs
    return [word for word in re.split(r"[^a-zμ°\"]+", plain) if word]


def _angle_factor(column: str, given: AngleKind | None, head: str, path: Path) -> float:
    """Return the cam angle, rad, of one unit of the angle column."""
    words = _header_words(column)
    named = [kind for kind in ("cam", "crank") if any(word.startswith(kind) for word in words)]
    kind = given or (named[0] if len(named) == 1 else None)
    if kind is None:
        remedy = 'add angle = "cam" or angle = "crank", or a first row such as cam_deg, lift_mm'
        why = "the crankshaft turns twice as fast as the camshaft"
        raise refuse(f"{path.name}, angle", repr(head) if head else "no head", "cam or crank angles", why, remedy)
    if any(word in ("grad", "gon", "rev", "revs", "turn", "turns", "min") for word in words):
        raise refuse(f"{path.name}, angle", repr(head), "degrees (deg) or radians (rad)", "", "convert the column")
    return next((_ANGLES[word] for word in words if word in _ANGLES), _DEGREE) * (0.5 if kind == "crank" else 1.0)


def _lift_factor(column: str, given: str | None, head: str, path: Path) -> float:
    """Return the lift, m, of one unit of the lift column."""
    named = [word for word in _header_words(column) if word in _LENGTHS]
    unit = given or (named[-1] if named else None)
    if unit not in _LENGTHS:
        remedy = 'add unit = "mm" or unit = "in", or a first row such as cam_deg, lift_mm'
        raise refuse(f"{path.name}, unit of the lift", unit or head or "no head", ", ".join(_LENGTHS), "", remedy)
    return _LENGTHS[unit]


def read_profile(path: Path, *, unit: str | None = None) -> FloatArray:
    """Read the points of a profile, m, shape (n, 2), from two columns or from a table of flexcam."""
    rows = [(number, _split(line)) for number, line in _read_rows(path, "profile", "rows of x and y")]
    head = [] if _coordinates(rows[0][1], (0, 1)) else rows.pop(0)[1]
    columns = _profile_columns(head, path)
    scale = _profile_factor([head[column] for column in columns] if head else [], unit, path)
    bad = [Fault(f"{path.name}, line {number}", repr(",".join(parts)[:40]), "numbers", "", "correct or remove the row")
           for number, parts in rows if not _coordinates(parts, columns)]  # fmt: skip
    if bad:
        raise InputError(bad[:_MAX_FAULTS])
    points = scale * np.array([_coordinates(parts, columns) for _, parts in rows], dtype=float).reshape(-1, 2)
    closed = len(points) > 1 and bool(np.abs(points[0] - points[-1]).max() < 1e-9 * np.abs(points).max())
    return points[:-1] if closed else points


def _split(line: str) -> list[str]:
    return [part.strip() for part in re.split(r"[,;\t]", line)]


def _coordinates(parts: list[str], columns: tuple[int, int]) -> list[float]:
    """Return the two finite numbers of a row; empty if there are none."""
    try:
        found = [float(parts[column]) for column in columns]
    except (ValueError, IndexError):
        return []
    return found if all(map(math.isfinite, found)) else []


def _profile_columns(head: list[str], path: Path) -> tuple[int, int]:
    """Return the columns of x and y: those of the profile if the table has several curves."""
    if not head:
        return 0, 1
    found: list[int] = []
    for axis in "xy":
        named = [i for i, name in enumerate(head) if axis in _header_words(name)]
        own = [i for i in named if head[i].lower().startswith("profile")]
        if len(own or named) != 1:
            given = ", ".join(head)[:60]
            raise refuse(f"{path.name}, head", given, "one column x and one y, such as x [mm], y [mm]", "", "name them")
        found += own or named
    return found[0], found[1]


def _profile_factor(head: list[str], given: str | None, path: Path) -> float:
    """Return the unit, m, of the column headers (the last word of each that is a unit) or the given one."""
    words = [[word for word in _header_words(name) if word in _LENGTHS] for name in head]
    units = list(dict.fromkeys(unit for unit in [given or "", *(word[-1] for word in words if word)] if unit))
    where = f"{path.name}, unit"
    if len(units) > 1:
        why, remedy = "x, y and --unit contradict each other", "leave --unit out, or correct the head"
        raise refuse(where, " and ".join(units), "one unit", why, remedy)
    if not units or units[0] not in _LENGTHS:
        remedy = "add --unit mm, or a first row such as x [mm], y [mm]"
        raise refuse(where, given or ", ".join(head)[:60] or "no head", ", ".join(_LENGTHS), "", remedy)
    return _LENGTHS[units[0]]


_MM = 1e3
_LAYERS = {"profile": 1, "pitch curve": 3, "cutter path": 5, "base circle": 8}
"""Layers of the drawing and their AutoCAD colour indices."""


@dataclass(frozen=True, eq=False)
class ProfileTable:
    """Curves and columns of a cam profile."""

    #: closed curves by name, m, shape (n, 2): ``profile``, ``pitch curve``, ``cutter path``
    curves: Mapping[str, FloatArray]
    base_radius: float  #: radius of the base circle, m
    #: further columns by header with unit, shape (n,)
    columns: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])


def write_profile(table: ProfileTable, stem: Path, forms: Sequence[str], *, overwrite: bool = False) -> list[Path]:
    """Write a profile in one or more formats: ``csv``, ``dxf``, ``vtp``."""
    writers = {"csv": _write_csv, "dxf": _write_dxf, "vtp": _write_vtp}
    paths = [stem.with_name(f"{stem.name}.{form}") for form in forms]
    for path in paths:
        check_writable("profile", path, overwrite=overwrite)
    for form, path in zip(forms, paths, strict=True):
        with atomic_write_path(path) as draft:
            writers[form](table, draft)
    return paths


def _write_csv(table: ProfileTable, path: Path) -> None:
    columns = dict(table.columns)
    for name, curve in table.curves.items():
        columns |= {f"{name} x [mm]": _MM * curve[:, 0], f"{name} y [mm]": _MM * curve[:, 1]}
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, fmt="%.12g", delimiter=",", header=",".join(columns), comments="")


def _write_dxf(table: ProfileTable, path: Path) -> None:
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


def _write_vtp(table: ProfileTable, path: Path) -> None:
    closed = [np.vstack([curve, curve[:1]]) for curve in table.curves.values()]
    flat = np.vstack(closed)
    points = np.column_stack([flat, np.zeros(len(flat))])
    data = {name: np.tile(np.append(column, column[0]), len(closed)) for name, column in table.columns.items()}
    cells = {"curve": np.arange(len(closed))}
    write_polylines(path, points, [len(c) for c in closed], point_data=data, cell_data=cells)


def write_law(law: Law, path: Path, *, about: Mapping[str, object], overwrite: bool = False) -> Path:
    """Write a law as a file for a case: ``law = "NAME.toml"``."""
    names = [name for name, kind in KINDS.items() if kind is type(law)]
    if not names or not is_dataclass(law):
        raise refuse("law", type(law).__name__, f"a law of the kinds {', '.join(KINDS)}")
    table = {key: value for key, value in asdict(law).items() if value is not None}
    return _write_toml(path, {"format": 1, "law": {"id": names[0], **table}, "about": dict(about)}, overwrite=overwrite)


def write_lift(lift: HarmonicLift, path: Path, *, about: Mapping[str, object], overwrite: bool = False) -> Path:
    """Write a harmonic lift as a file for a case: ``lift_table = "NAME.toml"``."""
    return _write_toml(path, {"format": 1, "lift": asdict(lift), "about": dict(about)}, overwrite=overwrite)


def _write_toml(path: Path, content: Mapping[str, object], *, overwrite: bool) -> Path:
    if path.suffix != ".toml":
        raise refuse("output", str(path), "a name that ends in .toml", "a case recognizes a law file by this ending")
    return write_text(path, format_toml(content), overwrite=overwrite)
