"""Tables of orders over speed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from rich.table import Table

from flexcam.console.words import NOISE
from flexcam.linalg import FloatArray
from flexcam.orders import Waterfall, ridges
from flexcam.terminal import table
from flexcam.units import shaft_name

_SHOWN = 8
"""Orders in the table: those that grow largest."""


def orders_table(found: Waterfall, scale: float) -> Table:
    """Return the largest orders of a history over speed."""
    shown = sorted(ridges(found, _SHOWN))
    rounding = NOISE * float(np.nanmax(found.amplitudes)) if shown else 0.0
    rows = [
        (f"{scale * rpm:.6g}", *(_number(found.amplitudes[i, n], rounding) for n in (0, *shown)), _part(found, i))
        for i, rpm in enumerate(found.rpm.tolist())
    ]
    what = f"acceleration of {found.signal.name}" if found.signal.probe else found.signal.name
    title = f"Orders of {what}, {found.unit}, in the last revolution: the largest of {found.amplitudes.shape[1] - 1}"
    head = (f"{shaft_name(scale)} rpm", "mean", *(f"order {n}" for n in shown), "not periodic by")
    return table(title, head, rows)


def _number(value: float, rounding: float) -> str:
    """Return an amplitude; what is only the rounding of the largest is nothing."""
    return "-" if math.isnan(value) else f"{0.0 if value < rounding else value:.4g}"


def _part(found: Waterfall, i: int) -> str:
    size = float(found.amplitudes[i, 1:].max())
    return "-" if math.isnan(size) or size <= 0.0 else f"{found.gaps[i] / size:.1%}"


def orders_csv(found: Sequence[Waterfall], scale: float) -> str:
    """Return amplitudes as CSV text, a row per history, speed and order; runs that broke off are left out."""
    lines = [f"history,unit,{shaft_name(scale)} speed [rpm],order,amplitude,not periodic by"]
    for one in found:
        for i, rpm in enumerate((scale * one.rpm).tolist()):
            for n, size in enumerate(one.amplitudes[i].tolist()):
                if not math.isnan(size):
                    lines.append(f"{one.signal.name},{one.unit},{rpm:.10g},{n},{size:.17g},{one.gaps[i]:.17g}")
    return "\n".join(lines) + "\n"


def orders_json(found: Sequence[Waterfall], scale: float) -> dict[str, object]:
    """Return the same as ``--json`` prints it."""
    histories = {
        one.signal.name: {
            "unit": one.unit, "amplitudes": [_or_null(row) for row in one.amplitudes], "open_by": _or_null(one.gaps),
        }
        for one in found
    }  # fmt: skip
    first = found[0]
    ended = [str(status.cause) for status in first.statuses]
    return {
        "shaft": shaft_name(scale),
        "rpm": (scale * first.rpm).tolist(),
        "histories": histories,
        "ended": ended,
    }


def _or_null(values: FloatArray) -> list[float | None]:
    return [None if math.isnan(one) else one for one in np.asarray(values).tolist()]
