"""Sobol indices: which share of a scalar's variance each number of a case brings about, alone and together."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexcam.checks import refuse
from flexcam.linalg import FloatArray
from flexcam.sweep import checked_seed

_CONFIDENCE = 0.95
_RESAMPLES = 499


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Indices of one scalar.

    Parameters
    ----------
    first, total
        Share of the variance that a variable brings about alone, and with all it acts together with, shape (k,).
    first_interval, total_interval
        Low and high ends of the 95 % intervals by bootstrap, shape (2, k).
    variance
        Of the scalar; indices are zero where it is.
    used
        Base points used: a power of two, after those were left out at which something failed.
    asked
        Base points asked for.
    """

    first: FloatArray
    total: FloatArray
    first_interval: FloatArray
    total_interval: FloatArray
    variance: float
    used: int
    asked: int


Function = Callable[[FloatArray], FloatArray]
"""Points of the unit cube, shape (m, k), to values of s scalars, shape (m, s); NaN where there is none."""


def sobol_indices(function: Function, dimensions: int, count: int, *, seed: int = 0) -> list[SobolIndices]:
    """Return the Sobol indices of scalars over the unit cube.

    Variables are taken as independent and even over their intervals. Points are those of a scrambled Sobol sequence;
    estimators and bootstrap are those of `scipy.stats.sobol_indices`: A. Saltelli et al., Comput. Phys. Commun. 181
    (2010) 259.
    """
    checked_count(count)
    checked_seed(seed)
    a, b, mixed = _points(dimensions, count, seed)
    each = np.stack([a, b, *mixed], axis=1)  # base point by base point: a study that is stopped has whole ones
    parts = function(each.reshape(-1, dimensions)).reshape(count, dimensions + 2, -1)
    return [_indices(parts[:, :, i].T, count, seed) for i in range(parts.shape[2])]


def checked_count(count: int) -> None:
    """Refuse a number of base points that Sobol's sequence does not have."""
    if count < 2 or count & (count - 1):
        near = f"{1 << (max(count, 2).bit_length() - 1)} or {1 << max(count, 2).bit_length()}"
        raise refuse("--sobol", count, "a power of two from 2", "Sobol's sequence is even over the space there", near)


def _points(dimensions: int, count: int, seed: int) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
    """Return the points A and B, and per variable A with the column of B."""
    from scipy.stats import qmc

    both = qmc.Sobol(2 * dimensions, seed=np.random.default_rng(seed)).random(count)
    a, b = both[:, :dimensions], both[:, dimensions:]
    own = np.eye(dimensions, dtype=bool)
    return a, b, [np.where(own[i], b, a) for i in range(dimensions)]


def _indices(values: FloatArray, asked: int, seed: int) -> SobolIndices:
    """Return the indices from values at A, B and the mixed points, shape (k + 2, n)."""
    from scipy import stats

    whole = values[:, ~np.isnan(values).any(axis=0)]
    used = 1 << (whole.shape[1].bit_length() - 1) if whole.shape[1] else 0
    if used < 2:
        given = f"{whole.shape[1]} of {asked} base points with a number"
        raise refuse("--sobol", given, "two or more", "the others failed", "narrow the intervals, or take more points")
    a, b, mixed = whole[:1, :used], whole[1:2, :used], whole[2:, None, :used]
    k, variance = len(mixed), float(np.var(np.concatenate([a, b])))
    if variance <= 0.0:
        nothing = np.zeros(k)
        return SobolIndices(nothing, nothing, np.zeros((2, k)), np.zeros((2, k)), 0.0, used, asked)
    several = (
        mixed if k > 1 else np.repeat(mixed, 2, axis=0)
    )  # of a single variable scipy makes bare numbers, and fails
    found = stats.sobol_indices(func={"f_A": a, "f_B": b, "f_AB": several}, n=used, rng=np.random.default_rng(seed))
    first, total = np.ravel(found.first_order)[:k], np.ravel(found.total_order)[:k]
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a variable without any effect has nothing to resample
        ends = found.bootstrap(confidence_level=_CONFIDENCE, n_resamples=_RESAMPLES)
    intervals = [
        _interval(one.confidence_interval.low, one.confidence_interval.high, index)
        for one, index in ((ends.first_order, first), (ends.total_order, total))
    ]
    return SobolIndices(first, total, intervals[0], intervals[1], variance, used, asked)


def _interval(low: ArrayLike, high: ArrayLike, index: FloatArray) -> FloatArray:
    """Return both ends, shape (2, k); the index itself where resampling gave none."""
    both = np.array([np.ravel(low)[: len(index)], np.ravel(high)[: len(index)]], dtype=float)
    return np.where(np.isfinite(both), both, index)
