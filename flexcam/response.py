"""What a run gives back: histories, fields, a status with its cause, and figures of the run.

`solve` hands out its results in blocks; a `Sink` takes them: memory, a file, a progress bar.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from flexcam.checks import FlexcamError, did_you_mean, finite_array, refuse
from flexcam.linalg import FloatArray, IntArray

STATE = "state."
"""Begins the name of a channel that holds an internal state: with them a run can go on from a result."""

_WORTH = 640
"""Steps below which a block costs more than what is in it."""

_FIELDS = 32
"""Saved fields that are written together, where they are not many steps apart."""

_MOST = 8192
"""Steps in a block at most: what a run has in memory does not depend on how seldom fields are saved."""

_SAME_INSTANT = 1e-9
"""Part of a period by which rounding may have moved the instant at its beginning."""


class Cause(StrEnum):
    """Why a run ended."""

    DONE = "done"
    INTERRUPTED = "interrupted"
    NOT_FINITE = "not-finite"
    NO_CONVERGENCE = "no-convergence"
    SINGULAR = "singular"
    NOT_SAVED = "not-saved"
    TIME_LIMIT = "time-limit"
    ROUNDING = "rounding"
    STEP_TOO_SMALL = "step-too-small"
    TOLERANCE = "tolerance-not-met"
    NO_RENDERING = "no-rendering"
    REFUSED = "refused"
    WORKER_LOST = "worker-lost"
    FAULT = "fault"


@dataclass(frozen=True)
class Status:
    """How a run ended: the cause, the place and what to do.

    Parameters
    ----------
    cause
        One of `Cause`.
    text
        What happened, in words, with time, cam angle and unknown by name.
    remedy
        What to do about it.

    Examples
    --------
    >>> Status().ok
    True
    """

    cause: Cause = Cause.DONE
    text: str = "the run is complete"
    remedy: str = ""

    @property
    def ok(self) -> bool:
        """Whether the run reached its end."""
        return self.cause is Cause.DONE

    def __str__(self) -> str:
        return f"{self.cause}: {self.text}" + (f"; {self.remedy}" if self.remedy else "")


TOO_FINE = Status(
    Cause.ROUNDING,
    "rounding in the stiffness takes too much of the answer: a member is cut into too many elements, or stiffnesses "
    "lie too far apart for double precision",
    "use fewer elements (up to some 1000 per span keep four digits)",
)
"""How a computation ends whose result would be rounding."""


BUCKLED = Status(
    Cause.SINGULAR, "the stiffness is not positive: an axial load is beyond buckling", "lower the compressive force"
)
"""How a computation ends whose stiffness is not positive."""


class RunFailedError(FlexcamError, RuntimeError):
    """A computation that could not be finished.

    Parameters
    ----------
    status
        Cause, place and remedy.
    """

    def __init__(self, status: Status) -> None:
        self.status = status
        super().__init__(str(status))


@dataclass(frozen=True)
class Stats:
    """Figures of a run.

    Parameters
    ----------
    path
        The way through time that was taken, see `flexcam.integrate.paths`.
    steps
        Steps done.
    size
        Unknowns of the whole mechanism; zero in results that do not tell it.
    unknowns
        Unknowns integrated; those that nothing can move are left out.
    iterations
        Newton iterations of local forces, all steps together.
    events
        Moments located inside a step, where a contact opens or closes.
    substeps
        Steps taken between the instants of the results, where steps are adaptive; else zero.
    rejected
        Steps of too large an error, taken again with half their length.
    periodicity
        By how much the start misses returning after a revolution, as a part of the motion; negative if not asked for.
    imbalance
        Largest force out of balance, as a part of the largest force; negative where channels were not computed.
    seconds
        Time spent in the step loop, s.
    """

    path: str = "general"
    steps: int = 0
    size: int = 0
    unknowns: int = 0
    iterations: int = 0
    events: int = 0
    substeps: int = 0
    rejected: int = 0
    periodicity: float = -1.0
    imbalance: float = -1.0
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Series:
    """Displacement, velocity and acceleration over some instants, arrays of one shape (times, columns)."""

    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray

    @classmethod
    def joined(cls, parts: Sequence[Series]) -> Series:
        """Return the parts one after the other."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in cls.__annotations__))

    def between(self, own: FloatArray, times: FloatArray) -> Series:
        """Return the motion at other times than its own, s, rising, from the instants on both sides of each.

        Displacements are cubics with the velocities at both ends, velocities cubics with the accelerations,
        accelerations straight lines: of higher order than the integrators, and without overshoot where a law jumps.
        """
        right = np.clip(np.searchsorted(own, times, side="right"), 1, len(own) - 1)
        left = right - 1
        length = (own[right] - own[left])[:, None]
        x = (times - own[left])[:, None] / length
        d, v, a = self.displacement, self.velocity, self.acceleration
        moved = _cubic(x, d[left], d[right], length * v[left], length * v[right])
        moving = _cubic(x, v[left], v[right], length * a[left], length * a[right])
        return Series(moved, moving, a[left] + x * (a[right] - a[left]))

    def at(self, instants: NDArray[np.bool_]) -> Series:
        """Return the chosen instants, shape (times,)."""
        return Series(self.displacement[instants], self.velocity[instants], self.acceleration[instants])


