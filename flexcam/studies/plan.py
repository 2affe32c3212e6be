"""Plan of a sweep: axes of keys, their combination or sampling, rows of results, and the case as data for workers.

An axis follows from ``--set KEY=SPEC``:

========================  ==================================================================
``1000:8000:50rpm``       start, stop and step; the stop is included if it is on the grid
``8000:1000:-50rpm``      descending
``1000:8000#141rpm``      number of values, evenly spaced from start to stop
``30,40,50 kN/m``         a list; a unit at its end applies to all numbers without one
``newmark,bathe``         a list of words or of other TOML values
``30:60 kN/m``            an interval, for sampled plans
``2``                     one value, set in every variant
========================  ==================================================================

Numbers are decimal, so that 0.1:0.5:0.1 ends with 0.5. The values remain texts such as ``1050rpm``, which the case
checks.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import re
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from decimal import Context, Decimal
from functools import cached_property, lru_cache
from itertools import product
from math import prod
from pathlib import Path, PurePosixPath
from typing import Literal, NamedTuple, cast

from flexcam.case.case import Case
from flexcam.case.fault_report import iterate_values
from flexcam.case.reader import CaseFile
from flexcam.core.errors import Fault, InputError, parse_all, refuse, suggest_name
from flexcam.dynamics import Cause, RunFailedError, Status, reraise_interrupt
from flexcam.io import find_referenced_file, temporary_folder

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_UNIT = r"\s*((?:[A-Za-z%µ°]|(?<=\s)1\s*/)[^:#,]*?)?\s*"
_QUANTITY = re.compile(rf"\s*({_NUMBER}){_UNIT}$")
_RANGE = re.compile(rf"\s*({_NUMBER}){_UNIT}:\s*({_NUMBER}){_UNIT}(?::\s*({_NUMBER}){_UNIT}|#\s*(\d{{1,15}}){_UNIT})?$")
_LIKE_A_RANGE = re.compile(rf"\s*{_NUMBER}[^,:]*:")
_DIGITS = Context(prec=17)
_SAMPLED = Context(prec=10)
_MAX_EXPONENT = 300  # maximum exponent of a number
_MIN_FIXED_EXPONENT, _MAX_FIXED_EXPONENT = -6, 16  # range of decimal exponents written in fixed notation

_MANY = 10**15

MAX_VARIANTS = 10_000  # default maximum number of variants
FORMS = "a range 1000:8000:50rpm or 1000:8000#141rpm, a list 30,40,50 kN/m, an interval 30:60 kN/m, or one value"


class Value(NamedTuple):
    """Value of an axis: the text of the override, and its number in the unit of the axis if it is numeric."""

    text: str
    number: float | None


@dataclass(frozen=True)
class Axis:
    """Values of one key of a case in a sweep."""

    key: str  #: key, such as ``run.crank_speed``
    where: str  #: source for messages: ``--set run.crank_speed=1000:8000:50rpm``, or a line of the case
    values: tuple[Value, ...]  #: values; for an interval, its two ends
    unit: str = ""  #: unit of the numbers as given; empty for SI or for words
    interval: bool = False  #: whether values between the two ends are allowed

    @property
    def is_varied(self) -> bool:
        """Return whether the axis has more than one value."""
        return len(self.values) > 1

    @property
    def is_numeric(self) -> bool:
        """Return whether every value is a number in the unit of the axis."""
        return all(value.number is not None for value in self.values)

    def at(self, part: float) -> Value:
        """Return the value at a fraction of the axis, for a sampled plan."""
        if not self.interval:
            return self.values[min(int(part * len(self.values)), len(self.values) - 1)]
        low, high = (Decimal(repr(value.number)) for value in self.values)
        return _quantity(_SAMPLED.plus(low + Decimal(part) * (high - low)), self.unit)


def parse_axis(key: str, spec: str, *, where: str = "", limit: int = MAX_VARIANTS) -> Axis:
    """Return the axis of one key."""
    place = where or f"--set {key}={spec}"
    if not spec.strip():
        raise refuse(place, repr(spec), FORMS, "the range is empty")
    if match := _RANGE.match(spec):
        return _range(key, place, match, limit)
    if _LIKE_A_RANGE.match(spec):
        raise refuse(place, repr(spec), FORMS, "", "write start:stop:step, start:stop#count or start:stop, then a unit")
    return _list(key, place, spec, limit)


def parse_axes(settings: Sequence[str], *, limit: int = MAX_VARIANTS, option: str = "--set") -> tuple[Axis, ...]:
    """Return the axes of several ``key=spec``."""
    axes = dict[str, Axis]()

    def read(setting: str) -> None:
        key, equals, spec = setting.partition("=")
        key, where = key.strip(), f"{option} {setting}"
        if not equals or not key:
            raise refuse(where, repr(setting), f"key=values: {FORMS}", "", "write run.speed=1000:4000:50rpm")
        if key in axes:
            raise refuse(where, repr(key), "every key once", "it is given twice", "write a list")
        axes[key] = parse_axis(key, spec, where=where, limit=limit)

    parse_all(read, settings)
    return tuple(axes.values())


def _range(key: str, where: str, match: re.Match[str], limit: int) -> Axis:
    start, stop, step = (Decimal(match[i] or 0) for i in (1, 3, 5))
    if any(abs(number.adjusted()) > _MAX_EXPONENT for number in (start, stop, step)):
        raise refuse(where, match[0].strip(), FORMS, "its exponent is too large")
    units = {unit for unit in match.group(2, 4, 6, 8) if unit}
    if len(units) > 1:
        raise refuse(where, " and ".join(sorted(units)), "one unit, at the end", "a range has one unit")
    unit = "".join(units)
    if match[7]:
        count = int(match[7])
        if count < 2 or start == stop:
            given = f"{count} values from {start} to {stop}"
            raise refuse(where, given, "two values or more, from a start to another stop", "the range is empty")
        check_count(where, count, limit)
        numbers = [start + (stop - start) * i / (count - 1) for i in range(count)]
    elif match[5]:
        if step == 0:
            raise refuse(where, "a step of zero", "a step that leads from start to stop", "the range has no end")
        steps = (stop - start) / step
        if steps < 0:
            given = f"a step of {step} and a stop {'below' if step > 0 else 'above'} the start"
            remedy = f"swap start and stop, or use a step of {-step}"
            raise refuse(where, given, "a step that leads from start to stop", "the range is empty", remedy)
        check_count(where, int(steps) + 1, limit)
        numbers = [start + i * step for i in range(int(steps) + 1)]
    elif start >= stop:
        allowed, remedy = "the lower end first", f"write {stop}:{start}{unit}"
        allowed, remedy = ("two different ends", "widen the interval") if start == stop else (allowed, remedy)
        raise refuse(where, match[0].strip(), allowed, "", remedy)
    else:
        return Axis(key, where, (_quantity(start, unit), _quantity(stop, unit)), unit, interval=True)
    return Axis(key, where, tuple(_quantity(_DIGITS.plus(number), unit) for number in numbers), unit)


def check_count(where: str, count: int, limit: int) -> None:
    """Raise an error if the number of runs exceeds the limit."""
    if count > limit:
        given = f"{count} variants" if count < _MANY else "more variants than could ever be run"
        remedy = f"use fewer values, or allow them with --limit {count}" if count < _MANY else "use fewer values"
        raise refuse(where, given, f"up to {limit}", "each is a run", remedy)


def _list(key: str, where: str, spec: str, limit: int) -> Axis:
    parts = [part.strip() for part in _split(spec)]
    if not all(parts):
        raise refuse(where, repr(spec), FORMS, "a value between the commas is missing")
    check_count(where, len(parts), limit)
    matches = [_QUANTITY.match(part) for part in parts]
    units = [m[2] if m else None for m in matches]
    unit = units[-1] or ""
    if all(matches) and any(units) and not unit:
        why = "some numbers have a unit and the last one has none"
        raise refuse(where, repr(spec), FORMS, why, "give each its unit")
    texts = [_join_unit(part, unit) if m and not m[2] else part for part, m in zip(parts, matches, strict=True)]
    if all(matches) and set(units) <= {None, unit or None}:
        numbers = [float(m[1]) for m in matches if m]
        return Axis(key, where, tuple(map(Value, texts, numbers)), unit)
    return Axis(key, where, tuple(Value(text, None) for text in texts))


def _split(spec: str) -> list[str]:
    """Split a text at commas outside of brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for sign in spec:
        if quote or sign in "\"'":
            quote = "" if sign == quote else quote or sign
        else:
            depth += (sign in "[{") - (sign in "]}")
        if sign == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += sign
    return parts


