"""Scalars asked for by name, held against what the variants can have before any of them runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from flexcam.case import CaseFile
from flexcam.checks import InputError
from flexcam.sweep.plan import Plan
from flexcam.sweep.scalars import scalar_names
from flexcam.sweep.table import begins_one, unknown_scalar
from flexcam.sweep.validate import ends


def check_names(file: CaseFile, plan: Plan, names: Sequence[str]) -> None:
    """Refuse scalars that no variant can have.

    What a case is made of decides which scalars it has, and numbers hardly ever do: variants are looked at only until
    every name is found, the first and the last of every axis and each of the values that are words.
    """
    known, left = dict[str, None](), list(names)
    for one in _told_apart(file, plan) if left else ():
        known |= dict.fromkeys(one)
        left = [name for name in left if not begins_one(name, known)]
        if not left:
            return
    if known:
        faults = [unknown_scalar(name, known) for name in left]
        raise InputError(replace(fault, where="--scalars") for fault in faults)


def _told_apart(file: CaseFile, plan: Plan) -> Iterator[list[str]]:
    """Yield the names that variants can have; one whose parts do not fit together is passed over."""
    variants = plan.variants
    words = [f"{one.key}={value.text}" for one in plan.axes if not one.numeric for value in one.values]
    with_words = [next((i for i, one in enumerate(variants) if word in one), 0) for word in words]
    for i in dict.fromkeys([*ends(plan), *with_words]):
        try:
            yield scalar_names(file.read(variants[i]))
        except InputError:
            continue
