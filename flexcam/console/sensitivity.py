"""Tables of derivatives, of shares of variance and of scatter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from flexcam.console.told import Told, csv_of, or_none, shown
from flexcam.linalg import FloatArray
from flexcam.study import QUANTILES, Quantity, Scatter, Sensitivity, SobolIndices, Variable, column, spread
from flexcam.sweep import Row
from flexcam.terminal import table


def told_derivatives(found: Sequence[Sensitivity]) -> Told:
    """Return derivatives as tables."""
    names = list(dict.fromkeys(one.scalar for one in found))
    tables = [_derivatives(name, [one for one in found if one.scalar == name]) for name in names]
    words = [f"{one.scalar} by {one.by.key}: {one.note}" for one in found if one.note]
    head = ("scalar", "unit", "value", "key", "key unit", "key value", "derivative", "error", "logarithmic", "smooth")
    rows = [
        (one.scalar, one.unit, one.value, one.by.key, one.by.unit, one.by.value, one.derivative,
         math.nan if one.error is None else one.error, one.logarithmic, one.smooth)
        for one in found
    ]  # fmt: skip
    return Told(tables, words, {"derivatives": [_json(one) for one in found]}, csv_of(head, rows))


def _derivatives(name: str, found: Sequence[Sensitivity]):  # noqa: ANN202 - a table of rich
    ordered = sorted(found, key=lambda one: -abs(one.logarithmic) if not math.isnan(one.logarithmic) else math.inf)
    rows = [
        (one.by.key, f"{shown(one.by.value)} {one.by.unit}".strip(), f"{shown(one.derivative)} {_per(one)}".strip(),
         "analytic" if one.error is None and not math.isnan(one.derivative) else shown(_error(one), 2),
         _percent(one.logarithmic), "" if one.smooth else _doubt(one))
        for one in ordered
    ]  # fmt: skip
    title = f"{name} = {shown(found[0].value)} {_unit(found[0])}".rstrip()
    return table(title, ("by", "at", "derivative", "error", "% per %", ""), rows)


def _unit(one: Sensitivity) -> str:
    """Return the unit of what was asked for; nothing for a plain number."""
    return "" if one.unit == "1" else one.unit


def _per(one: Sensitivity) -> str:
    """Return the unit of a derivative."""
    return f"{_unit(one)} per {one.by.unit}" if one.by.unit else _unit(one)


def _error(one: Sensitivity) -> float:
    return math.nan if one.error is None else one.error


def _doubt(one: Sensitivity) -> str:
    if math.isnan(one.derivative):
        return "not known"
    return "equal frequencies" if one.error is None else "not smooth"


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:+.4f}"


def _json(one: Sensitivity) -> dict[str, object]:
    return {
        "scalar": one.scalar, "unit": one.unit, "value": or_none(one.value), "key": one.by.key,
        "key_unit": one.by.unit, "key_value": one.by.value, "derivative": or_none(one.derivative),
        "error": None if one.error is None else or_none(one.error), "logarithmic": or_none(one.logarithmic),
        "analytic": one.error is None and not math.isnan(one.derivative), "smooth": one.smooth, "note": one.note,
    }  # fmt: skip


def told_shares(names: Sequence[str], variables: Sequence[Variable], found: Sequence[SobolIndices]) -> Told:
    """Return Sobol indices as tables."""
    keys = [one.key for one in variables]
    tables = [
        table(
            f"Shares of the variance of {name} (standard deviation {shown(math.sqrt(one.variance))})",
            ("by", "interval", "alone", "95 %", "with others", "95 %"),
            [
                (key, f"{variable.low:g} to {variable.high:g} {variable.unit}", f"{one.first[i]:.3f}",
                 _interval(one.first_interval[:, i]), f"{one.total[i]:.3f}", _interval(one.total_interval[:, i]))
                for i, (key, variable) in enumerate(zip(keys, variables, strict=True))
            ],
        )
        for name, one in zip(names, found, strict=True)
    ]  # fmt: skip
    words = [
        f"{name}: {one.used} of {one.asked} base points count: others failed, or their number is no power of 2"
        for name, one in zip(names, found, strict=True)
        if one.used < one.asked
    ]
    rows = [
        (name, key, float(one.first[i]), *one.first_interval[:, i].tolist(), float(one.total[i]),
         *one.total_interval[:, i].tolist())
        for name, one in zip(names, found, strict=True)
        for i, key in enumerate(keys)
    ]  # fmt: skip
    head = ("scalar", "key", "first", "first_low", "first_high", "total", "total_low", "total_high")
    json = {
        name: {
            "variance": one.variance, "used": one.used, "asked": one.asked,
            "indices": [dict(zip(head[1:], row[1:], strict=True)) for row in rows if row[0] == name],
        }
        for name, one in zip(names, found, strict=True)
    }  # fmt: skip
    return Told(tables, words, {"sobol": json}, csv_of(head, rows))


def _interval(ends: FloatArray) -> str:
    return f"{ends[0]:.3f} to {ends[1]:.3f}"


def _stands(middle: Mapping[str, Quantity], name: str) -> float:
    return middle[name].value if name in middle else math.nan


def told_scatter(
    names: Sequence[str],
    scatters: Sequence[Scatter],
    parts: FloatArray,
    rows: Sequence[Row],
    middle: Mapping[str, Quantity],
) -> Told:
    """Return the scatter of scalars as a table."""
    values = np.column_stack([column(rows, name) for name in names])
    units = {name: one.unit for name, one in middle.items()}
    units |= {
        name: next((row.units[name] for row in rows if name in row.units), "") for name in names if name not in units
    }
    found = {name: spread(parts, values[:, i]) for i, name in enumerate(names)}
    told = [
        (name, units[name], shown(_stands(middle, name)), shown(one.mean), shown(one.deviation, 4),
         *(shown(one.quantiles[part]) for part in QUANTILES), str(one.missing))
        for name, one in found.items()
    ]  # fmt: skip
    head = ("scalar", "unit", "as it stands", "mean", "std", *(f"{part:.0%}" for part in QUANTILES), "missing")
    ranks = [(one.key, *(shown(float(found[name].ranks[i]), 3) for name in names)) for i, one in enumerate(scatters)]
    tables = [
        table(f"Scatter over {len(parts)} sets of parts", head, told),
        table("Rank correlation with each part: which it follows, and which way", ("part", *names), ranks),
    ]
    words = [
        f"{name}: {one.missing} sets have no number: their run failed, or the limit is not met in the range looked at"
        for name, one in found.items()
        if one.missing
    ]
    keys = [one.key for one in scatters]
    columns = (*keys, *names, "status")
    body = [
        (*point, *value, str(row.status.cause))
        for point, value, row in zip(parts.tolist(), values.tolist(), rows, strict=True)
    ]
    json = {
        name: {
            "unit": units[name], "value": or_none(_stands(middle, name)), "mean": or_none(one.mean),
            "std": or_none(one.deviation), "missing": one.missing, "count": len(parts),
            "quantiles": {f"{part:g}": or_none(value) for part, value in one.quantiles.items()},
            "rank_correlation": {key: or_none(x) for key, x in zip(keys, one.ranks.tolist(), strict=True)},
        }
        for name, one in found.items()
    }  # fmt: skip
    return Told(tables, words, {"scatter": json}, csv_of(columns, body))