def _quantity(number: Decimal, unit: str) -> Value:
    """Return a number with its unit, in fixed notation up to sixteen digits, so that integers remain integers."""
    plain = number.normalize() if number else Decimal(0)
    text = f"{plain:f}" if _MIN_FIXED_EXPONENT <= plain.adjusted() < _MAX_FIXED_EXPONENT else f"{plain}"
    return Value(_join_unit(text, unit), float(plain))


def _join_unit(number: str, unit: str) -> str:
    """Join a number and its unit; a blank is required before "1/s"."""
    return f"{number} {unit}" if unit[:1] == "1" else f"{number}{unit}"


@dataclass(frozen=True)
class Sample:
    """Sampling method."""

    kind: Literal["lhs", "sobol"]  #: Latin hypercube or Sobol sequence of `scipy.stats.qmc`, scrambled
    count: int  #: number of points; a power of two for a Sobol sequence, which is balanced then
    seed: int = 0  #: seed of the random generator

    def points(self, dimensions: int) -> list[list[float]]:
        """Return `count` points of the unit cube, with coordinates from 0 to less than 1."""
        import numpy as np
        from scipy.stats import qmc

        kind = qmc.Sobol if self.kind == "sobol" else qmc.LatinHypercube
        points = kind(dimensions, seed=np.random.default_rng(self.seed)).random(self.count)
        return points.tolist()


