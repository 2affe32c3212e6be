"""Plan of a sweep and the bundle of its case: text and referenced files as plain data for workers on other machines."""

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
from flexcam.core.errors import Fault, InputError, refuse, suggest_name
from flexcam.io import find_referenced_file, temporary_folder
from flexcam.studies.axes import MAX_VARIANTS, Axis, Value, check_count

_SAMPLE = re.compile(r"([a-z]+):(\d{1,15})$")


@dataclass(frozen=True)
class Sample:
    """Sampling method.

    Parameters
    ----------
    kind
        Latin hypercube or Sobol sequence of `scipy.stats.qmc`, scrambled.
    count
        Number of points; a power of two for a Sobol sequence, which is balanced then.
    seed
        Seed of the random generator.
    """

    kind: Literal["lhs", "sobol"]
    count: int
    seed: int = 0

    def points(self, dimensions: int) -> list[list[float]]:
        """Return `count` points of the unit cube, with coordinates from 0 to less than 1."""
        import numpy as np
        from scipy.stats import qmc

        kind = qmc.Sobol if self.kind == "sobol" else qmc.LatinHypercube
        made = kind(dimensions, seed=np.random.default_rng(self.seed)).random(self.count)
        return made.tolist()


def parse_sample(text: str, seed: int = 0) -> Sample:
    """Parse a sampling method."""
    allowed = "lhs:N (Latin hypercube) or sobol:N (Sobol's sequence), such as sobol:512"
    match = _SAMPLE.match(text.strip())
    if match is None or match[1] not in ("lhs", "sobol"):
        raise refuse("--sample", repr(text), allowed, "", suggest_name(text.partition(":")[0], ["lhs", "sobol"]))
    count = int(match[2])
    if count < 1:
        raise refuse("--sample", text, "1 point or more", "the plan is empty")
    if match[1] == "sobol" and count & (count - 1):
        near = f"take sobol:{1 << (count.bit_length() - 1)} or sobol:{1 << count.bit_length()}"
        raise refuse("--sample", text, "a power of two", "Sobol's sequence is even over the space there only", near)
    return Sample("sobol" if match[1] == "sobol" else "lhs", count, check_seed(seed))


def check_seed(seed: int) -> int:
    """Return a random seed after checking it."""
    if seed < 0:
        raise refuse("--seed", seed, "a whole number from 0", "generators of random numbers take no other")
    return seed


