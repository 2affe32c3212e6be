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
from flexcam.core.errors import refuse, suggest_name
from flexcam.io.files import atomic_write_path, check_writable, format_toml, write_columns, write_text
from flexcam.io.number_tables import NumberTable, Row, find_table, read_rows
from flexcam.io.vtk import write_polylines

_LENGTHS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "μm": 1e-6, "inch": 0.0254, '"': 0.0254,
            "thou": 2.54e-5}  # fmt: skip
_UNITS = "um, mm, cm, m, in or thou"

AngleKind = Literal["cam", "crank"]

_DEGREE = math.pi / 180.0
_ANGLES = {"deg": _DEGREE, "°": _DEGREE, "degree": _DEGREE, "degrees": _DEGREE, "rad": 1.0}
_HEADER_UNIT = re.compile(r"_[^_\s]+$|[\[(][^\])]*[\])]?$")
"""Unit at the end of the name of a column: ``crank_deg``, ``crank [deg]``."""
_NO_UNITS = [[], ["cam"], ["crank"], ["angle"], ["angles"], ["shaft"], ["position"], ["cad"]]
"""Ends of names of columns of angles that are no units, but for crank angle degrees."""
_SAMPLE = re.compile(
    r"\bfunction\s+(?P<lobe>\w+)|\.add_(?P<sym>sym_)?sample\(\s*(?P<at>[-+\d.eE]+)\s*(?:\*\s*units\.(?P<angle>\w+)\s*)?,"
    r"\s*(?P<lift>[-+\d.eE]+)\s*(?:\*\s*units\.(?P<length>\w+)\s*)?\)"
)
"""Lobe of engine-sim, and a sample of it: cam angle from its centre and lift; symmetric ones are in deg and thou."""


@dataclass(frozen=True, eq=False)
class LiftColumns:
    """Content of a lift file in SI units."""

    angle: FloatArray  #: cam angle, rad, shape (n,)
    lift: FloatArray  #: lift, m, shape (n,)
    lines: tuple[int, ...]  #: line numbers in the file, counted from 1, length n


def read_lift(
    path: Path, *, angle: AngleKind | None = None, unit: str | None = None, column: str | None = None,
    text: str | None = None,
) -> LiftColumns:  # fmt: skip
    """Read a table of angle and lift from a file, or from its known text.

    Rows contain two numbers or more, as in `flexcam.io.number_tables`. The line before them may name the columns, such
    as ``crank_deg, lift_mm``: an angle of ``cam`` or ``crank`` in ``deg`` or ``rad``, a lift in ``mm``, ``um``, ``m``
    or ``in``. Without such a header, both units must be given as arguments and the first two columns
    count; there is no default. A file ``.mr`` has the lobes of engine-sim. `column` names the lift, or the lobe.
    """
    rows = read_rows(path, "lift table", "rows of angle and lift", text)
    if path.suffix.lower() == ".mr":
        return _read_lobe(path, rows, column)
    table = _find_columns(path, rows, "rows of an angle and a lift")
    names = _lift_columns(table, path)
    lifts = [i for i, name in enumerate(names) if i and "lift" in _header_words(name)] or [1]
    if column is not None:
        lifts = [i for i, name in enumerate(names) if i and column == name]
    if len(lifts) != 1:
        listed = ", ".join(names) or "no header line"
        remedy = suggest_name(column, names) if column else 'name one: lift_table = { file = ..., column = "..." }'
        raise refuse(f"{path.name}, column of the lift", column or listed, listed, "", remedy)
    allowed, remedy = f"{table.width} finite numbers in each row", "correct or remove the row, or write # before it"
    values = table.select(path, [0, lifts[0]], allowed, remedy)
    to_rad = _angle_factor(names[0] if names else "", angle, table.head, path)
    scale = _lift_factor(names[lifts[0]] if names else "", unit, table.head, path)
    return LiftColumns(values[:, 0] * to_rad, values[:, 1] * scale, tuple(number for number, _ in table.rows))


