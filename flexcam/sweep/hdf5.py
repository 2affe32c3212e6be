"""Tables of sweeps as HDF5; `docs/sweeps.md` lists what the file holds.

The same table gives the same bytes: no dates, no times, no machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.checks import InputError, refuse
from flexcam.io import guarded, seal, seal_fault
from flexcam.response import Cause, Status
from flexcam.sweep.table import Column, Table

FORMAT = "2"
"""Since 2 a table has a seal."""


def write_hdf5(table: Table, path: Path) -> None:
    """Write a table with everything that is known of it."""
    opened: Any = h5py.File(path, "w", libver="latest", locking=False)
    with opened as file:
        about = file.create_group("about")
        for name, text in {"format": FORMAT, **table.about}.items():
            _texts(about, name, [text])
        file.attrs["shape"] = np.array(table.shape, dtype=np.int64)
        inputs = file.create_group("inputs", track_order=True)
        for column in table.inputs:
            if isinstance(column.values, tuple):
                _texts(inputs, column.name, column.values)
            else:
                _numbers(inputs, column.name, column.values, column.unit)
        scalars, valid = (file.create_group(name, track_order=True) for name in ("scalars", "valid"))
        for name, values in table.scalars.items():
            known = np.isfinite(values)
            _numbers(scalars, name, np.where(known, values, 0.0), table.units[name])
            valid.create_dataset(name, data=known, track_times=False)
        status = file.create_group("status", track_order=True)
        for name in ("cause", "text", "remedy"):
            _texts(status, name, [str(getattr(one, name)) for one in table.statuses])
        seal(file)


def _numbers(group: Any, name: str, values: Any, unit: str) -> None:  # noqa: ANN401 - h5py has no types
    group.create_dataset(name, data=values, track_times=False).attrs["unit"] = np.bytes_(unit.encode())


def _texts(group: Any, name: str, texts: Sequence[str]) -> None:  # noqa: ANN401
    """Write texts of one length: HDF5's heap for others is not the same twice."""
    encoded = [text.encode() for text in texts]
    module: Any = h5py
    kind = module.string_dtype("utf-8", max([1, *map(len, encoded)]))
    group.create_dataset(name, data=np.array(encoded, dtype=kind), track_times=False)


def read_table(path: str | Path) -> Table:
    """Read the table of a sweep."""
    source = Path(path)
    with guarded(source, "table", "the HDF5 table of a sweep (.sweep.h5)") as file:
        return _table(file, source)


def _table(file: Any, source: Path) -> Table:  # noqa: ANN401
    about = {name: _read_texts(item)[0] for name, item in file["about"].items()}
    form = about.pop("format")
    if form not in ("1", FORMAT):
        raise refuse("table", f"{source} of format {form}", f"up to format {FORMAT}", "it is newer", "update flexcam")
    if form != "1" and (fault := seal_fault(file)):
        raise InputError([fault])
    status = zip(*(_read_texts(file["status"][name]) for name in ("cause", "text", "remedy")), strict=True)
    scalars = {name: np.where(file["valid"][name][()], item[()], np.nan) for name, item in file["scalars"].items()}
    return Table(
        inputs=tuple(_column(name, item) for name, item in file["inputs"].items()),
        scalars=scalars,
        units={name: _unit(item) for name, item in file["scalars"].items()},
        statuses=tuple(Status(Cause(cause), text, remedy) for cause, text, remedy in status),
        shape=tuple(int(n) for n in file.attrs["shape"]),
        about=about,
    )


def _column(name: str, item: Any) -> Column:  # noqa: ANN401
    if "unit" in item.attrs:
        return Column(name, _unit(item), item[()])
    return Column(name, "", tuple(_read_texts(item)))


def _unit(item: Any) -> str:  # noqa: ANN401
    return bytes(item.attrs["unit"]).decode()


def _read_texts(item: Any) -> list[str]:  # noqa: ANN401
    return [bytes(text).decode() for text in item[()]]