def _cubic(x: FloatArray, old: FloatArray, new: FloatArray, slope: FloatArray, new_slope: FloatArray) -> FloatArray:
    """Return Hermite's cubic at x from 0 to 1."""
    y = 1.0 - x
    return y * y * ((1.0 + 2.0 * x) * old + x * slope) + x * x * ((3.0 - 2.0 * x) * new - y * new_slope)


@dataclass(frozen=True, eq=False)
class Block:
    """Results of some successive steps.

    Parameters
    ----------
    time, angle
        s and rad, shape (b,).
    probes
        All probe scalars side by side, shape (b, p).
    channels
        All channels side by side, shape (b, c).
    field_time, field_angle
        Instants of the saved fields, shape (f,).
    fields
        All unknowns at those instants, shape (f, n).
    """

    time: FloatArray
    angle: FloatArray
    probes: Series
    channels: FloatArray
    field_time: FloatArray
    field_angle: FloatArray
    fields: Series

    @classmethod
    def joined(cls, parts: Sequence[Block]) -> Block:
        """Return successive blocks as one."""
        if len(parts) == 1:
            return parts[0]
        rows = {name: np.concatenate([getattr(p, name) for p in parts])
                for name in ("time", "angle", "channels", "field_time", "field_angle")}  # fmt: skip
        return cls(
            **rows, probes=Series.joined([p.probes for p in parts]), fields=Series.joined([p.fields for p in parts])
        )


