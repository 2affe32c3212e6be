"""Tables of sweeps as files: HDF5 with everything, CSV for spreadsheets, Parquet for data frames."""

from __future__ import annotations

import csv
import io
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from flexcam.checks import refuse
from flexcam.io import free_to_write, made_folder, whole
from flexcam.sweep.hdf5 import write_hdf5
from flexcam.sweep.table import Table

ENDINGS = (".h5", ".csv", ".parquet")


def write_table(table: Table, path: Path, *, overwrite: bool = False) -> Path:
    """Write a table as its name ends: ``.h5``, ``.csv`` or ``.parquet``."""
    if path.suffix not in ENDINGS:
        raise refuse("table", str(path), f"a name that ends in {', '.join(ENDINGS)}")
    if path.suffix == ".parquet":
        can_write_parquet()
    free_to_write("table", path, overwrite=overwrite)
    made_folder(path.parent)
    with whole(path) as draft:
        {".h5": write_hdf5, ".csv": _write_csv, ".parquet": _write_parquet}[path.suffix](table, draft)
    return path


def can_write_parquet() -> None:
    """Refuse Parquet where what writes it is not installed."""
    missing = [name for name in ("pandas", "pyarrow") if find_spec(name) is None]
    if missing:
        why, remedy = f"{' and '.join(missing)} are not installed", "pip install 'flexcam[tables]'"
        raise refuse("--parquet", "a Parquet table", "an HDF5 or a CSV one", why, remedy)


def csv_text(table: Table) -> str:
    """Return a table as CSV: a head with units, an empty cell where a variant has no number."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    head = [_headed(one.name, one.unit) for one in table.inputs]
    head += [_headed(name, table.units[name]) for name in table.scalars]
    writer.writerow(["variant", *head, "status", "message"])
    columns = [*(one.values for one in table.inputs), *table.scalars.values()]
    for i, status in enumerate(table.statuses):
        writer.writerow([i + 1, *(_cell(values[i]) for values in columns), str(status.cause), status.message])
    return text.getvalue()


def _headed(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return repr(float(value)) if np.isfinite(value) else ""


def _write_csv(table: Table, path: Path) -> None:
    path.write_text(csv_text(table), encoding="utf-8", newline="")


def _write_parquet(table: Table, path: Path) -> None:
    from flexcam.sweep.frames import table_frame

    table_frame(table).to_parquet(path)
