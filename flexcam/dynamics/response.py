"""Response of a run: probe histories, channels, dense output and extremes.

Between two instants a motion is the cubic with its values and slopes at both (`Series.interpolate`). The maximum of m
samples in a period of a sine has a relative error up to ``1 - cos(pi/m)``, half a percent with 30 steps; that of the
cubic is ``(2 pi/m)^4/384`` (C. de Boor, A Practical Guide to Splines, 1978), a 200 000th. A history without slopes,
such as a force, is linear between its instants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.core.errors import finite_array, refuse, require_packages, suggest_name
from flexcam.dynamics.blocks import Block, Series
from flexcam.dynamics.status import Stats, Status

if TYPE_CHECKING:
    import pandas as pd

SERIES = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
"""Series of every probe and their SI units."""


def component_unit(component: str, unit: str) -> str:
    """Return the SI unit of one component of a motion."""
    return unit.replace("m", "rad", 1) if component in ("rx", "ry", "rz") else unit


def turning_points(
    time: FloatArray, values: FloatArray, slopes: FloatArray, intervals: IntArray | slice = slice(None)
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return turning points of the cubics between instants, and their values; without one, the first instant.

    Times have the shape (m,), values and slopes (m, ...), results (2 (m - 1), ...) or two rows per given interval.
    """
    first, start = time[:-1][intervals].reshape(-1, *[1] * (values.ndim - 1)), values[:-1][intervals]
    length = np.diff(time)[intervals].reshape(first.shape)
    rise, begin, end = values[1:][intervals] - start, length * slopes[:-1][intervals], length * slopes[1:][intervals]
    square, cubic = 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        root = np.sqrt(square**2 - 3.0 * cubic * begin)  # NaN if the cubic has no turning point
        q = -(square + np.copysign(root, square))
        x = np.stack([q / (3.0 * cubic), begin / q])
    x = np.where((x > 0.0) & (x < 1.0), x, 0.0)
    extremes = start + x * (begin + x * (square + x * cubic))
    instants = first + x * length
    return np.concatenate(instants), np.concatenate(extremes)


def peak(time: FloatArray, values: FloatArray, slopes: FloatArray | None = None) -> tuple[float, float]:
    """Return the largest absolute value of a history, shape (m,), and its instant; zeros for an empty one."""
    if not len(values):
        return 0.0, 0.0
    instants, points = (time, values) if slopes is None else _add_turning_points(time, values, slopes)
    at = int(np.argmax(np.abs(points)))
    return float(np.abs(points[at])), float(instants[at])


def value_range(time: FloatArray, values: FloatArray, slopes: FloatArray | None = None) -> float:
    """Return the range of a history, shape (m,): its maximum minus its minimum."""
    if not len(values):
        return 0.0
    return float(np.ptp(values if slopes is None else _add_turning_points(time, values, slopes)[1]))


