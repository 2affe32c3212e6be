"""A case as plain data: its text and the files it names, as they were when the sweep began, to be read anywhere."""

from __future__ import annotations

import atexit
import hashlib
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import product
from math import prod
from pathlib import Path, PurePosixPath
from typing import Any, Literal, cast

from flexcam.case.reader import CaseFile
from flexcam.core.errors import Fault, InputError, did_you_mean, refuse
from flexcam.io import file_beside, scratch
from flexcam.studies.axes import LIMIT, Axis, Value, few_enough

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


_LONGEST = 255
"""Letters of a file's name."""


@dataclass(frozen=True)
class Bundle:
    """A case file and every file beside it that it names.

    Parameters
    ----------
    name
        Of the case file.
    digest
        A number that tells it from any other.
    files
        Path from the case file's folder, with ``/``, to what the file holds; the case itself among them.
    runs
        How many variants of it are to be run in all: the more, the sooner machine code pays.
    channels
        Whether contacts, members and energies are asked for; else runs compute the motion of the probes alone.
    """

    name: str
    digest: str
    files: Mapping[str, bytes] = field(compare=False)
    runs: int = 1
    channels: bool = True

    def unpacked(self, folder: Path) -> Path:
        """Write the files into a folder, placed to each other as they were, and return the case file."""
        ups = max(PurePosixPath(path).parts.count("..") for path in self.files)
        home = folder.joinpath(*["up"] * ups)
        for path, content in self.files.items():
            target = Path(os.path.normpath(home / path))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        return home / self.name


def bundle_of(file: CaseFile, plan: Plan | None = None) -> Bundle:
    """Return a case as plain data."""
    given = [value.text.strip("\"'") for one in plan.axes for value in one.values] if plan else []
    files = {file.path.name: file.text.encode()}
    for text in dict.fromkeys([*_texts(file.raw), *given]):
        if len(text) <= _LONGEST and not os.path.isabs(text) and (found := file_beside(file.path, text)):
            files[PurePosixPath(Path(os.path.normpath(text))).as_posix()] = found.read_bytes()
    return Bundle(file.path.name, _digest(files), files, len(plan) if plan else 1)


def _digest(files: Mapping[str, bytes]) -> str:
    found = hashlib.sha256()
    for path, content in sorted(files.items()):
        found.update(f"{path} {len(content)}\n".encode())
        found.update(content)
    return found.hexdigest()


def _texts(raw: object) -> Iterator[str]:
    """Yield every text of a table."""
    if isinstance(raw, str):
        yield raw
    elif isinstance(raw, Mapping):
        for value in cast("Mapping[str, Any]", raw).values():
            yield from _texts(value)
    elif isinstance(raw, Sequence):
        for value in cast("Sequence[Any]", raw):
            yield from _texts(value)


@lru_cache(maxsize=1)
def opened(source: Bundle | Path) -> CaseFile:
    """Return the case file of a bundle, unpacked once per process, or of a path."""
    if isinstance(source, Path):
        return CaseFile.opened(source)
    return CaseFile.opened(source.unpacked(_folders.enter_context(scratch())))


_folders = ExitStack()
"""Folders that are removed when the process ends."""

atexit.register(_folders.close)
