"""Table of a sweep with a row per variant: HDF5, CSV or Parquet files, and data frames.

Numbers are written so that reading them is exact.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError, format_shape, refuse, require_packages, suggest_name, system_message
from flexcam.core.units import to_display_unit
from flexcam.dynamics import Cause, Status
from flexcam.io import hdf5
from flexcam.io import result_schema as schema
from flexcam.io.files import atomic_write_path, check_writable
from flexcam.io.result_reader import check_integrity

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Column:
    """Values of one varied key by variant."""

    name: str  #: key
    unit: str  #: unit of the numbers as given in the plan; empty for SI and for words
    values: FloatArray | tuple[str, ...]  #: values, shape (variants,): numbers, or texts if any value is not numeric

    def format(self, i: int) -> str:
        """Return the value of a variant with its unit."""
        value = self.values[i]
        return value if isinstance(value, str) else f"{value:.6g} {self.unit}".rstrip()


@dataclass(frozen=True, eq=False)
class SweepTable:
    """Results of a sweep."""

    inputs: tuple[Column, ...]  #: varied keys
    #: values by name, SI, shape (variants,); NaN for missing values. No file contains NaN
    scalars: Mapping[str, FloatArray]
    units: Mapping[str, str]  #: SI unit by scalar
    statuses: tuple[Status, ...]  #: status of every variant
    #: number of values along every axis of a grid in the order of the rows; empty for a sampled plan
    shape: tuple[int, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict[str, str])  #: case, plan and versions as texts

    def __len__(self) -> int:
        return len(self.statuses)

    def __getitem__(self, name: str) -> FloatArray:
        """Return a scalar of all variants, shape (variants,); NaN for missing values."""
        if name not in self.scalars:
            raise InputError([unknown_scalar_fault(name, self.scalars, prefixes=False)])
        return self.scalars[name]

    def column(self, name: str) -> Column:
        """Return a varied key or a scalar in the unit that engineers use."""
        if (key := next((column for column in self.inputs if column.name == name), None)) is not None:
            return key
        if name not in self.scalars:
            names = [*(column.name for column in self.inputs), *self.scalars]
            raise InputError([unknown_scalar_fault(name, names, prefixes=False)])
        factor, unit = to_display_unit(self.units[name])
        return Column(name, unit, factor * self.scalars[name])

    @property
    def failed(self) -> tuple[int, ...]:
        """Indices of the variants with incomplete runs."""
        return tuple(i for i, status in enumerate(self.statuses) if not status.ok)

    @property
    def warned(self) -> tuple[int, ...]:
        """Indices of the variants with complete runs that gave warnings."""
        return tuple(i for i, status in enumerate(self.statuses) if status.ok and "Warning: " in status.text)

    def select(self, names: Sequence[str]) -> SweepTable:
        """Return the table with only the given scalars."""
        if self.scalars and (unknown := [name for name in names if not is_scalar_prefix(name, self.scalars)]):
            reasons = {name: next((s.text for s in self.statuses if name in s.text), "") for name in unknown}
            faults = [(unknown_scalar_fault(name, self.scalars), reason) for name, reason in reasons.items()]
            raise InputError(replace(fault, why=reason or fault.why) for fault, reason in faults)
        scalars = {key: values for n in names for key, values in self.scalars.items() if is_scalar_prefix(n, (key,))}
        return replace(self, scalars=scalars, units={name: self.units[name] for name in scalars})


def is_scalar_prefix(name: str, known: Iterable[str]) -> bool:
    """Return whether a name is that of a scalar or a prefix of one."""
    return any(scalar == name or scalar.startswith(f"{name.removesuffix('.')}.") for scalar in known)


_MAX_LISTED = 24  # maximum number of scalars listed in a message; of more, only prefixes are listed


def unknown_scalar_fault(name: str, known: Iterable[str], *, prefixes: bool = True, others: str = "") -> Fault:
    """Return the fault of a scalar that no variant has; suggest a prefix of scalars only if it is allowed.

    `others` describes allowed names that are no scalars; a name like those of one part needs no such list.
    """
    names = list(known)
    parts = [item.split(".") for item in names]
    begins = list(dict.fromkeys(".".join(part[:i]) for part in parts for i in range(1, len(part))))
    groups = list(dict.fromkeys(".".join(part[:2]) for part in parts))
    group = ".".join(name.split(".")[:2])
    if len(names) > _MAX_LISTED and group in groups:
        allowed = f"a result under {group}: {', '.join(item for item in names if item.startswith(f'{group}.'))}"
    else:
        listed = ", ".join(names)
        if len(names) > _MAX_LISTED:
            listed = f"a result such as {names[-1]}; the names begin with {', '.join(groups)}"
        allowed = "; ".join(filter(None, (listed or "(no run was completed)", others)))
    near = suggest_name(name, [*(begins if prefixes else ()), *names])
    return Fault("scalars", repr(name), allowed, "there is no such result", near)


def table_frame(table: SweepTable) -> pd.DataFrame:
    """Return a table as a data frame."""
    require_packages("data frames", "pandas", "tables", "pandas")
    import pandas as pd

    columns: dict[str, Any] = {column.name: list(column.values) for column in table.inputs}
    columns |= dict(table.scalars)
    columns["status"] = [str(status.cause) for status in table.statuses]
    columns["message"] = [status.text if status.message else "" for status in table.statuses]
    frame = pd.DataFrame(columns, index=pd.RangeIndex(1, len(table) + 1, name="variant"))
    frame.attrs["units"] = {**{column.name: column.unit for column in table.inputs}, **table.units}
    return frame


def write_hdf5(table: SweepTable, path: Path) -> None:
    """Write a table with its metadata as HDF5."""
    opened: Any = h5py.File(path, "w", libver="latest", locking=False)
    with opened as file:
        hdf5.write_texts(file.create_group("about"), {schema.ABOUT_FORMAT: str(schema.TABLE_FORMAT), **table.about})
        file.attrs["shape"] = np.array(table.shape, dtype=np.int64)
        inputs = file.create_group("inputs", track_order=True)
        for column in table.inputs:
            if isinstance(column.values, tuple):
                hdf5.write_texts(inputs, {column.name: column.values})
            else:
                _write_numbers(inputs, column.name, column.values, column.unit)
        scalars, valid = (file.create_group(name, track_order=True) for name in ("scalars", "valid"))
        for name, values in table.scalars.items():
            known = np.isfinite(values)
            _write_numbers(scalars, name, np.where(known, values, 0.0), table.units[name])
            valid.create_dataset(name, data=known, track_times=False)
        parts = {name: [str(getattr(s, name)) for s in table.statuses] for name in ("cause", "text", "remedy")}
        hdf5.write_texts(file.create_group("status", track_order=True), parts)
        hdf5.write_digest(file)


def _write_numbers(group: Any, name: str, values: Any, unit: str) -> None:  # noqa: ANN401 - h5py has no types
    group.create_dataset(name, data=values, track_times=False).attrs["unit"] = np.bytes_(unit.encode())


def read_table(path: str | Path) -> SweepTable:
    """Read the table of a sweep, ``.h5`` or ``.csv``; that of a CSV file keeps its units."""
    source = Path(path)
    if source.suffix == ".csv":
        return _read_csv(source)
    with hdf5.open_hdf5(source, "table", "the HDF5 table of a sweep (.sweep.h5)") as file:
        check_integrity(file, "table", source, schema.TABLE_FORMAT)
        about = hdf5.read_texts(file["about"])
        del about[schema.ABOUT_FORMAT]
        rows = zip(*(hdf5.read_text_column(file["status"][name]) for name in ("cause", "text", "remedy")), strict=True)
        statuses = tuple(Status(Cause(cause), text, remedy) for cause, text, remedy in rows)
        count, shape = len(statuses), tuple(int(n) for n in file.attrs["shape"])
        if shape and math.prod(shape) != count:
            raise refuse("/, attribute shape", format_shape(shape), f"the shape of {count} variants")
        inputs: list[Column] = []
        for name, item in file["inputs"].items():
            if "unit" in item.attrs:
                inputs.append(Column(name, hdf5.read_text_attribute(item, "unit"), hdf5.read_numbers(item, count)))
            else:
                inputs.append(Column(name, "", tuple(hdf5.read_text_column(item))))
        valid = {name: hdf5.read_numbers(item, count, kind="?") for name, item in file["valid"].items()}
        stored = {name: hdf5.read_numbers(item, count) for name, item in file["scalars"].items()}
        scalars = {name: np.where(valid[name], values, np.nan) for name, values in stored.items()}
        units = {name: hdf5.read_text_attribute(item, "unit") for name, item in file["scalars"].items()}
        return SweepTable(tuple(inputs), scalars, units, statuses, shape, about)


ENDINGS = (".h5", ".csv", ".parquet")


def write_table(table: SweepTable, path: Path, *, overwrite: bool = False) -> Path:
    """Write a table in the format of its suffix: ``.h5``, ``.csv`` or ``.parquet``."""
    if path.suffix not in ENDINGS:
        raise refuse("table", str(path), f"a name that ends in one of {', '.join(ENDINGS)}")
    if path.suffix == ".parquet":
        require_packages(*PARQUET)
    check_writable("table", path, overwrite=overwrite)
    with atomic_write_path(path) as draft:
        if path.suffix == ".h5":
            write_hdf5(table, draft)
        elif path.suffix == ".csv":
            draft.write_text(format_csv(table), encoding="utf-8", newline="")
        else:
            table_frame(table).to_parquet(draft)
    return path


PARQUET = ("--parquet", "a Parquet table", "tables", "pandas", "pyarrow")
"""Place, value, extra and packages of a Parquet table, for `require_packages`."""


def format_csv(table: SweepTable) -> str:
    """Return a table as CSV in mm, deg and MPa: a header with units, and an empty cell for a missing number."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    scales = {name: to_display_unit(table.units[name]) for name in table.scalars}
    names = [*((key.name, key.unit) for key in table.inputs), *((name, unit) for name, (_, unit) in scales.items())]
    writer.writerow(["variant", *(f"{name} [{unit}]" if unit else name for name, unit in names), "status", "message"])
    columns = [column.values if isinstance(column.values, tuple) else column.values.tolist() for column in table.inputs]
    for name, values in table.scalars.items():
        columns.append([x if np.isfinite(x) else None for x in (scales[name][0] * values).tolist()])
    for i, status in enumerate(table.statuses):
        writer.writerow([i + 1, *(values[i] for values in columns), status.cause, status.message])
    return text.getvalue()


