"""What is watched while a run goes on, so that it can be doubted afterwards without its histories."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from flexcam.integrate import outline
from flexcam.memory import Extremes
from flexcam.response import Block, Response, Sink
from flexcam.runner import Prepared
from flexcam.train import FinenessSink, build_structure


@dataclass(frozen=True, eq=False)
class Watched:
    """Sinks that watch a run.

    Parameters
    ----------
    extremes
        Least and largest of everything.
    fineness
        Whether steps and elements resolve what moves.
    """

    extremes: Extremes
    fineness: FinenessSink

    @classmethod
    def of(cls, ready: Prepared) -> Self:
        """Return those of a run that is to come."""
        names = outline(ready.problem.system, channels=ready.save.channels)
        watching = FinenessSink(build_structure(ready.model), ready.problem.system, names, ready.problem.step)
        return cls(Extremes(names), watching)

    @classmethod
    def again(cls, ready: Prepared, response: Response) -> Self:
        """Return those of a run that is over, from its histories."""
        made = cls.of(ready)
        rows = [response.channels[name] for name, _ in response.outline.channels]
        channels = np.column_stack(rows) if rows else np.zeros((len(response.time), 0))
        saved = response.field_time, response.field_angle, response.fields
        block = Block(response.time, response.angle, response.probes, channels, *saved)
        for sink in made.sinks:
            sink.write(block)
        return made

    @property
    def sinks(self) -> tuple[Sink, Sink]:
        """For `flexcam.solve`."""
        return self.extremes, self.fineness
