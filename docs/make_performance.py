"""Make ``docs/performance.md`` from ``docs/performance.json`` and ``docs/performance-peers.json``.

``python docs/make_performance.py --measure`` first measures the former anew, which takes some minutes; the latter is
made by ``make bench-peers``. A table is a function here and a file in ``benchmarks/measure``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from textwrap import fill

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
MEASURED = ROOT / "docs/performance.json"
PEERS = ROOT / "docs/performance-peers.json"
PAGE = ROOT / "docs/performance.md"
WIDTH = 120

HEAD = """# What a run costs

Made by `docs/make_performance.py` from figures that `make performance` and `make bench-peers` measure. All are of one
thread of linear algebra, and the least of some repeats: others use the machine too, which makes times longer, never
shorter. Ratios are of one run on one machine; do not compare the figures of different ones.
"""


def page(measured: dict, peers: dict) -> str:
    """Return the text of the page."""
    tables = measured.get("tables", {})
    lines = [HEAD, *_peers(peers), *_machine(measured)]
    for name, make in SECTIONS.items():
        if name in tables:
            lines += make(tables)
    return "\n".join(lines)


def _peers(found: dict) -> list[str]:
    """Return the comparison with other solvers."""
    if not found:
        return []
    own, rows = found["solvers"][0], []
    for one in found["solvers"]:
        if one["missing"]:
            rows.append(f"| {one['title']} | {one['missing']} | | | | | |")
            continue
        few = "" if one["b5_speeds"] == 100 else f" (from {one['b5_speeds']})"
        rows.append(
            f"| {one['title']} | {_number(one['us_per_step'])} | {_number(one['us_per_step'] / own['us_per_step'])} | "
            f"{one['process_s']:.2f} | {_number(one['b5_s'])}{few} | {_number(one['b5_s'] / own['b5_s'])} | "
            f"{_agreement(one)} |"
        )
    allowed = ", ".join(f"{limit:g} on {work}" for work, limit in found["tolerance"].items())
    return [
        "## Beside other solvers",
        "",
        fill(_on(found), WIDTH),
        "",
        "B1: a steel shaft 0.5 m long and 25 mm thick between two bearings, ten Euler-Bernoulli elements, consistent mass,",
        "0.2 kg at its middle and there Fy = 500 N (1 - cos wt) and Tx = 3 N m sin wt, w = 2 pi 25/s; Newmark 1/4, 1/2,",
        "undamped, 7200 steps of 1/3600 turn, 60 unknowns. B5: the same at 100 speeds from 500 to 5000 rpm. All start from",
        "rest and keep uy and rx of the middle. flexcam and OpenSees make their own elements, the others take matrices.",
        "The solvers take turns, each run is a process of its own, and only when all give the same displacement are times",
        f"compared (largest difference from the scipy loop as a part of the motion: {allowed}): of the call",
        "that integrates, factorization included, by its steps; of the whole process, imports included; of B5 without imports.",
        "Slow solvers run some of the 100 speeds, and their time is multiplied. Ratios are to the first row.",
        "",
        "| solver | us per step | ratio | process, s | B5, s | ratio | differs on B1, B5 |",
        "|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _machine(measured: dict) -> list[str]:
    """Return what the tables below were measured on."""
    if not measured:
        return []
    top = measured["tables"]["bounds"]
    peak = (
        f" Its matrix product reaches {top['GFlop/s']:.0f} GFlop/s, `a = b + c` on long arrays {top['GB/s']:.0f} GB/s."
    )
    return [
        "## The machine of the tables below",
        "",
        fill(_on(measured) + peak, WIDTH),
        "",
    ]


def _linear(tables: dict) -> list[str]:
    """Return Newmark steps by size."""
    rows = []
    for (unknowns, _), its in groupby(tables["linear"], key=lambda row: (row["unknowns"], row["path"])):
        probes, full = its
        rows.append(
            f"| {unknowns} | {_path(probes)} | {_cost(probes)} | {_cost(full)} | {_ms(probes)} | {probes['steps']} |"
        )
    return [
        "## Linear transient",
        "",
        "The shaft of B1, and longer ones of the same spans, by Newmark's method: microseconds per step with two probes saved,",
        "and with displacement, velocity and acceleration of all unknowns saved at every step; both are differences of a long",
        "and a short run. What comes before the first step (factorization or modes, memory) stands apart. The engine",
        "that flexcam selects is bold; where it is not the direct one, this was forced for comparison.",
        "",
        "| unknowns | engine | us per step, probes | us per step, all | before, ms | steps |",
        "|---|---|---|---|---|---|",
        *rows,
        "",
        *_model(tables["linear"]),
    ]


def _model(rows: list[dict]) -> list[str]:
    """Return the cost of a step as a function of the unknowns, fitted."""
    lines = []
    for part, name in _parts([row for row in rows if row["saved"] == "probes" and "missing" not in row]):
        n, cost = (np.array([row[key] for row in part], dtype=float) for key in ("unknowns", "us_per_step"))
        power, (a, b), off = min((_fitted(n, cost, power) for power in (1, 2)), key=lambda found: found[2])
        words = f"{_number(a)} + {b:.2g} n{'^2' if power == 2 else ''} us"
        lines.append(f"| {name} | {n[0]:.0f} to {n[-1]:.0f} | {words} | {100.0 * off:.0f} % |")
    if not lines:
        return []
    return [
        "As a model of the cost of a step with probes saved, fitted to the rows above (least squares of relative errors, the",
        "better of a straight line and a parabola in the number of unknowns n):",
        "",
        "| engine | unknowns | us per step | largest error of the fit |",
        "|---|---|---|---|",
        *lines,
        "",
    ]


DENSE = 300
"""Unknowns up to which the direct engine is dense (`flexcam.core.DENSE_LIMIT`)."""


def _parts(rows: list[dict]) -> list[tuple[list[dict], str]]:
    """Return the rows by engine, the direct one dense and sparse apart; three at least make a fit."""

    def kind(row: dict) -> str:
        dense = "dense" if row["unknowns"] <= DENSE else "sparse"
        return f"direct, {dense}" if row["path"] == "direct" else row["path"]

    found = {name: [row for row in rows if kind(row) == name] for name in dict.fromkeys(map(kind, rows))}
    return [(its, name) for name, its in found.items() if len(its) >= 3]


def _fitted(n: np.ndarray, cost: np.ndarray, power: int) -> tuple[int, np.ndarray, float]:
    """Return power, both coefficients of ``a + b n^power``, none below zero, and the largest relative error."""
    columns = np.column_stack([np.ones_like(n), n**power]) / cost[:, None]
    found = np.linalg.lstsq(columns, np.ones_like(n), rcond=None)[0]
    if found.min() < 0.0:
        kept = int(np.argmax(found))
        found = np.zeros(2)
        found[kept] = columns[:, kept].sum() / (columns[:, kept] ** 2).sum()
    return power, found, float(np.abs(columns @ found - 1.0).max())


def _bounds(tables: dict) -> list[str]:
    """Return how far steps are from what the machine could do."""
    if "linear" not in tables:
        return []
    top, rows = tables["bounds"], []
    automatic = [row for row in tables["linear"] if row["automatic"]]
    for unknowns, its in groupby(automatic, key=lambda row: row["unknowns"]):
        probes, full = its
        modal, dense = (flops / top["GFlop/s"] / 1e3 for flops in (10.0 * unknowns, 2.0 * unknowns**2))
        written = 24.0 * unknowns / top["GB/s"] / 1e3
        rows.append(
            f"| {unknowns} | {_number(modal)} | {_number(dense)} | {_number(written)} | {_path(probes)} | {_cost(probes)} | "
            f"{_times(probes, modal)} | {_cost(full)} | {_times(full, modal + written)} |"
        )
    return [
        "## Distance from the bounds",
        "",
        "A step of n modes takes some 10 n floating-point operations (two new numbers from two old ones and a load), a step",
        "by a dense inverse 2 n^2; saving displacement, velocity and acceleration of all writes 24 n bytes. At the speeds of",
        "the machine above that takes, in us per step, what the first columns say; the other columns hold the figures of the",
        "engine that flexcam selects against the bound of a modal step, and of such a step and its bytes. Small arrays stay in",
        "the caches, so their bytes take less; turning modes into all unknowns takes operations that are not counted.",
        "",
        "| unknowns | modal | dense | bytes | engine | probes | times the bound | all | times the bound |",
        "|---|---|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _contact(tables: dict) -> list[str]:
    """Return whole trains in contact."""
    rows = [
        f"| `cases/{row['case']}.toml`{', straight' if row['overrides'] else ''} | {row['unknowns']} | {row['forces']} | "
        f"{_path(row)} | {row['steps']} | {row['events']} | {row['iterations']:.2f} | {_number(row['us_probes'])} | {_cost(row)} |"
        for row in tables["contact"]
    ]
    return [
        "## Contact",
        "",
        "Two camshaft revolutions of cases with contact, as they stand, from their start. Local forces are contacts, seats,",
        "lash, coils that touch, friction and the like; events are instants at which a contact with a",
        "restitution opens or closes; iterations are Newton's, of the local forces, per step. Time is that with the probes alone saved, and with",
        "every channel, energy and field that the case asks for. Straight: the pushrod without its bow and what its load",
        "does to its bending, which leaves contact, seat, lash and the spring of eight elements. Engines as above.",
        "",
        "| case | unknowns | local forces | engine | steps | events | iterations | us per step, probes | us per step, all |",
        "|---|---|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _sweep(tables: dict) -> list[str]:
    """Return what a speed costs among many."""
    found = tables["sweep"]
    return [
        "## Many speeds",
        "",
        f"{found['speeds']} speeds of `cases/tayeb/model-3-shm.toml`, {found['steps']} steps each, one after the other in one process:",
        f"{found['row_ms']:.1f} ms per speed for the whole row of a sweep (every channel and scalar, flexible against rigid),",
        f"{found['motion_ms']:.1f} ms where the row keeps the motion of the probes alone and its deviation from the rigid train,",
        f"{found['probes_ms']:.1f} ms for the motion of the probes without a row. The command for {found['commanded']} speeds and the",
        f"motion of the probes (`flexcam sweep --scalars probes --workers 2`) takes {found['command_s']:.1f} s, its start included.",
        "",
    ]


def _assembly(tables: dict) -> list[str]:
    """Return the way from a mesh to matrices."""
    rows = [
        f"| {row['elements']} | {_number(1e3 * row['seconds'])} | {_number(1e6 * row['seconds'] / row['elements'])} |"
        for row in tables["assembly"]
    ]
    return [
        "## Assembly",
        "",
        "From nothing to mass and stiffness of a shaft oblique in space, mesh, elements and unknowns included.",
        "",
        "| elements | ms | us per element |",
        "|---|---|---|",
        *rows,
        "",
    ]


def _modes(tables: dict) -> list[str]:
    """Return natural modes."""
    rows = [f"| {row['unknowns']} | {row['bearings']} | {_number(row['seconds'])} |" for row in tables["modes"]]
    return [
        "## Modes",
        "",
        "The twenty lowest modes of shafts; up to 600 unknowns dense, above by Lanczos's method.",
        "",
        "| unknowns | bearings | s |",
        "|---|---|---|",
        *rows,
        "",
    ]


def _peaks(tables: dict) -> list[str]:
    """Return the most memory of some processes."""
    rows = [f"| {row['work']} | {row['mb']} |" for row in tables["peaks"]]
    return [
        "## Memory",
        "",
        "The most that a process of its own holds, Python and libraries included (Linux).",
        "",
        "| work | MB |",
        "|---|---|",
        *rows,
        "",
    ]


def _saving(tables: dict) -> list[str]:
    """Return what result files cost."""
    found = tables["saving"]
    rows = [
        f"| `{one['case']}` | "
        + " | ".join(f"{1e3 * a:.0f} | {1e3 * b:.0f} | {b / a:.2f}" for a, b in (one["steps_s"], one["run_s"]))
        + " |"
        for one in found["runs"]
    ]
    return [
        "## Saving",
        "",
        f"A full field of {found['nodes']} nodes at {found['steps']} steps, {found['mb']:.0f} MB with all else that a result has, is written in",
        f"{found['field_s']:.2f} s. Runs of delivered cases at their own intervals, in memory and with the result file, ms: their steps alone,",
        "and all from reading the case to the end of the run.",
        "",
        "| case | steps | saved | times | run | saved | times |",
        "|---|---|---|---|---|---|---|",
        *rows,
        "",
        "What a file costs beyond its bytes is some forty milliseconds, for a hundred datasets that are laid out, sealed and synced to the disk.",
        "",
    ]


def _compiler(tables: dict) -> list[str]:
    """Return what the compiler takes."""
    found = tables["compiler"]
    return [
        "## Machine code",
        "",
        f"`flexcam run cases/pushrod-engine/intake.toml` takes {found['first_s']:.1f} s where the kernel is compiled first, which",
        f"then is kept, {found['later_s']:.1f} s from then on, and {found['without_s']:.1f} s without it (`--set run.engine=direct`).",
        "",
    ]


def _process(tables: dict) -> list[str]:
    """Return whole commands."""
    rows = [f"| {row['command']} | {row['seconds']:.2f} |" for row in tables["process"]]
    return [
        "## Whole processes",
        "",
        "From the call to the end, files and caches warm.",
        "",
        "| command | s |",
        "|---|---|",
        *rows,
        "",
    ]


SECTIONS: dict[str, Callable[[dict], list[str]]] = {
    "linear": _linear, "bounds": _bounds, "contact": _contact, "sweep": _sweep, "assembly": _assembly, "modes": _modes, "peaks": _peaks,
    "saving": _saving, "process": _process, "compiler": _compiler,
}  # fmt: skip
"""Their order on the page, by the table of the JSON each shows."""


def _agreement(one: dict) -> str:
    return ", ".join(f"{off:.0e}" if off else "reference" for off in one["agreement"].values())


def _on(found: dict) -> str:
    """Return machine, day and versions."""
    machine = found["machine"]
    cores = f"{machine['cores']} core{'s' if machine['cores'] > 1 else ''}"
    packages = ", ".join(f"{package} {number}" for package, number in found["versions"].items() if package != "numpy")
    return (
        f"{machine['processor']}, {cores}, {machine['system']}; Python {machine['python']}, numpy {machine['numpy']} "
        f"with {machine['blas']}, {packages}; {found['date']}."
    )


def _path(row: dict) -> str:
    return f"**{row['path']}**" if row["automatic"] else row["path"]


def _cost(row: dict) -> str:
    return row["missing"] if "missing" in row else _number(row["us_per_step"])


def _ms(row: dict) -> str:
    return "" if "missing" in row else _number(row["before_ms"])


def _times(row: dict, bound: float) -> str:
    return "" if "missing" in row else _number(row["us_per_step"] / bound)


def _number(value: float) -> str:
    """Return two or three digits without an exponent."""
    if value == 0.0:
        return "0"
    digits = max(0, 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{digits}f}"


def read(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def main() -> None:
    asked = argparse.ArgumentParser(description="make docs/performance.md")
    asked.add_argument("--measure", action="store_true", help="measure docs/performance.json anew first")
    if asked.parse_args().measure:
        command = [sys.executable, "-m", "benchmarks.measure"]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}, check=True)
    PAGE.write_text(page(read(MEASURED), read(PEERS)), encoding="utf-8")


if __name__ == "__main__":
    main()