@dataclass(frozen=True)
class Plan:
    """Variants of a case: axes and the combination of their values.

    Parameters
    ----------
    axes
        One axis per key; axes of one value apply to every variant.
    sample
        Sampling method; None for all combinations, with the last axis varying fastest.
    """

    axes: tuple[Axis, ...]
    sample: Sample | None = None

    @property
    def varied_axes(self) -> tuple[Axis, ...]:
        """Axes with more than one value."""
        return tuple(one for one in self.axes if one.is_varied)

    @property
    def fixed(self) -> tuple[str, ...]:
        """Overrides of every variant, as ``key=value``."""
        return tuple(f"{one.key}={one.values[0].text}" for one in self.axes if not one.is_varied)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along every varied axis of a grid; for sampled points, their number."""
        return tuple(len(one.values) for one in self.varied_axes) if self.sample is None else (self.sample.count,)

    def __len__(self) -> int:
        return prod(self.shape)

    @cached_property
    def points(self) -> tuple[tuple[Value, ...], ...]:
        """Values of the varied axes, a row per variant."""
        if self.sample is None:
            return tuple(product(*(one.values for one in self.varied_axes)))
        if not self.varied_axes:
            return ((),) * len(self)
        parts = self.sample.points(len(self.varied_axes))
        return tuple(tuple(one.at(part) for one, part in zip(self.varied_axes, row, strict=True)) for row in parts)

    @property
    def variants(self) -> tuple[tuple[str, ...], ...]:
        """Overrides of every variant, for `flexcam.read_case`."""
        keys, fixed = [one.key for one in self.varied_axes], self.fixed
        return tuple(
            (*fixed, *(f"{key}={value.text}" for key, value in zip(keys, row, strict=True))) for row in self.points
        )


def make_plan(axes: Sequence[Axis], sampled: Sample | None = None, *, limit: int = MAX_VARIANTS) -> Plan:
    """Return a plan after checking the number of variants."""
    plan = Plan(tuple(axes), sampled)
    if sampled is None and (open_ones := [one for one in axes if one.interval]):
        why, remedy = "a grid needs its points", "write start:stop:step, or sample it: --sample sobol:512"
        raise InputError(
            Fault(one.where, "an interval", "a range with a step, or a list", why, remedy) for one in open_ones
        )
    if not plan.varied_axes:
        given = " ".join(one.where for one in axes) or "no --set"
        raise refuse("sweep", given, "at least one key with several values", "nothing varies",
                     "such as --set run.speed=1000:4000:500rpm")  # fmt: skip
    check_count("--sample" if sampled else "sweep", len(plan), limit)
    return plan


_MAX_NAME_LENGTH = 255
"""Maximum length of a file name, characters."""


@dataclass(frozen=True)
class Bundle:
    """Case file and all files it refers to.

    Parameters
    ----------
    name
        Name of the case file.
    digest
        Hash of the content.
    files
        Content by path relative to the folder of the case file, with ``/``; includes the case itself.
    runs
        Total number of variants to be run: compilation pays off with many.
    channels
        Whether contacts, members and energies are required; otherwise runs compute only the motion of the probes.
    """

    name: str
    digest: str
    files: Mapping[str, bytes] = field(compare=False)
    runs: int = 1
    channels: bool = True

    def unpack(self, folder: Path) -> Path:
        """Write the files into a folder with their relative paths, and return the case file."""
        ups = max(PurePosixPath(path).parts.count("..") for path in self.files)
        home = folder.joinpath(*["up"] * ups)
        for path, content in self.files.items():
            target = Path(os.path.normpath(home / path))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        return home / self.name


def make_bundle(file: CaseFile, plan: Plan | None = None) -> Bundle:
    """Return a case with its files as plain data."""
    given = [value.text.strip("\"'") for one in plan.axes for value in one.values] if plan else []
    files = {file.path.name: file.text.encode()}
    for text in dict.fromkeys([*_iterate_strings(file.raw), *given]):
        if (
            len(text) <= _MAX_NAME_LENGTH
            and not os.path.isabs(text)
            and (found := find_referenced_file(file.path, text))
        ):
            files[PurePosixPath(Path(os.path.normpath(text))).as_posix()] = found.read_bytes()
    return Bundle(file.path.name, _digest(files), files, len(plan) if plan else 1)


def _digest(files: Mapping[str, bytes]) -> str:
    found = hashlib.sha256()
    for path, content in sorted(files.items()):
        found.update(f"{path} {len(content)}\n".encode())
        found.update(content)
    return found.hexdigest()


def _iterate_strings(raw: object) -> Iterator[str]:
    """Yield all strings of nested tables."""
    if isinstance(raw, str):
        yield raw
    elif isinstance(raw, Mapping):
        for value in cast("Mapping[str, Any]", raw).values():
            yield from _iterate_strings(value)
    elif isinstance(raw, Sequence):
        for value in cast("Sequence[Any]", raw):
            yield from _iterate_strings(value)


@lru_cache(maxsize=1)
def open_case(source: Bundle | Path) -> CaseFile:
    """Return the case file of a path, or of a bundle that is unpacked once per process."""
    if isinstance(source, Path):
        return CaseFile.open(source)
    return CaseFile.open(source.unpack(_folders.enter_context(temporary_folder())))


_folders = ExitStack()
"""Temporary folders, removed when the process ends."""

atexit.register(_folders.close)
