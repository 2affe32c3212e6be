"""Every variant is read and checked before the first one runs; all faults of all of them make one report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from flexcam.case import Case, CaseFile
from flexcam.checks import Fault, InputError
from flexcam.sweep.axis import Axis
from flexcam.sweep.plan import Plan

_MANY = 1000
"""Variants above which the ends of the axes are looked at first: reading one takes half a millisecond and more."""

_NAMED = 3
"""Variants and values that a report names."""


@dataclass
class _Group:
    """Variants that are refused for the same reason at the same key."""

    fault: Fault
    variants: list[int] = field(default_factory=list[int])
    given: dict[str, None] = field(default_factory=dict[str, None])


def validated(file: CaseFile, plan: Plan) -> Case:
    """Check every variant of a plan."""
    variants = plan.variants
    if len(variants) > _MANY:  # an unknown key or a wrong unit shows before thousands of variants repeat it
        _check(file, plan, ends(plan))
    _check(file, plan, range(len(variants)))
    return file.read(variants[0])


def _check(file: CaseFile, plan: Plan, some: Sequence[int]) -> None:
    variants, groups = plan.variants, dict[tuple[str, str, str], _Group]()
    for i in some:
        _gather(file, plan, variants[i], i, groups)
    if groups:
        raise InputError(_summed(group, len(some)) for group in groups.values())


def ends(plan: Plan) -> list[int]:
    """Return the variants with the first and the last value of every axis; those of a sample are its first and last."""
    if plan.sample is not None:
        return sorted({0, len(plan) - 1})
    found, stride = {0}, len(plan)
    for count in plan.shape:
        stride //= count
        found.add((count - 1) * stride)
    return sorted(found)


def _gather(
    file: CaseFile, plan: Plan, overrides: Sequence[str], i: int, groups: dict[tuple[str, str, str], _Group]
) -> None:
    try:
        file.read(overrides)
    except InputError as refusal:
        for fault in refusal.faults:
            placed = _placed(fault, plan.axes)
            group = groups.setdefault((placed.where, fault.allowed, fault.why), _Group(placed))
            group.variants.append(i)
            group.given[fault.given] = None


def _placed(fault: Fault, axes: Sequence[Axis]) -> Fault:
    """Return a fault at the option of the axis that it is about; else as it stands in the case."""
    for axis in axes:
        if f"--set {axis.key}=" in fault.where:
            return replace(fault, where=axis.where)
    return fault


def _summed(group: _Group, count: int) -> Fault:
    given = list(group.given)
    more = f" and {len(given) - _NAMED} more" if len(given) > _NAMED else ""
    fault = replace(group.fault, given=", ".join(given[:_NAMED]) + more)
    return replace(fault, why="; ".join(part for part in (fault.why, _which(group.variants, count)) if part))


def _which(variants: Sequence[int], count: int) -> str:
    """Return which of the variants looked at are meant; nothing where it is all of them."""
    if len(variants) == count:
        return ""
    named = ", ".join(str(i + 1) for i in variants[:_NAMED])
    more = f" and {len(variants) - _NAMED} more" if len(variants) > _NAMED else ""
    return f"in variant{'s' if len(variants) > 1 else ''} {named}{more}"
