"""State of an instant, prescribed inputs of an instant, and sequences of states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexcam.core import FloatArray, IntArray
from flexcam.dynamics.blocks import Arrays, Series, select_prefix
from flexcam.dynamics.cam_motion import CamFunctionCache, PrescribedInputs

ContactSides = Callable[[FloatArray], NDArray[np.bool_]]
"""Function that returns the sides of zero of the switching scalars for a penetration."""


@dataclass(frozen=True, eq=False)
class StepState:
    """State of an instant, with all data for the next step."""

    time: float  #: s
    d: FloatArray  #: displacement, shape (n,)
    v: FloatArray  #: velocity
    a: FloatArray  #: acceleration
    applied: FloatArray  #: loads and local forces in the unknowns, shape (n,)
    local: FloatArray  #: local forces, shape (c,)
    penetration: FloatArray  #: sensed scalars, shape (c,)
    rate: FloatArray  #: their rates, shape (c,)
    inner: FloatArray  #: internal states of the local laws, shape (s,)
    pressed: NDArray[np.bool_] | None = None  #: side of zero of the switching scalars; None for that of the penetration
    impulse: FloatArray | None = None  #: of impacts at this instant, N s, shape (c,); None without impact
    iterations: int = 0  #: Newton iterations of the step
    stride: float | None = None  #: internal step of a method with its own step control, s; None for its default

    def sides(self, of_penetration: ContactSides) -> NDArray[np.bool_]:
        """Return the sides of the switching scalars: `pressed`, or else those that a function finds."""
        return of_penetration(self.penetration) if self.pressed is None else self.pressed

    @classmethod
    def from_checkpoint(cls, name: str, arrays: Arrays) -> StepState | None:
        """Return the instant of a checkpoint, bit by bit; None without one."""
        parts = select_prefix(name, arrays)
        if not parts:
            return None
        stride = parts.pop("stride", None)
        time, iterations = float(parts.pop("time")), int(parts.pop("iterations"))
        step = None if stride is None else float(stride)
        return cls(time, iterations=iterations, stride=step, **parts)


@dataclass(frozen=True, eq=False)
class StepInputs:
    """Prescribed inputs of an instant."""

    time: float  #: s
    load: FloatArray  #: loads in the unknowns, shape (n,)
    inputs: PrescribedInputs  #: prescribed inputs of the local forces
    row: int = 0  #: of the inputs

    @property
    def angle(self) -> float:
        """Cam angle, rad."""
        return float(self.inputs.angle[self.row])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Sequence of m instants in the integrated unknowns."""

    time: FloatArray  #: s
    d: FloatArray  #: displacement, shape (m, n)
    v: FloatArray  #: velocity
    a: FloatArray  #: acceleration
    local: FloatArray  #: local forces, shape (m, c)
    state: FloatArray  #: internal states of the local laws, shape (m, s)
    impulse: FloatArray  #: of impacts, N s, shape (m, c)
    pressed: NDArray[np.bool_]  #: side of zero of the switching scalars in the step that follows, shape (m, w)
    ends: IntArray  #: indices of instants that end an output step; the others are events or sub-steps
    cam: CamFunctionCache | None = None  #: functions of the cam angle at these instants, if available

    @classmethod
    def of(cls, steps: Sequence[Sequence[StepState]], sides: ContactSides) -> Trajectory:
        """Return the instants of some steps, one sequence per step, with the sides of the switching scalars."""
        moments = [moment for part in steps for moment in part]
        zeros = np.zeros(len(moments[0].local))
        return cls(
            time=np.array([m.time for m in moments]), d=np.array([m.d for m in moments]),
            v=np.array([m.v for m in moments]), a=np.array([m.a for m in moments]),
            local=np.array([m.local for m in moments]), state=np.array([m.inner for m in moments]),
            impulse=np.array([zeros if m.impulse is None else m.impulse for m in moments]),
            pressed=np.array([m.sides(sides) for m in moments]),
            ends=np.cumsum([len(part) for part in steps]) - 1,
        )  # fmt: skip

    @classmethod
    def concatenate(cls, tracks: Sequence[Trajectory]) -> Trajectory:
        """Return the concatenation of several sequences."""
        time, d, v, a, local, state, impulse, pressed = (
            np.concatenate(rows) for rows in zip(*(t.rows for t in tracks), strict=True)
        )
        begins = np.cumsum([0, *(len(track.time) for track in tracks)])
        ends = [track.ends + begin for track, begin in zip(tracks, begins, strict=False)]
        return cls(time, d, v, a, local, state, impulse, pressed, np.concatenate(ends))

    @property
    def rows(self) -> tuple[NDArray[Any], ...]:
        """All arrays with a row per instant."""
        return self.time, self.d, self.v, self.a, self.local, self.state, self.impulse, self.pressed

    def steps(self, first: int, last: int | None = None) -> Trajectory:
        """Return the instants of a range of output steps; without `last` all instants that follow."""
        begins = np.append(0, self.ends + 1)
        begin = begins[min(first, len(self.ends))]
        return self._select(slice(begin, None if last is None else begins[last]), self.ends[first:last] - begin)

    def at_ends(self, steps: IntArray | slice) -> Trajectory:
        """Return the instants at the ends of some steps alone."""
        ends = self.ends[steps]
        return self._select(ends, np.arange(len(ends)))

    def _select(self, part: slice | IntArray, ends: IntArray) -> Trajectory:
        time, d, v, a, local, state, impulse, pressed = (rows[part] for rows in self.rows)
        return Trajectory(time, d, v, a, local, state, impulse, pressed, ends)


@dataclass(frozen=True, eq=False)
class SensedTrajectory:
    """Trajectory with the prescribed inputs, and the scalars that its local forces sense."""

    track: Trajectory
    inputs: PrescribedInputs
    penetration: FloatArray
    rate: FloatArray

    def at(self, i: int) -> StepState:
        """Return the instant, with its side and its impulse."""
        track, impulse = self.track, self.track.impulse[i]
        return StepState(
            float(track.time[i]), track.d[i], track.v[i], track.a[i], np.zeros_like(track.d[i]), track.local[i],
            self.penetration[i], self.rate[i], track.state[i], track.pressed[i], impulse if impulse.any() else None,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ProbeTrajectory:
    """Results of b steps if only probes and fields are needed."""

    time: FloatArray  #: s, shape (b,)
    probes: Series  #: all scalars of the probes without their prescribed part, shape (b, p)
    fields: Series  #: the motions at saved fields, shape (f, n)
