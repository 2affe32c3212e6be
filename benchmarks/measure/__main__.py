"""Measure the tables of ``docs/performance.md``: ``python -m benchmarks.measure [linear contact ...]``.

The command writes ``docs/performance.json``. On the same machine, tables that are not named keep their values.
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
    commands,
    contact,
    derivatives,
    gradients,
    linear,
    memory,
    modes,
    saving,
    searches,
    sweep,
)
from benchmarks.processes import ROOT

FIGURES = ROOT / "docs/performance.json"
TABLES: dict[str, Callable[[], object]] = {
    "linear": linear.measure_table,
    "contact": contact.measure_table,
    "accuracy": accuracy.measure_table,
    "sweep": sweep.measure_table,
    "gradients": gradients.measure_table,
    "derivatives": derivatives.measure_table,
    "searches": searches.measure_table,
    "assembly": assembly.measure_table,
    "modes": modes.measure_table,
    "peaks": memory.measure_table,
    "saving": saving.measure_table,
    "process": commands.measure_table,
    "compiler": commands.measure_compilation,
}
"""A new table needs a file here with ``measure_table``, a line here and a function in ``docs/make_performance.py``."""


def main() -> None:
    """Measure the tables that the command line names."""
    parser = argparse.ArgumentParser(description="figures of docs/performance.md")
    parser.add_argument(
        "tables", nargs="*", choices=[[], *TABLES], metavar="table", help=f"of {', '.join(TABLES)}; default: all"
    )
    names = parser.parse_args().tables or list(TABLES)
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        raise SystemExit("the page has times of one thread of linear algebra: set OPENBLAS_NUM_THREADS=1")
    description = machine.describe()
    old = json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.exists() else {}
    tables = old.get("tables", {}) if old.get("machine") == description else {}
    for name in names:
        sys.stderr.write(f"measuring {name}\n")
        tables[name] = TABLES[name]()
    packages = machine.package_versions("flexcam", "scipy", "numba")
    content = {"machine": description, "date": machine.today(), "versions": packages}
    named = {name: tables[name] for name in TABLES if name in tables}
    content["tables"] = {"bounds": machine.measure_limits(), **named}
    FIGURES.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
