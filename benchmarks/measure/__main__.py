"""Measure the tables of ``docs/performance.md``: ``python -m benchmarks.measure [linear contact ...]``.

Writes ``docs/performance.json``; tables that are not named are kept as they were, if the machine is the same.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable

from benchmarks import machine
from benchmarks.measure import (
    accuracy,
    assembly,
    bounds,
    compiler,
    contact,
    derivatives,
    gradients,
    linear,
    modes,
    peaks,
    process,
    saving,
    searches,
    sweep,
)
from benchmarks.processes import ROOT

KEPT = ROOT / "docs/performance.json"
TABLES: dict[str, Callable[[], object]] = {
    "linear": linear.measured,
    "contact": contact.measured,
    "accuracy": accuracy.measured,
    "sweep": sweep.measured,
    "gradients": gradients.measured,
    "derivatives": derivatives.measured,
    "searches": searches.measured,
    "assembly": assembly.measured,
    "modes": modes.measured,
    "peaks": peaks.measured,
    "saving": saving.measured,
    "process": process.measured,
    "compiler": compiler.measured,
}
"""Another table of the page: a file here with ``measured``, a line here, a function in ``docs/make_performance.py``."""


def main() -> None:
    """Measure what is asked for."""
    asked = argparse.ArgumentParser(description="figures of docs/performance.md")
    asked.add_argument(
        "tables",
        nargs="*",
        choices=[[], *TABLES],
        metavar="table",
        help=f"of {', '.join(TABLES)}; all if none is named",
    )
    names = asked.parse_args().tables or list(TABLES)
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        raise SystemExit("the page tells of one thread of linear algebra: set OPENBLAS_NUM_THREADS=1")
    here = machine.described()
    old = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    tables = old.get("tables", {}) if old.get("machine") == here else {}
    for name in names:
        sys.stderr.write(f"measuring {name}\n")
        tables[name] = TABLES[name]()
    content = {"machine": here, "date": machine.today(), "versions": machine.versions("flexcam", "scipy", "numba")}
    content["tables"] = {"bounds": bounds.measured(), **{name: tables[name] for name in TABLES if name in tables}}
    KEPT.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
