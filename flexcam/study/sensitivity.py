"""Derivatives of what is asked of a case by its numbers: analytic for frequencies, checked differences for the rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexcam.case import Case, CaseFile, build_model
from flexcam.checks import InputError, gathered, refuse
from flexcam.study.differences import STEPS, Derivative, central, logarithmic
from flexcam.study.frequencies import Pair, frequency_derivatives
from flexcam.study.keys import Number, number_of, overrides_of
from flexcam.study.points import Runs, column
from flexcam.study.quantities import complete, frequency_number
from flexcam.sweep import Row
from flexcam.train import Structure, build_structure

_MATRIX_STEP = 1e-3
"""Part of a number by which matrices are differenced: cut off at 1e-12, rounding at 1e-13."""

RELATIVE_STEP = 0.01
"""Part of a number by which responses are differenced: their largest values carry the noise of the time step."""


@dataclass(frozen=True)
class Sensitivity:
    """A derivative of something asked of a case.

    Parameters
    ----------
    scalar, unit, value
        What was asked for, its unit and value.
    by
        The number of the case.
    derivative
        In the scalar's unit per the number's; NaN where there is none.
    error
        Estimate of its error; None where it is analytic.
    logarithmic
        Percent of the scalar per percent of the number; NaN where the scalar is zero.
    smooth
        Whether the scalar looks smooth there; False for frequencies that are the same and part.
    note
        What must be said of it; empty otherwise.
    """

    scalar: str
    unit: str
    value: float
    by: Number
    derivative: float
    error: float | None
    logarithmic: float
    smooth: bool
    note: str


def numbers_of(case: Case, keys: Sequence[str], option: str = "--to") -> list[Number]:
    """Return the numbers that derivatives are taken by."""
    found, faults = gathered(lambda key: _not_zero(number_of(case, key, option), option), dict.fromkeys(keys))
    if faults:
        raise InputError(faults)
    return found


def _not_zero(number: Number, option: str) -> Number:
    if number.value == 0.0:
        why, remedy = "a step is a part of the number", f"give it a small value first: --set {number.key}=..."
        raise refuse(option, f"{number.key} = 0", "a number that is not zero", why, remedy)
    return number


def sensitivities(
    file: CaseFile, fixed: Sequence[str], names: Sequence[str], keys: Sequence[str], runs: Runs,
    *, relative_step: float = RELATIVE_STEP,
) -> list[Sensitivity]:  # fmt: skip
    """Return the derivatives of several scalars by several numbers."""
    if not 1e-8 <= relative_step <= 0.2:
        raise refuse("--relative-step", relative_step, "1e-8 to 0.2", "a part of each number")
    case = file.read(fixed)
    numbers = numbers_of(case, keys)
    frequencies = [name for name in names if frequency_number(name)]
    responses = [name for name in names if name not in frequencies]
    found = {
        (one.scalar, number.key): one
        for number in numbers
        for one in _of_frequencies(file, fixed, case, frequencies, number)
    }
    if responses:
        found |= _of_responses(case, responses, numbers, runs, relative_step)
    return [found[name, number.key] for name in dict.fromkeys(names) for number in numbers]


def _of_frequencies(
    file: CaseFile, fixed: Sequence[str], case: Case, names: Sequence[str], number: Number
) -> list[Sensitivity]:
    if not names:
        return []
    step = abs(number.value) * _MATRIX_STEP
    count = max(frequency_number(name) or 0 for name in names)
    structure = build_structure(build_model(case))
    beside = [_matrices(file, (*fixed, *one), structure) for one in _variants(case, number, step)]
    found = frequency_derivatives((structure.mass, structure.stiffness), beside, step, count, structure.free)
    return [_frequency(name, found.frequencies, found.values, found.repeated, number) for name in names]


def _frequency(
    name: str, frequencies: np.ndarray, values: np.ndarray, repeated: Sequence[bool], number: Number
) -> Sensitivity:
    i = (frequency_number(name) or 0) - 1
    if i >= len(frequencies):
        raise refuse("--of", name, f"frequency.1 to frequency.{len(frequencies)}", "the model has no more modes")
    value, slope = float(frequencies[i]), float(values[i])
    note = "one of several equal frequencies: the slopes are those of their branches" if repeated[i] else ""
    relative = logarithmic(slope, number.value, value)
    return Sensitivity(name, "Hz", value, number, slope, None, relative, not repeated[i], note)


def _matrices(file: CaseFile, overrides: Sequence[str], like: Structure) -> Pair:
    one = build_structure(build_model(file.read(overrides)))
    if one.mass.size != like.mass.size:
        raise refuse(
            "--to", overrides[-1], "a number that leaves the unknowns as they are", "their matrices are compared"
        )
    return one.mass, one.stiffness


def _variants(case: Case, number: Number, step: float) -> list[tuple[str, ...]]:
    return [overrides_of(case, {number.key: repr(number.value + part * step)}) for part in STEPS]


def _of_responses(
    case: Case, names: Sequence[str], numbers: Sequence[Number], runs: Runs, relative_step: float
) -> dict[tuple[str, str], Sensitivity]:
    steps = [abs(number.value) * relative_step for number in numbers]
    variants = [one for number, step in zip(numbers, steps, strict=True) for one in _variants(case, number, step)]
    middle, *rows = runs([(), *variants])
    complete(middle)
    found: dict[tuple[str, str], Sensitivity] = {}
    for i, (number, step) in enumerate(zip(numbers, steps, strict=True)):
        beside = rows[len(STEPS) * i : len(STEPS) * (i + 1)]
        for name in names:
            found[name, number.key] = _response(name, middle, beside, number, step)
    return found


def _response(name: str, middle: Row, beside: Sequence[Row], number: Number, step: float) -> Sensitivity:
    value, unit = middle.scalars.get(name, math.nan), middle.units.get(name, "")
    values = column(beside, name)
    if math.isnan(value) or np.isnan(values).any():
        failed = next((row.status for row in (middle, *beside) if not row.status.ok), None)
        note = "not known on both sides: " + (str(failed) if failed else "it is not met in the range looked at")
        return Sensitivity(name, unit, value, number, math.nan, None, math.nan, False, note)
    found: Derivative = central(value, values, step)
    note = "" if found.smooth else "not smooth here: contacts that open or close, or noise; a derivative means little"
    relative = logarithmic(found.value, number.value, value)
    return Sensitivity(name, unit, value, number, found.value, found.error, relative, found.smooth, note)