def parse_sample(text: str, seed: int = 0) -> Sample:
    """Parse a sampling method."""
    allowed = "lhs:N (Latin hypercube) or sobol:N (Sobol's sequence), such as sobol:512"
    match = re.match(r"(lhs|sobol):([1-9]\d{0,14})$", text.strip())
    if match is None:
        raise refuse("--sample", repr(text), allowed, "", suggest_name(text.partition(":")[0], ["lhs", "sobol"]))
    kind, count = cast("Literal['lhs', 'sobol']", match[1]), int(match[2])
    if kind == "sobol":
        check_power_of_two("--sample", count)
    return Sample(kind, count, check_seed(seed))


def check_power_of_two(where: str, count: int, least: int = 1) -> None:
    """Raise an error if a number of points is not a power of two."""
    if count < least or count & (count - 1):
        below = 1 << (max(count, least).bit_length() - 1)
        why = "other numbers of points do not cover the space evenly"
        raise refuse(where, count, f"a power of two, {least} or more", why, f"use {below} or {2 * below}")


def check_seed(seed: int) -> int:
    """Return a random seed after checking it."""
    if seed < 0:
        raise refuse("--seed", seed, "a whole number, at least 0", "the random generator accepts no other number")
    return seed


@dataclass(frozen=True)
class Plan:
    """Variants of a case: axes and the combination of their values."""

    axes: tuple[Axis, ...]  #: one axis per key; axes of one value apply to every variant
    sample: Sample | None = None  #: sampling method; None for all combinations, with the last axis varying fastest

    @property
    def varied_axes(self) -> tuple[Axis, ...]:
        """Axes with more than one value."""
        return tuple(axis for axis in self.axes if axis.is_varied)

    @property
    def fixed(self) -> tuple[str, ...]:
        """Overrides of every variant, as ``key=value``."""
        return tuple(f"{axis.key}={axis.values[0].text}" for axis in self.axes if not axis.is_varied)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along every varied axis of a grid; for sampled points, their number."""
        return tuple(len(axis.values) for axis in self.varied_axes) if self.sample is None else (self.sample.count,)

    def __len__(self) -> int:
        return prod(self.shape)

    @cached_property
    def points(self) -> tuple[tuple[Value, ...], ...]:
        """Values of the varied axes, a row per variant."""
        if self.sample is None:
            return tuple(product(*(axis.values for axis in self.varied_axes)))
        if not self.varied_axes:
            return ((),) * len(self)
        parts = self.sample.points(len(self.varied_axes))
        return tuple(tuple(axis.at(part) for axis, part in zip(self.varied_axes, row, strict=True)) for row in parts)

    @property
    def variants(self) -> tuple[tuple[str, ...], ...]:
        """Overrides of every variant, for `flexcam.read_case`."""
        keys, fixed = [axis.key for axis in self.varied_axes], self.fixed
        return tuple(
            (*fixed, *(f"{key}={value.text}" for key, value in zip(keys, row, strict=True))) for row in self.points
        )


def _interval_remedy(axis: Axis) -> str:
    low, high = (f"{value.number:.10g}" for value in axis.values)
    many = f"give a number of values, as in {low}:{high}#5{axis.unit}, or a step"
    return f"{many}; flexcam sweep --sample draws values from an interval"


def make_plan(axes: Sequence[Axis], sampled: Sample | None = None, *, limit: int = MAX_VARIANTS) -> Plan:
    """Return a plan after checking the number of variants."""
    plan = Plan(tuple(axes), sampled)
    if sampled is None and (intervals := [axis for axis in axes if axis.interval]):
        given, allowed = "an interval", "a range with a step, or a list"
        raise InputError(Fault(axis.where, given, allowed, "", _interval_remedy(axis)) for axis in intervals)
    if not plan.varied_axes:
        given = " ".join(axis.where for axis in axes) or "no --set"
        key = next((axis.key for axis in axes if axis.key in ("run.speed", "run.crank_speed")), "run.crank_speed")
        raise refuse("sweep", given, "at least one key with several values", "nothing varies",
                     f"write start:stop:step, such as --set {key}=1000:4000:500rpm")  # fmt: skip
    check_count("--sample" if sampled else "sweep", len(plan), limit)
    return plan


# Tangents at extremes of the history of a scalar, SI: difference from the scalar, and derivatives by all numbers.
Planes = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Row:
    """Results of one variant."""

    status: Status  #: status of its run; ``refused`` if it could not start
    #: value by name, SI (`flexcam.studies.evaluation`); empty unless the run is complete
    scalars: Mapping[str, float] = field(default_factory=dict[str, float])
    units: Mapping[str, str] = field(default_factory=dict[str, str])  #: SI unit by scalar
    seconds: float = 0.0  #: run time; not written to tables, which are the same on every machine
    history: tuple[str, bytes] | None = None  #: suffix and content of its result file, if result files are kept
    #: derivatives of a scalar by the numbers of a gradient search, SI; empty without them, and `status` says why
    derivatives: Mapping[str, tuple[float, ...]] = field(default_factory=dict[str, tuple[float, ...]])
    #: other local extremes of the history whose extreme a scalar is
    extremes: Mapping[str, Planes] = field(default_factory=dict[str, Planes])


def catch_errors(compute: Callable[[], Row]) -> Row:
    """Return a computed row with its time; a refusal or a failed run becomes its status."""
    start = time.perf_counter()
    try:
        row = compute()
    except InputError as refusal:
        row = Row(Status(Cause.REFUSED, " | ".join(map(str, refusal.faults))))
    except RunFailedError as failure:
        row = Row(failure.status)
    reraise_interrupt(row.status)
    return replace(row, seconds=time.perf_counter() - start)


def catch_all_errors(compute: Callable[[], Row]) -> Row:
    """Return a computed row as `catch_errors` does; exhausted memory or a fault of flexcam becomes its status, too."""
    start = time.perf_counter()
    try:
        return catch_errors(compute)
    except MemoryError:
        row = Row(Status(Cause.OUT_OF_MEMORY, "the memory was exhausted", "save fewer fields, or run fewer at a time"))
    except Exception as fault:  # noqa: BLE001 - a fault in one variant must not cost the others
        last = traceback.extract_tb(fault.__traceback__)[-1]
        text = f"a fault of flexcam itself: {type(fault).__name__}: {fault} ({Path(last.filename).name}:{last.lineno})"
        row = Row(Status(Cause.FAULT, text, "please report it; flexcam run with the same keys shows more"))
    return replace(row, seconds=time.perf_counter() - start)


def evaluate_each(
    source: Bundle | Path, variants: Sequence[tuple[str, ...]], evaluate: Callable[[Case], Row],
    fixed: tuple[str, ...] = (),
) -> list[Row]:  # fmt: skip
    """Return the rows of variants of a case, in a worker; file names in messages are those in the case."""
    file, rows = open_case(source), list[Row]()
    for overrides in variants:
        row = catch_errors(lambda variant=overrides: evaluate(file.read((*fixed, *variant))))
        text = row.status.text.replace(f"{file.path.parent}/", "")
        rows.append(replace(row, status=replace(row.status, text=text)))
    return rows


@dataclass(frozen=True)
class Bundle:
    """Case file and all files it refers to."""

    name: str  #: name of the case file
    digest: str  #: hash of the content
    #: content by path relative to the folder of the case file, with ``/``; includes the case itself
    files: Mapping[str, bytes] = field(compare=False)

    def unpack(self, folder: Path) -> Path:
        """Write the files into a folder with their relative paths, and return the case file."""
        ups = max(PurePosixPath(path).parts.count("..") for path in self.files)
        home = folder.joinpath(*["up"] * ups)
        for path, content in self.files.items():
            target = Path(os.path.normpath(home / path))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
        return home / self.name


def make_bundle(file: CaseFile, plan: Plan | None = None, overrides: Sequence[str] = ()) -> Bundle:
    """Return a case with its files as plain data, and those that a plan or overrides name."""
    texts = [value.text for axis in plan.axes for value in axis.values] if plan else []
    texts += [override.partition("=")[2] for override in overrides]
    names = [value for _, value in iterate_values(file.raw) if isinstance(value, str)]
    names += [text.strip(" \"'") for text in texts]
    files = {file.path.name: file.text.encode()}
    for text in dict.fromkeys(names):
        if not os.path.isabs(text) and (referenced := find_referenced_file(file.path, text)):
            files[PurePosixPath(Path(os.path.normpath(text))).as_posix()] = referenced.read_bytes()
    digest = hashlib.sha256()
    for path, content in sorted(files.items()):
        digest.update(f"{path} {len(content)}\n".encode())
        digest.update(content)
    return Bundle(file.path.name, digest.hexdigest(), files)


@lru_cache(maxsize=1)
def open_case(source: Bundle | Path) -> CaseFile:
    """Return the case file of a path, or of a bundle that is unpacked once per process."""
    if isinstance(source, Path):
        return CaseFile.open(source)
    return CaseFile.open(source.unpack(_folders.enter_context(temporary_folder())))


_folders = ExitStack()  # temporary folders, removed when the process ends

atexit.register(_folders.close)
