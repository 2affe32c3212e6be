"""Which variants are run: every combination of the axes, or points sampled from them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from typing import Literal

from flexcam.checks import Fault, InputError, did_you_mean, refuse
from flexcam.sweep.axis import LIMIT, Axis, Value, few_enough

_SAMPLE = re.compile(r"([a-z]+):(\d{1,15})$")


@dataclass(frozen=True)
class Sample:
    """How points are sampled.

    Parameters
    ----------
    kind
        Latin hypercube or Sobol's sequence, as `scipy.stats.qmc` has them, scrambled.
    count
        Of points; a power of two for Sobol's sequence, which is even over the space then.
    seed
        The same seed gives the same points.
    """

    kind: Literal["lhs", "sobol"]
    count: int
    seed: int = 0

    def points(self, dimensions: int) -> list[list[float]]:
        """Return the points of the unit cube, `count` rows of so many parts from 0 up to 1."""
        import numpy as np
        from scipy.stats import qmc

        kind = qmc.Sobol if self.kind == "sobol" else qmc.LatinHypercube
        made = kind(dimensions, seed=np.random.default_rng(self.seed)).random(self.count)
        return made.tolist()


def sample(text: str, seed: int = 0) -> Sample:
    """Return a way of sampling from its text."""
    allowed = "lhs:N (Latin hypercube) or sobol:N (Sobol's sequence), such as sobol:512"
    match = _SAMPLE.match(text.strip())
    if match is None or match[1] not in ("lhs", "sobol"):
        raise refuse("--sample", repr(text), allowed, "", did_you_mean(text.partition(":")[0], ["lhs", "sobol"]))
    count = int(match[2])
    if count < 1:
        raise refuse("--sample", text, "1 point or more", "the plan is empty")
    if match[1] == "sobol" and count & (count - 1):
        near = f"take sobol:{1 << (count.bit_length() - 1)} or sobol:{1 << count.bit_length()}"
        raise refuse("--sample", text, "a power of two", "Sobol's sequence is even over the space there only", near)
    return Sample("sobol" if match[1] == "sobol" else "lhs", count, checked_seed(seed))


def checked_seed(seed: int) -> int:
    """Return the seed of what is drawn by chance, if it can be one."""
    if seed < 0:
        raise refuse("--seed", seed, "a whole number from 0", "generators of random numbers take no other")
    return seed


@dataclass(frozen=True)
class Plan:
    """The variants of a case: axes, and how their values are combined.

    Parameters
    ----------
    axes
        One per key; those of one value are laid over every variant.
    sample
        None for every combination, the last axis running fastest.
    """

    axes: tuple[Axis, ...]
    sample: Sample | None = None

    @property
    def varied(self) -> tuple[Axis, ...]:
        """The axes of more than one value."""
        return tuple(one for one in self.axes if one.varies)

    @property
    def fixed(self) -> tuple[str, ...]:
        """What is laid over every variant, as ``key=value``."""
        return tuple(f"{one.key}={one.values[0].text}" for one in self.axes if not one.varies)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along every varied axis of a grid; of sampled points, their count."""
        return tuple(len(one.values) for one in self.varied) if self.sample is None else (self.sample.count,)

    def __len__(self) -> int:
        return prod(self.shape)

    @cached_property
    def points(self) -> tuple[tuple[Value, ...], ...]:
        """The values of the varied axes, a row per variant."""
        if self.sample is None:
            return tuple(product(*(one.values for one in self.varied)))
        if not self.varied:
            return ((),) * len(self)
        parts = self.sample.points(len(self.varied))
        return tuple(tuple(one.at(part) for one, part in zip(self.varied, row, strict=True)) for row in parts)

    @property
    def variants(self) -> tuple[tuple[str, ...], ...]:
        """The overrides of every variant, for `flexcam.read_case`."""
        keys, fixed = [one.key for one in self.varied], self.fixed
        return tuple(
            (*fixed, *(f"{key}={value.text}" for key, value in zip(keys, row, strict=True))) for row in self.points
        )


def made_plan(axes: Sequence[Axis], sampled: Sample | None = None, *, limit: int = LIMIT) -> Plan:
    """Return a plan that can be run."""
    plan = Plan(tuple(axes), sampled)
    if sampled is None and (open_ones := [one for one in axes if one.interval]):
        why, remedy = "a grid needs its points", "write start:stop:step, or sample it: --sample sobol:512"
        raise InputError(
            Fault(one.where, "an interval", "a range with a step, or a list", why, remedy) for one in open_ones
        )
    if not plan.varied:
        given = " ".join(one.where for one in axes) or "no --set"
        raise refuse("sweep", given, "at least one key with several values", "nothing varies",
                     "such as --set run.speed=1000:4000:500rpm")  # fmt: skip
    few_enough("--sample" if sampled else "sweep", len(plan), limit)
    return plan