def _add_turning_points(time: FloatArray, values: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the history with the turning points of those cubics that may leave the range of the values.

    A cubic leaves the range of its ends by no more than 4/27 of its length times the sum of the absolute slopes there.
    """
    margin = 4.0 / 27.0 * np.diff(time) * (np.abs(slopes[:-1]) + np.abs(slopes[1:]))
    above = np.maximum(values[:-1], values[1:]) + margin > values.max()
    below = np.minimum(values[:-1], values[1:]) - margin < values.min()
    instants, extremes = turning_points(time, values, slopes, np.flatnonzero(above | below))
    return np.concatenate([time, instants]), np.concatenate([values, extremes])


STATE = "state."
"""Prefix of channels with internal states, which are needed to resume a run from a result."""


_SAME_INSTANT = 1e-9
"""Fraction of a period for rounding of the instant at its beginning."""


@dataclass(frozen=True)
class Outline:
    """Names of saved results, in the order of the block's columns."""

    unknowns: tuple[str, ...]  #: name per column of the fields
    probes: tuple[tuple[str, tuple[str, ...]], ...]  #: pairs of probe name and its component names
    channels: tuple[tuple[str, str], ...]  #: pairs of channel name and unit

    def columns(self, name: str) -> slice:
        """Return the columns of a probe, or of one component of it given as ``probe.component``."""
        first = 0
        names: list[str] = []
        for probe, components in self.probes:
            if name == probe:
                return slice(first, first + len(components))
            for i, component in enumerate(components):
                if name == f"{probe}.{component}":
                    return slice(first + i, first + i + 1)
            names += [probe, *(f"{probe}.{component}" for component in components if len(components) > 1)]
            first += len(components)
        raise refuse("probe", repr(name), ", ".join(names) or "(no probe was saved)", remedy=suggest_name(name, names))


@dataclass(frozen=True, eq=False)
class History:
    """Motion of one probe over time."""

    name: str  #: of the probe
    components: tuple[str, ...]  #: names of its scalars
    displacement: FloatArray  #: m or rad, shape (steps,) of a probe of one scalar, else (steps, components)
    velocity: FloatArray  #: m/s
    acceleration: FloatArray  #: m/s^2

    def __repr__(self) -> str:
        """Return name and size, not the values."""
        return f"<History of {self.name}: {', '.join(self.components)}; shape {self.displacement.shape}>"


class _Channels(dict[str, FloatArray]):
    """Channels by name; an unknown name is refused with the nearest one."""

    def __missing__(self, name: str) -> FloatArray:
        raise refuse("channel", repr(name), ", ".join(self) or "(no channel was saved)", "", suggest_name(name, self))


class _Metrics(dict[str, float]):
    """Metrics by name; an unknown name is refused with the nearest one."""

    def __missing__(self, name: str) -> float:
        raise refuse("metric", repr(name), ", ".join(self) or "(the run has none)", "", suggest_name(name, self))


@dataclass(frozen=True, eq=False)
class Response:
    """Result of a run.

    Parameters
    ----------
    outline
        Names of everything saved.
    time, angle
        Instants of the histories, s and rad (cam angle), shape (steps + 1,).
    probes
        Probe histories side by side; use ``response["valve"]``.
    channels
        Channel name to its history, shape (steps + 1,).
    field_time, field_angle, fields
        All unknowns at the saved instants.
    status, stats
        Status and statistics of the run.
    evaluator
        Function that computes the metrics of a response; None for a response without its model.

    Examples
    --------
    ``response["valve"].displacement``, ``response["cam.uy"].velocity``, ``response.channels["contacts.intake.force"]``.
    """

    outline: Outline
    time: FloatArray
    angle: FloatArray
    probes: Series
    channels: Mapping[str, FloatArray]
    field_time: FloatArray
    field_angle: FloatArray
    fields: Series
    status: Status = field(default_factory=Status)
    stats: Stats = field(default_factory=Stats)
    evaluator: Callable[[Response], Mapping[str, float]] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", _Channels(self.channels))

    def __repr__(self) -> str:
        """Return status and contents, not the values."""
        probes = ", ".join(name for name, _ in self.outline.probes) or "none"
        contents = f"{len(self.time)} instants, {len(self.field_time)} fields; probes: {probes}"
        return f"<Response, {self.status}; {contents}; {len(self.channels)} channels>"

    @cached_property
    def metrics(self) -> Mapping[str, float]:
        """Metrics of the last revolution in SI units, by the names of `flexcam run --json` and of sweeps.

        Raises
        ------
        InputError
            If the response has no model: it is from `solve` or a file.

        Examples
        --------
        ``response.metrics["contacts.seat.seating_velocity"]``
        """
        if self.evaluator is None:
            allowed = "a response of flexcam.run, or of flexcam.analysis.run.reload_result"
            raise refuse("metrics", "a response without its model", allowed)
        return _Metrics(self.evaluator(self))

    def motions(self, probes: Sequence[str] | None = None) -> Iterator[tuple[str, str, str, FloatArray]]:
        """Yield every scalar history of the probes, all or those named.

        Parameters
        ----------
        probes
            Names of probes, or of components such as ``cam.uy``.

        Yields
        ------
        tuple
            Name, series, SI unit and values, shape (steps + 1,).
        """
        for probe in probes or [name for name, _ in self.outline.probes]:
            history = self[probe]
            for series, unit in SERIES.items():
                values = getattr(history, series).reshape(len(self.time), -1)
                for component, column in zip(history.components, values.T, strict=True):
                    name = probe if len(history.components) == 1 else f"{probe}.{component}"
                    yield name, series, component_unit(component, unit), column

    def to_frame(self) -> pd.DataFrame:
        """Return all histories as a pandas data frame over time.

        Returns
        -------
        pandas.DataFrame
            A column ``cam_angle``, a column such as ``valve.displacement`` per motion and one per channel;
            ``frame.attrs["units"]`` has their SI units.

        Raises
        ------
        InputError
            If pandas is not installed.

        Examples
        --------
        ``response.to_frame()["valve.velocity"].min()``
        """
        require_packages("data frames", "pandas", "tables", "pandas")
        import pandas as pd

        columns, units = {"cam_angle": self.angle}, {"time": "s", "cam_angle": "rad"}
        for name, series, unit, values in self.motions():
            columns[f"{name}.{series}"], units[f"{name}.{series}"] = values, unit
        frame = pd.DataFrame(columns | dict(self.channels), index=pd.Index(self.time, name="time"))
        frame.attrs["units"] = units | dict(self.outline.channels)
        return frame

    def to_block(self) -> Block:
        """Return the response as one block, for sinks."""
        rows = [self.channels[name] for name, _ in self.outline.channels]
        channels = np.column_stack(rows) if rows else np.zeros((len(self.time), 0))
        return Block(self.time, self.angle, self.probes, channels, self.field_time, self.field_angle, self.fields)

    @property
    def inner(self) -> FloatArray:
        """Internal states of the local laws at the end, shape (s,)."""
        return np.array([values[-1] for name, values in self.channels.items() if name.startswith(STATE)], dtype=float)

    def latest(self, period: float) -> NDArray[np.bool_]:
        """Return which instants lie within the last period of a run.

        Parameters
        ----------
        period
            Such as that of a revolution, s.

        Returns
        -------
        ndarray
            Shape (steps + 1,), bool: one instant per step, without the first of the period; all of a shorter run.
        """
        return self.time > self.time[-1:] - period * (1.0 - _SAME_INSTANT)

    def at(self, times: FloatArray) -> Response:
        """Return the response at other instants than its own: dense output.

        Parameters
        ----------
        times
            Ascending times within the run, s.

        Returns
        -------
        Response
            Probes interpolated by cubics, cam angle and channels linearly; saved fields unchanged.

        Raises
        ------
        InputError
            If a time is outside the run, or times are not ascending.

        Examples
        --------
        ``response.at(np.linspace(0.0, 0.01, 5000))["valve"].displacement``
        """
        times = finite_array("times", times, (None,))
        if len(self.time) < 2 or not len(times):
            raise refuse("times", f"{len(times)} of a run of {len(self.time)} instants", "some of a run of two or more")
        if times[0] < self.time[0] or times[-1] > self.time[-1] or (np.diff(times) < 0.0).any():
            allowed = f"rising times from {self.time[0]:.6g} to {self.time[-1]:.6g} s"
            raise refuse("times", f"{times[0]:.6g} to {times[-1]:.6g} s", allowed)

        def straight(values: FloatArray) -> FloatArray:
            return np.interp(times, self.time, values)

        return replace(
            self, time=times, angle=straight(self.angle), probes=self.probes.interpolate(self.time, times),
            channels={name: straight(values) for name, values in self.channels.items()},
        )  # fmt: skip

    def __getitem__(self, name: str) -> History:
        """Return the history of a probe, or of one component of it (``"cam.uy"``)."""
        columns = self.outline.columns(name)
        is_single = columns.stop - columns.start == 1
        parts = dict(self.outline.probes)
        components = parts[name] if name in parts else (name.rpartition(".")[2],)
        series = [values[:, columns.start] if is_single else values[:, columns] for values in self.probes]
        return History(name, components, *series)


def scalar_probes(outline: Outline) -> dict[str, str]:
    """Return the component of every scalar probe by name, such as ``cam.uy``; a probe of one keeps its name."""
    return {name if len(parts) == 1 else f"{name}.{part}": part for name, parts in outline.probes for part in parts}


def scalar_history(response: Response, probe: str) -> History:
    """Return the history of a scalar probe."""
    check_scalar_probe(probe, response.outline)
    return response[probe]


def check_scalar_probe(probe: str, *outlines: Outline) -> None:
    """Raise an error if not all responses have a scalar probe of this name."""
    known = [scalar_probes(outline) for outline in outlines]
    scalars = [name for name in known[0] if all(name in names for names in known)]
    several = dict(outlines[0].probes).get(probe, ())
    if len(several) > 1:
        components = ", ".join(f"{probe}.{component}" for component in several)
        raise refuse("probe", repr(probe), components, "it has several components", "name one")
    if probe not in scalars:
        allowed = ", ".join(scalars) or "(no probe was saved)"
        if any(probe in names for names in known):
            raise refuse("probe", repr(probe), allowed, "one of the models has no such probe", "choose another --probe")
        raise refuse("probe", repr(probe), allowed, "there is no such probe", suggest_name(probe, scalars))
