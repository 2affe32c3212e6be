"""Cam profiles for the workshop: CSV and DXF in millimetres, VTK in metres."""

# pyright: reportUnknownMemberType=false
# ezdxf leaves the attributes of its entities open.

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flexcam.io.target import free_to_write
from flexcam.io.vtp import write_polylines
from flexcam.io.whole import whole
from flexcam.linalg import FloatArray

_MM = 1e3
_LAYERS = {"profile": 1, "pitch curve": 3, "cutter path": 5, "base circle": 8}
"""Layers of the drawing and their colours, numbers of AutoCAD's index."""


@dataclass(frozen=True, eq=False)
class ProfileTable:
    """A cam as curves and columns.

    Parameters
    ----------
    curves
        Closed curves by name, m, shape (n, 2): ``profile``, ``pitch curve``, ``cutter path``.
    base_radius
        m.
    columns
        Further columns by their heads with units, shape (n,).
    """

    curves: Mapping[str, FloatArray]
    base_radius: float
    columns: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])


def write_profile(table: ProfileTable, stem: Path, forms: Sequence[str], *, overwrite: bool = False) -> list[Path]:
    """Write a profile in some formats."""
    writers = {"csv": _csv, "dxf": _dxf, "vtp": _vtp}
    paths = [stem.with_name(f"{stem.name}.{form}") for form in forms]
    for path in paths:
        free_to_write("profile", path, overwrite=overwrite)
    for form, path in zip(forms, paths, strict=True):
        with whole(path) as draft:
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
