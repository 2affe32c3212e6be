"""Tolerance analysis: variation of a scalar due to the scatter of parts."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexcam.case.case import Case
from flexcam.case.variants import get_number, number_after_override
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, parse_all, refuse
from flexcam.core.units import DIMENSIONS, parse
from flexcam.studies.plan import Sample, check_seed
from flexcam.studies.variables import duplicate_key_faults

_SPEC = re.compile(r"\s*(?:(normal|uniform)\s*:)?\s*(?:±|\+-|\+/-)\s*(\S.*?)\s*$")
_SIGMAS = 3.0  # half width of a normal scatter in standard deviations: 99.7 % of the parts lie within
_TRUNCATION = 5.0  # truncation of a normal scatter in standard deviations: one part in two million lies beyond

QUANTILES = (0.01, 0.05, 0.5, 0.95, 0.99)  # reported quantiles
FORMS = "±2%, ±0.05mm, or normal:±2%"


@dataclass(frozen=True)
class PartScatter:
    """Scatter of a number of a case from part to part."""

    key: str  #: key of the case
    middle: float  #: centre and half width, SI
    half: float
    #: distribution: uniform between both ends, or normal with the ends at three standard deviations
    kind: Literal["uniform", "normal"]

    def value(self, part: float) -> float:
        """Return the quantile for a probability from 0 to 1; `_TRUNCATION` deviations limit a normal scatter."""
        if self.kind == "uniform":
            return self.middle + self.half * (2.0 * part - 1.0)
        from statistics import NormalDist

        tail = NormalDist().cdf(-_TRUNCATION)
        return self.middle + self.half / _SIGMAS * NormalDist().inv_cdf(min(max(part, tail), 1.0 - tail))


def parse_scatters(case: Case, settings: Sequence[str], option: str = "--tolerance") -> tuple[PartScatter, ...]:
    """Parse the scatter of several ``KEY=±SPEC`` texts."""
    scatters, faults = parse_all(lambda setting: _parse_scatter(case, setting, f"{option} {setting}"), settings)
    faults += duplicate_key_faults(option, [scatter.key for scatter in scatters])
    if faults:
        raise InputError(faults)
    return tuple(scatters)


def _parse_scatter(case: Case, setting: str, where: str) -> PartScatter:
    key, equals, spec = setting.partition("=")
    match = _SPEC.match(spec)
    if not equals or match is None:
        raise refuse(where, repr(spec or setting), f"KEY={FORMS}", "", "write it as in springs.valve.stiffness=±5%")
    number = get_number(case, key.strip(), where)
    kind: Literal["uniform", "normal"] = "normal" if match[1] == "normal" else "uniform"
    dimension = next((name for name, entry in DIMENSIONS.items() if entry.si == number.unit), None)
    if match[2].endswith("%"):
        half = abs(number.value) * parse(match[2], "number", where)
    elif dimension is None:
        why = "the unit of this number depends on other keys"
        raise refuse(where, repr(match[2]), "a percentage such as ±2%", why)
    else:
        half = parse(match[2], dimension, where)
    if not half > 0.0:
        raise refuse(where, repr(spec), "a width above zero", "the value would not vary")
    scatter = PartScatter(number.key, number.value, half, kind)
    maximum = 100.0 if kind == "uniform" else 100.0 * _SIGMAS / _TRUNCATION
    if match[2].endswith("%") and half >= 0.01 * maximum * abs(number.value):
        why = "some parts would have zero or the other sign"
        raise refuse(where, repr(spec), f"less than ±{maximum:g} %", why, f"give less, such as {key}=±5%")
    for end in (0.0, 1.0):
        number_after_override(case, number.key, repr(scatter.value(end)), where)  # raises an error for an invalid value
    return scatter


def sample_parts(scatters: Sequence[PartScatter], count: int, seed: int = 0) -> FloatArray:
    """Return sampled numbers of parts, shape (count, scatters)."""
    if count < 8:
        raise refuse("--count", count, "a whole number, at least 8", "mean and spread need more samples")
    parts = Sample("lhs", count, check_seed(seed)).points(len(scatters))
    return np.array([[scatter.value(part) for scatter, part in zip(scatters, row, strict=True)] for row in parts])


@dataclass(frozen=True, eq=False)
class ScalarDistribution:
    """Distribution of a scalar."""

    values: FloatArray  #: values of the valid sets of parts, shape (n,)
    missing: int  #: number of sets without a value: their run failed, or a limit was not met
    mean: float  #: mean and standard deviation
    deviation: float
    quantiles: Mapping[float, float]  #: quantiles for `QUANTILES`
    ranks: FloatArray  #: Spearman rank correlation with each number, shape (k,): sign and strength of its influence


def scalar_distribution(points: FloatArray, values: FloatArray) -> ScalarDistribution:
    """Return the distribution of a scalar over sets of parts."""
    known = ~np.isnan(values)
    data = values[known]
    if len(data) < 2:
        empty, ranks = dict.fromkeys(QUANTILES, math.nan), np.full(points.shape[1], math.nan)
        return ScalarDistribution(data, int((~known).sum()), math.nan, math.nan, empty, ranks)
    quantiles = {part: float(np.quantile(data, part)) for part in QUANTILES}
    from scipy.stats import rankdata

    x, y = (rank - rank.mean(axis=0) for rank in (rankdata(points[known], axis=0), rankdata(data)))
    sizes = np.sqrt((x * x).sum(axis=0) * (y @ y))
    ranks = np.divide(x.T @ y, sizes, out=np.zeros(len(sizes)), where=sizes > 0.0)
    return ScalarDistribution(data, int((~known).sum()), float(data.mean()), float(data.std(ddof=1)), quantiles, ranks)