@dataclass(frozen=True)
class SaveAt:
    """What of a run is kept; probes and channels are kept at every step.

    Parameters
    ----------
    field_every
        All unknowns at every so many steps, the first and the last step included.
    fields_per_block
        Saved fields handed out together; None for as many as make a block worth its trouble, and keep it small.
    channels
        Whether channels and energies are computed; without them a run cannot go on where laws have internal states.

    Examples
    --------
    >>> SaveAt(field_every=100).block
    3200
    """

    field_every: int = 20
    fields_per_block: int | None = None
    channels: bool = True

    @property
    def block(self) -> int:
        """Steps handed out together."""
        if self.fields_per_block:
            return self.field_every * self.fields_per_block
        fields = max(_FIELDS, -(-_WORTH // self.field_every))
        return self.field_every * min(fields, _MOST // self.field_every) or _MOST

    def fields(self, steps: IntArray, last: int) -> NDArray[np.bool_]:
        """Tell after which of some steps all unknowns are kept.

        Parameters
        ----------
        steps
            Numbers of steps, shape (b,).
        last
            Number of the last step of the run.

        Returns
        -------
        ndarray
            Shape (b,), bool.
        """
        return (steps % self.field_every == 0) | (steps == last)

    def __post_init__(self) -> None:
        for name in ("field_every", "fields_per_block"):
            given: int | None = getattr(self, name)
            if given is not None and given < 1:
                raise refuse(f"save.{name}", given, "a whole number from 1")


class Sink(Protocol):
    """Something that takes results as they come."""

    def write(self, block: Block) -> None:
        """Take the next block."""
        ...

    def close(self, status: Status, stats: Stats) -> None:
        """Learn how the run ended; called once, also after a failure."""
        ...


@dataclass(frozen=True)
class Outline:
    """Names of what a run saves, in the order of the block's columns.

    Parameters
    ----------
    unknowns
        Name per column of the fields.
    probes
        Pairs of probe name and its component names.
    channels
        Pairs of channel name and unit.
    """

    unknowns: tuple[str, ...]
    probes: tuple[tuple[str, tuple[str, ...]], ...]
    channels: tuple[tuple[str, str], ...]

    def columns(self, name: str) -> slice:
        """Return the columns of a probe, or of one component of it given as ``probe.component``.

        Raises
        ------
        InputError
            If nothing of that name was saved.
        """
        first = 0
        known: list[str] = []
        for probe, components in self.probes:
            if name == probe:
                return slice(first, first + len(components))
            for i, one in enumerate(components):
                if name == f"{probe}.{one}":
                    return slice(first + i, first + i + 1)
            known += [probe, *(f"{probe}.{one}" for one in components if len(components) > 1)]
            first += len(components)
        raise refuse("probe", repr(name), ", ".join(known) or "(no probe was saved)", remedy=did_you_mean(name, known))


@dataclass(frozen=True, eq=False)
class History:
    """Motion of one probe over time.

    Parameters
    ----------
    name
        Of the probe.
    components
        Names of its scalars.
    displacement, velocity, acceleration
        m, m/s, m/s^2 (rad where a component is a rotation); shape (steps,) for a probe of one scalar, else
        (steps, components).
    """

    name: str
    components: tuple[str, ...]
    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


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
        How the run ended, and its figures.

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

    @property
    def inner(self) -> FloatArray:
        """Internal states of the local laws at the end, shape (s,)."""
        return np.array([values[-1] for name, values in self.channels.items() if name.startswith(STATE)], dtype=float)

    def latest(self, period: float) -> NDArray[np.bool_]:
        """Tell which instants lie within the last period of a run.

        Parameters
        ----------
        period
            Such as that of a revolution, s.

        Returns
        -------
        ndarray
            Shape (steps + 1,), bool: one instant per step, the period's first left out; all of a shorter run.
        """
        return self.time > self.time[-1:] - period * (1.0 - _SAME_INSTANT)

    def at(self, times: FloatArray) -> Response:
        """Return the response at other instants than its own: dense output.

        Parameters
        ----------
        times
            s, rising, within the run.

        Returns
        -------
        Response
            Probes by cubics, cam angle and channels by straight lines; the saved fields are those of the run.

        Raises
        ------
        InputError
            If a time is outside the run, or they do not rise.

        Examples
        --------
        ``response.at(np.linspace(0.0, 0.01, 5000))["valve"].displacement``
        """
        given = finite_array("times", times, (None,))
        if len(self.time) < 2 or not len(given):
            raise refuse("times", f"{len(given)} of a run of {len(self.time)} instants", "some of a run of two or more")
        if given[0] < self.time[0] or given[-1] > self.time[-1] or (np.diff(given) < 0.0).any():
            allowed = f"rising times from {self.time[0]:.6g} to {self.time[-1]:.6g} s"
            raise refuse("times", f"{given[0]:.6g} to {given[-1]:.6g} s", allowed)

        def straight(values: FloatArray) -> FloatArray:
            return np.interp(given, self.time, values)

        return replace(
            self, time=given, angle=straight(self.angle), probes=self.probes.between(self.time, given),
            channels={name: straight(values) for name, values in self.channels.items()},
        )  # fmt: skip

    def __getitem__(self, name: str) -> History:
        """Return the history of a probe, or of one component of it (``"cam.uy"``)."""
        columns = self.outline.columns(name)
        one = columns.stop - columns.start == 1
        parts = dict(self.outline.probes)
        components = parts[name] if name in parts else (name.rpartition(".")[2],)
        picked = [
            values[:, columns.start] if one else values[:, columns]
            for values in (self.probes.displacement, self.probes.velocity, self.probes.acceleration)
        ]
        return History(name, components, *picked)


Advance = Callable[[int], None]
"""Told how many more of many things are finished."""

Thing = TypeVar("Thing")
"""What is counted."""


def counted(things: Iterable[Thing], advance: Advance | None) -> Iterator[Thing]:
    """Yield things one after the other, and tell after each that one more is finished.

    Parameters
    ----------
    things
        Any.
    advance
        Is told; None for nobody.

    Yields
    ------
    object
        The things.

    Examples
    --------
    >>> told = []
    >>> [2 * one for one in counted([1, 2], told.append)], told
    ([2, 4], [1, 1])
    """
    for one in things:
        yield one
        if advance is not None:
            advance(1)


def heed(status: Status) -> None:
    """Go on being interrupted: one of many runs was stopped, and what asked for them all stops as well.

    Parameters
    ----------
    status
        Of the run.

    Raises
    ------
    KeyboardInterrupt
        If the user stopped it.
    """
    if status.cause is Cause.INTERRUPTED:
        raise KeyboardInterrupt