def _find_columns(path: Path, rows: Sequence[Row], content: str) -> NumberTable:
    table = find_table(rows)
    if table.width < 2:
        number, line = table.rows[0]
        raise refuse(f"{path.name}, line {number}", repr(line[:40]), content)
    return table


def _read_lobe(path: Path, rows: Sequence[Row], column: str | None) -> LiftColumns:
    """Return the lift of a lobe in a file of engine-sim."""
    lobes: dict[str, dict[float, tuple[float, int]]] = {}
    name = ""
    for number, line in rows:
        for sample in _SAMPLE.finditer(line.partition("//")[0]):
            units = ("deg", "thou") if sample["sym"] else ("", "")
            angle_unit, length_unit = sample["angle"] or units[0], sample["length"] or units[1]
            name = sample["lobe"] or name
            if sample["lobe"] or angle_unit not in _ANGLES or length_unit not in _LENGTHS:  # another quantity
                continue
            try:
                angle, lift = float(sample["at"]) * _ANGLES[angle_unit], float(sample["lift"]) * _LENGTHS[length_unit]
            except ValueError:
                raise refuse(f"{path.name}, line {number}", repr(line[:40]), "two numbers") from None
            for side in (-angle, angle) if sample["sym"] else (angle,):
                lobes.setdefault(name, {})[side] = (lift, number)
    lobe = column or (next(iter(lobes)) if len(lobes) == 1 else "")
    if lobe not in lobes:
        allowed = ", ".join(lobes) or "samples .add_sample(10 * units.deg, 410 * units.thou) of a lobe"
        remedy = suggest_name(lobe, lobes) if lobe else 'name one: lift_table = { file = ..., column = "..." }'
        raise refuse(f"{path.name}, lobe", lobe or f"{len(lobes)} lobes", allowed, "", remedy)
    angle, lift, lines = zip(*sorted((angle, lift, n) for angle, (lift, n) in lobes[lobe].items()), strict=True)
    return LiftColumns(np.array(angle), np.array(lift), lines)


def write_lift_table(path: Path, angle: FloatArray, lift: FloatArray, *, overwrite: bool = False) -> Path:
    """Write a table of angle and lift that `read_lift` reads."""
    if path.suffix != ".csv":
        raise refuse("output", str(path), "a name that ends in .csv", "a case recognizes a table by this ending")
    check_writable("output", path, overwrite=overwrite)
    write_columns(path, {"cam_deg": np.degrees(angle), "lift_mm": 1e3 * lift})
    return path


def _lift_columns(table: NumberTable, path: Path) -> Sequence[str]:
    """Return the names of the columns; an empty list if the line before the table is no header."""
    head, words = table.head, _header_words(table.head)
    if not table.names:
        if words[:1] in (["cam"], ["crank"], ["angle"]) and "lift" in words:
            allowed = f"{table.width} names, because the rows have {table.width} numbers"
            remedy = "give one name per column, and use decimal points, not commas"
            raise refuse(f"{path.name}, header line", repr(head), allowed, "", remedy)
        return []
    first, second, *_ = table.names
    if _header_words(second)[:1] in (["cam"], ["crank"], ["angle"]) or "lift" in _header_words(first):
        raise refuse(f"{path.name}, header line", repr(head), "the angle first, then the lift", "", "swap the columns")
    return table.names


def _header_words(head: str) -> list[str]:
    plain = unicodedata.normalize("NFKC", head).lower()  # Unicode has two micro signs
    return [word for word in re.split(r"[^a-zμ°\"]+", plain) if word]


