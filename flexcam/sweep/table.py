"""What a sweep found: a row per variant, with its inputs, its scalars and how its run ended."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from flexcam.checks import Fault, InputError, did_you_mean, refuse
from flexcam.linalg import FloatArray
from flexcam.response import Status
from flexcam.sweep.evaluate import Row
from flexcam.sweep.plan import Plan


@dataclass(frozen=True, eq=False)
class Column:
    """Values of one varied key, a value per variant.

    Parameters
    ----------
    name
        The key.
    unit
        Of the numbers, as the plan wrote it; empty for SI and for words.
    values
        Shape (variants,): numbers, or texts where a value is none.
    """

    name: str
    unit: str
    values: FloatArray | tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Table:
    """The results of a sweep.

    Parameters
    ----------
    inputs
        The varied keys.
    scalars
        Name to values, SI, shape (variants,); NaN where a variant has none. No file holds a NaN.
    units
        SI unit of each scalar.
    statuses
        How every variant's run ended.
    shape
        Values along every axis of a grid, which runs as its rows do; empty for a sampled plan.
    about
        Case, plan and versions, as texts.
    """

    inputs: tuple[Column, ...]
    scalars: Mapping[str, FloatArray]
    units: Mapping[str, str]
    statuses: tuple[Status, ...]
    shape: tuple[int, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict[str, str])

    def __len__(self) -> int:
        return len(self.statuses)

    def __getitem__(self, name: str) -> FloatArray:
        """Return a scalar of all variants, shape (variants,); NaN where there is none."""
        if name not in self.scalars:
            raise InputError([unknown_scalar(name, self.scalars)])
        return self.scalars[name]

    @property
    def failed(self) -> tuple[int, ...]:
        """Indices of the variants whose runs are not complete."""
        return tuple(i for i, status in enumerate(self.statuses) if not status.ok)

    def on_grid(self, name: str) -> FloatArray:
        """Return a scalar over the axes of a grid."""
        if not self.shape:
            raise refuse("table", "a sampled plan", "a grid", "its points lie on no axes")
        return self[name].reshape(self.shape)

    def keeping(self, names: Sequence[str]) -> Table:
        """Return the table with some of its scalars."""
        kept: dict[str, FloatArray] = {}
        if self.scalars and (unknown := [name for name in names if not begins_one(name, self.scalars)]):
            raise InputError(unknown_scalar(name, self.scalars) for name in unknown)
        for name in names:
            kept |= {one: values for one, values in self.scalars.items() if _under(one, name)}
        units = {name: self.units[name] for name in kept}
        return Table(self.inputs, kept, units, self.statuses, self.shape, self.about)


def tabulated(plan: Plan, rows: Sequence[Row], about: Mapping[str, str] | None = None) -> Table:
    """Return the table of a plan."""
    units = {name: unit for row in reversed(rows) for name, unit in row.units.items()}
    names = list(dict.fromkeys(name for row in rows for name in row.scalars))
    scalars = {name: np.array([row.scalars.get(name, np.nan) for row in rows], dtype=float) for name in names}
    shape = plan.shape if plan.sample is None else ()
    statuses = tuple(row.status for row in rows)
    return Table(_inputs(plan), scalars, {name: units[name] for name in names}, statuses, shape, about or {})


def _inputs(plan: Plan) -> tuple[Column, ...]:
    columns: list[Column] = []
    for axis, values in zip(plan.varied, zip(*plan.points, strict=True), strict=True):
        numbers = [value.number for value in values if value.number is not None]
        told = np.array(numbers, dtype=float) if axis.numeric else tuple(value.text for value in values)
        columns.append(Column(axis.key, axis.unit if axis.numeric else "", told))
    return tuple(columns)


def _under(name: str, asked: str) -> bool:
    return name == asked or name.startswith(f"{asked}.")


def begins_one(name: str, known: Iterable[str]) -> bool:
    """Tell whether a name is that of a scalar, or the beginning of one."""
    return any(_under(one, name) for one in known)


_LISTED = 24
"""Scalars that a message names one by one; of more it names the beginnings."""


def unknown_scalar(name: str, known: Iterable[str]) -> Fault:
    """Return the fault of a scalar that no variant can have."""
    names = list(known)
    parts = [one.split(".") for one in names]
    begins = list(dict.fromkeys(".".join(part[:i]) for part in parts for i in range(1, len(part))))
    groups = list(dict.fromkeys(".".join(part[:2]) for part in parts))
    allowed = ", ".join(names if len(names) <= _LISTED else groups) or "(no run was completed)"
    head = "a name that begins with " if len(names) > _LISTED else ""
    return Fault("scalars", repr(name), head + allowed, "", did_you_mean(name, [*begins, *names]))