def _read_csv(path: Path) -> SweepTable:
    """Read the CSV file of a table; the fewest first columns that differ in every row are those that were varied."""
    try:
        head, *rows = csv.reader(io.StringIO(path.read_text(encoding="utf-8-sig")))
    except (OSError, ValueError) as fault:
        why = system_message(fault) if isinstance(fault, OSError) else "it is not text, or empty"
        raise refuse("table", str(path), "the table of a sweep (.csv)", why) from None
    rows = [row for row in rows if row]
    if head[:1] != ["variant"] or head[-2:] != ["status", "message"] or {len(row) for row in rows} != {len(head)}:
        raise refuse("table", str(path), "the table of a sweep (.csv)", "it has other columns")
    if unknown := {row[-2] for row in rows} - set(Cause):
        raise refuse("table, column status", sorted(unknown)[0], ", ".join(Cause))
    columns = [_parse_column(title, texts) for title, *texts in list(zip(head, *rows, strict=True))[1:-2]]
    values = [column.values if isinstance(column.values, tuple) else column.values.tolist() for column in columns]
    keys = (n for n in range(1, len(columns)) if len(set(zip(*values[:n], strict=True))) == len(rows))
    count = next(keys, 1)
    scalars = {column.name: column.values for column in columns[count:] if not isinstance(column.values, tuple)}
    levels = [len(set(entries)) for entries in values[:count]]
    shape = tuple(levels) if math.prod(levels) == len(rows) else ()
    statuses = tuple(Status(Cause(row[-2]), row[-1]) for row in rows)
    return SweepTable(tuple(columns[:count]), scalars, {c.name: c.unit for c in columns}, statuses, shape)


def _parse_column(title: str, texts: Sequence[str]) -> Column:
    name, _, unit = title.removesuffix("]").partition(" [")
    try:
        return Column(name, unit, np.array([float(text or "nan") for text in texts]))
    except ValueError:
        return Column(name, "", tuple(texts))