def _angle_factor(column: str, angle: AngleKind | None, head: str, path: Path) -> float:
    """Return the cam angle, rad, of one unit of the angle column."""
    words = _header_words(column)
    kinds = [kind for kind in ("cam", "crank") if any(word.startswith(kind) for word in words)]
    kind = angle or (kinds[0] if len(kinds) == 1 else None)
    if kind is None:
        table = 'lift_table = { file = ..., angle = "cam", unit = "mm" }'
        remedy = f"write a header line such as cam_deg, lift_mm or crank_deg, lift_mm, or write {table}"
        value = repr(head) if head else "no header line"
        why = f"{'it' if head else 'the file'} does not say to which shaft the angles belong"
        raise refuse(f"{path.name}, angle", value, "cam or crank angles", why, remedy)
    unit = _HEADER_UNIT.search(column)
    unknown = unit and set(words).isdisjoint(_ANGLES) and _header_words(unit[0])[-1:] not in _NO_UNITS
    if unknown or any(word in ("grad", "gon", "rev", "revs", "turn", "turns", "min") for word in words):
        remedy = f"convert the column, or write {kind}_deg or {kind}_rad"
        raise refuse(f"{path.name}, unit of the angle", repr(column), "degrees (deg) or radians (rad)", "", remedy)
    return next((_ANGLES[word] for word in words if word in _ANGLES), _DEGREE) * (0.5 if kind == "crank" else 1.0)


def _lift_factor(column: str, requested: str | None, head: str, path: Path) -> float:
    """Return the lift, m, of one unit of the lift column."""
    units = [word for word in _header_words(column) if word in _LENGTHS]
    unit = requested or (units[-1] if units else None)
    if unit not in _LENGTHS:
        angle = "crank_deg" if head.lower().startswith("crank") else "cam_deg"
        remedy = f'write lift_table = {{ file = ..., unit = "mm" }}, or a header line such as {angle}, lift_mm'
        given = unit or (f"{head!r}, which names no known unit" if head else "no header line")
        raise refuse(f"{path.name}, unit of the lift", given, _UNITS, "", remedy)
    return _LENGTHS[unit]


def read_profile(path: Path, *, unit: str | None = None) -> FloatArray:
    """Read the points of a profile, m, shape (n, 2), from two columns or from a table of flexcam."""
    table = _find_columns(path, read_rows(path, "profile", "rows of x and y"), "rows of x and y")
    columns = _profile_columns(table.names, path)
    scale = _profile_factor([table.names[column] for column in columns] if table.names else [], unit, path)
    points = scale * table.select(path, columns, "numbers", "correct or remove the row")
    closed = len(points) > 1 and bool(np.abs(points[0] - points[-1]).max() < 1e-9 * np.abs(points).max())
    return points[:-1] if closed else points


def _profile_columns(head: Sequence[str], path: Path) -> list[int]:
    """Return the columns of x and y: those of the profile if the table has several curves."""
    if not head:
        return [0, 1]
    columns: list[int] = []
    for axis in "xy":
        matches = [i for i, name in enumerate(head) if axis in _header_words(name)]
        curve = [i for i in matches if head[i].lower().startswith("profile")]
        if len(curve or matches) != 1:
            allowed = "one column x and one y, such as x [mm], y [mm]"
            raise refuse(f"{path.name}, header line", ", ".join(head)[:60], allowed, "", "name the columns")
        columns += curve or matches
    return columns


def _profile_factor(head: list[str], requested: str | None, path: Path) -> float:
    """Return the unit, m, of the column headers (the last word of each that is a unit) or the given one."""
    words = [[word for word in _header_words(name) if word in _LENGTHS] for name in head]
    units = list(dict.fromkeys(unit for unit in [requested or "", *(word[-1] for word in words if word)] if unit))
    where = f"{path.name}, unit"
    if len(units) > 1:
        why, remedy = "x, y and --unit contradict each other", "leave --unit out, or correct the header line"
        raise refuse(where, " and ".join(units), "one unit", why, remedy)
    if not units or units[0] not in _LENGTHS:
        remedy = "add --unit mm, or a header line such as x [mm], y [mm]"
        given = requested or (repr(", ".join(head)[:60]) if head else "no header line")
        raise refuse(where, given, _UNITS if requested else "a header line with a unit", "", remedy)
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
        writers[form](table, path)
    return paths


def _write_csv(table: ProfileTable, path: Path) -> None:
    columns = dict(table.columns)
    for name, curve in table.curves.items():
        columns |= {f"{name} x [mm]": _MM * curve[:, 0], f"{name} y [mm]": _MM * curve[:, 1]}
    write_columns(path, columns)


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
    with atomic_write_path(path) as draft:
        drawing.saveas(draft)


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
