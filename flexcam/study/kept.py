"""Variants that are evaluated until a study is stopped: those that are finished stay."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from flexcam.response import Cause, Status
from flexcam.study.points import Runs
from flexcam.sweep import Row

_NOT_RUN = Row(Status(Cause.INTERRUPTED, "the study was stopped before its turn", "run the study again"))


class Kept:
    """Evaluates variants; after a Ctrl-C those that are left have a row that says so.

    Parameters
    ----------
    runs
        Evaluates variants.

    Attributes
    ----------
    done, asked
        Variants finished, and asked for.
    """

    def __init__(self, runs: Runs) -> None:
        self._runs = runs
        self.done = self.asked = 0

    def __call__(self, variants: Sequence[tuple[str, ...]]) -> Iterator[Row]:
        """Yield a row per variant; a Ctrl-C before the first is one, as nothing could be kept."""
        self.asked += len(variants)
        rows, left = iter(self._runs(variants)), len(variants)
        while left and (row := self._next(rows)):
            left -= 1
            yield row
        yield from [_NOT_RUN] * left

    def _next(self, rows: Iterator[Row]) -> Row | None:
        try:
            row = next(rows)
        except KeyboardInterrupt:
            if not self.done:
                raise
            return None
        self.done += 1
        return row

    @property
    def stopped(self) -> bool:
        """Whether some were asked for and not finished."""
        return self.done < self.asked

    @property
    def status(self) -> Status:
        """How the study ended."""
        if not self.stopped:
            return Status()
        text = f"stopped by the user after {self.done} of {self.asked} variants; what is told is of these alone"
        return Status(Cause.INTERRUPTED, text, "the same command evaluates all of them")
