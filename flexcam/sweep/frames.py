"""Tables and histories for pandas and xarray, which the extra ``tables`` installs."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from flexcam.checks import refuse
from flexcam.io.csv import component_unit
from flexcam.io.vtkhdf import SERIES
from flexcam.response import Response
from flexcam.sweep.table import Table

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def table_frame(table: Table) -> pd.DataFrame:
    """Return a table as a data frame."""
    _installed("pandas")
    import pandas as pd

    columns: dict[str, Any] = {one.name: list(one.values) for one in table.inputs}
    columns |= dict(table.scalars)
    columns["status"] = [str(one.cause) for one in table.statuses]
    columns["message"] = [one.text if one.message else "" for one in table.statuses]
    frame = pd.DataFrame(columns, index=pd.RangeIndex(1, len(table) + 1, name="variant"))
    frame.attrs["units"] = {**{one.name: one.unit for one in table.inputs}, **table.units}
    return frame


def table_dataset(table: Table) -> xr.Dataset:
    """Return a table as an xarray dataset: the axes of a grid are its dimensions."""
    _installed("xarray")
    import xarray as xr

    shape = table.shape or (len(table),)
    names = [one.name for one in table.inputs]
    dimensions = names if table.shape else ["variant"]
    coordinates: dict[str, Any] = {}
    for i, one in enumerate(table.inputs):
        values = np.asarray(one.values)
        if table.shape:
            values = np.moveaxis(values.reshape(shape), i, 0).reshape(shape[i], -1)[:, 0]
        coordinates[one.name] = ([one.name if table.shape else "variant"], values, {"units": one.unit})
    if not table.shape:
        coordinates["variant"] = np.arange(1, len(table) + 1)
    causes = np.array([str(one.cause) for one in table.statuses]).reshape(shape)
    data: dict[str, Any] = {
        name: (dimensions, values.reshape(shape), {"units": table.units[name]})
        for name, values in table.scalars.items()
    }
    return xr.Dataset({**data, "status": (dimensions, causes)}, coords=coordinates, attrs=dict(table.about))


def history_frame(response: Response) -> pd.DataFrame:
    """Return the histories of a run as a data frame."""
    _installed("pandas")
    import pandas as pd

    columns = _columns(response)
    frame = pd.DataFrame(
        {name: values for name, (values, _) in columns.items()}, index=pd.Index(response.time, name="time")
    )
    frame.attrs["units"] = {"time": "s", **{name: unit for name, (_, unit) in columns.items()}}
    return frame


def history_dataset(response: Response) -> xr.Dataset:
    """Return the histories of a run as an xarray dataset over time."""
    _installed("xarray")
    import xarray as xr

    columns = {name: (["time"], values, {"units": unit}) for name, (values, unit) in _columns(response).items()}
    angle = columns.pop("cam_angle")
    return xr.Dataset(columns, coords={"time": (["time"], response.time, {"units": "s"}), "cam_angle": angle})


def _columns(response: Response) -> dict[str, tuple[Any, str]]:
    """Return every history by name, with its unit."""
    found: dict[str, tuple[Any, str]] = {"cam_angle": (response.angle, "rad")}
    for probe, components in response.outline.probes:
        history = response[probe]
        for series, unit in SERIES.items():
            values = getattr(history, series).reshape(len(response.time), -1)
            for component, column in zip(components, values.T, strict=True):
                name = probe if len(components) == 1 else f"{probe}.{component}"
                found[f"{name}.{series}"] = (column, component_unit(component, unit))
    units = dict(response.outline.channels)
    return found | {name: (values, units[name]) for name, values in response.channels.items()}


def _installed(package: str) -> None:
    if find_spec(package) is None:
        raise refuse(
            "data frames", package, "a package that is installed", "it comes with the extra 'tables'",
            "pip install 'flexcam[tables]'",
        )  # fmt: skip
