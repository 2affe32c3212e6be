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

HEAD = """# Performance

`make performance` and `make bench-peers` measure times and memory; `docs/make_performance.py` generates this page. All use one
thread of linear algebra. A time is the minimum of several repeats. Do not compare figures of different machines.
"""


B1 = (
    "| B1 | steel shaft, 0.5 m long and 25 mm thick, between two bearings; ten Euler-Bernoulli elements, consistent mass, "
    "60 unknowns; 0.2 kg at its middle and there $F_y = 500\\,(1 - \\cos\\omega t)$ N and $T_x = 3\\sin\\omega t$ N m, "
    "$\\omega = 50\\pi$/s; undamped, from rest; Newmark 1/4, 1/2 with 7200 steps of 1/3600 revolution |"
)


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
        "## Comparison with other solvers",
        "",
        fill(_on(found), WIDTH),
        "",
        "| work | definition |",
        "|---|---|",
        B1,
        "| B5 | B1 at 100 speeds from 500 to 5000 rpm; slow solvers run some of them, and their time is scaled |",
        "",
        "flexcam and OpenSees build their own elements, the others get matrices. The solvers run in turn, each in its own process, and must",
        "give the same displacement of the middle (maximum difference from the scipy loop relative to the motion:",
        f"{allowed}). *µs per step* includes the factorization, *process* also imports. Ratios refer to the first row.",
        "",
        "| solver | µs per step | ratio | process, s | B5, s | ratio | difference on B1, B5 |",
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
        "## Machine of the tables below",
        "",
        fill(_on(measured) + peak, WIDTH),
        "",
    ]


def _linear(tables: dict) -> list[str]:
    """Return Newmark steps by size."""
    rows = []
    for unknowns, its in groupby(tables["linear"], key=lambda row: row["unknowns"]):
        engines = {name: list(pair) for name, pair in groupby(its, key=lambda row: row["path"])}
        cells = [_pair(*engines[name]) if name in engines else "" for name in ENGINES]
        selected = next(probes for probes, _ in engines.values() if probes["automatic"])
        rows.append(f"| {unknowns} | {' | '.join(cells)} | {_ms(selected)} |")
    return [
        "## Linear transient",
        "",
        "Time per step in µs of the shaft of B1, and of longer ones with the same spans, with Newmark's method: two probes saved /",
        "the motion of all unknowns saved at every step. Bold: the solver engine that flexcam selects, with its time before the first step.",
        "",
        "| unknowns | modal | kernel | direct | before, ms |",
        "|---|---|---|---|---|",
        *rows,
        "",
    ]


ENGINES = ("modal", "kernel", "direct")


def _pair(probes: dict, full: dict) -> str:
    """Return the times of a step with the probes and with all unknowns saved; bold for the selected engine."""
    if "missing" in probes:
        return probes["missing"]
    text = f"{_cost(probes)} / {_cost(full)}"
    return f"**{text}**" if probes["automatic"] else text


def _contact(tables: dict) -> list[str]:
    """Return whole trains in contact."""
    rows = []
    for _, pair in groupby(tables["contact"], lambda row: (row["case"], row["overrides"])):
        engines = {row["path"]: row for row in pair}
        first = next(iter(engines.values()))
        times = {name: _pair(row | {"us_per_step": row["us_probes"]}, row) for name, row in engines.items()}
        rows.append(
            f"| `{first['case']}`{', straight' if first['overrides'] else ''} | {first['unknowns']} | {first['forces']} | "
            f"{first['steps']} | {first['events']} | {first['iterations']:.1f} | {times.get('kernel', '')} | {times.get('direct', '')} |"
        )
    return [
        "## Contact",
        "",
        "Time per step in µs of Newmark's method over the first two camshaft revolutions: the probes saved / every channel, energy and field of the case saved.",
        "Bold: the solver engine that flexcam selects. *Events* are openings and closings of contacts, *iterations* those of",
        "Newton's method per step. *Straight*: the pushrod without bow and geometric stiffness.",
        "",
        "| case | unknowns | local forces | steps | events | iterations | kernel | direct |",
        "|---|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _accuracy(tables: dict) -> list[str]:
    """Return error and time of two methods in contact."""
    found = tables["accuracy"]
    methods, steps = (dict.fromkeys(row[name] for row in found) for name in ("method", "steps"))
    rows = [
        f"| `{case}` | `{method}` | {' | '.join(_accuracy_cell(row) for row in runs if row['method'] == method)} |"
        for case, runs in ((case, list(group)) for case, group in groupby(found, lambda row: row["case"]))
        for method in methods
    ]
    return [
        "## Accuracy in contact",
        "",
        "Half a camshaft revolution with the kernel solver engine, by steps per revolution: relative rms error of the cam force against a",
        "collocation with 115 200 steps / time of the steps with only the probes, ms.",
        "The collocation divides steps that are too long for the contacts, here those of 900 and 1800.",
        "",
        f"| case | method | {' | '.join(map(str, steps))} |",
        "|---|---|" + "---|" * len(steps),
        *rows,
        "",
    ]


def _accuracy_cell(row: dict) -> str:
    return f"{row['error']:.2g}" + ("" if row["ms"] is None else f" / {_number(row['ms'])}")


def _sweep(tables: dict) -> list[str]:
    """Return what a speed costs among many."""
    found = tables["sweep"]
    return [
        "## Many speeds",
        "",
        f"Time per speed of `cases/tayeb/model-3-shm.toml` with {found['steps']} steps, for {found['speeds']} speeds one after the other in one process:",
        "",
        "| result | ms |",
        "|---|---|",
        f"| complete row of a sweep: every channel and scalar, flexible against rigid | {found['row_ms']:.1f} |",
        f"| motion of the probes and its deviation from the rigid train | {found['motion_ms']:.1f} |",
        f"| motion of the probes | {found['probes_ms']:.1f} |",
        "",
        f"`flexcam sweep --scalars probes --workers 2` takes {found['command_s']:.1f} s for {found['commanded']} speeds, with its start.",
        "",
    ]


def _gradients(tables: dict) -> list[str]:
    """Return what derivatives of a run cost."""
    rows = [
        f"| `{row['case']}` | {row['parameters']} | {_number(row['run_ms'])} | {_number(row['gradient_ms'])} | "
        f"{row['gradient_ms'] / row['run_ms']:.1f} | {_number(row['differences_ms'])} |"
        for row in tables["gradients"]
    ]
    return [
        "## Derivatives",
        "",
        "One revolution with the kernel solver engine: time of a run with its metrics, of the run with exact",
        "[derivatives](topics/derivatives.md) of two metrics, and of central differences, two runs per parameter.",
        "",
        "| case | parameters | run, ms | exact, ms | exact/run | differences, ms |",
        "|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _derivatives(tables: dict) -> list[str]:
    """Return derivatives against closed-form solutions."""
    rows = [
        f"| {row['what']} | `{row['scalar']}` | {row['closed_form']:.6g} | {row['exact_error']:.0e} | "
        f"{_number(row['exact_ms'])} | {row['differences_error']:.0e} | {_number(row['differences_ms'])} |"
        for row in tables["derivatives"]
    ]
    return [
        "Derivatives with known values (`benchmarks/measure/derivatives.py`; SI): relative error and time of",
        "`flexcam sensitivity --method exact` and `--method differences`, which are [the same](studies.md#derivatives) for",
        "frequencies, static results and Floquet multipliers.",
        "",
        "| derivative | of | closed-form value | exact, error | ms | differences, error | ms |",
        "|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _searches(tables: dict) -> list[str]:
    """Return what searches by gradient and without derivatives cost."""
    searched = tables["searches"]
    rows = [
        f"| `{row['method']}` | {row['variants']} | {row['seconds']:.0f} | {row['best_rpm']:.0f} | "
        + (f"{row['until']} | {row['until_s']:.0f} |" if row["until"] else "not reached | |")
        for row in searched
    ]
    return [
        "## Searches",
        "",
        "The highest crank speed at which the intake train of the pushrod engine keeps a force of 50 N on the nose, with a wire stress",
        "below 856 MPa. Seven values vary: speed, stiffness and installed force of the spring, four coefficients of the rise",
        "(`benchmarks/measure/searches.py`). Variants (of the gradient with derivatives) and processor time on one core, in all and",
        f"until {searched[0]['reached_rpm']:.0f} rpm, 1 % below the result of the gradient.",
        "",
        "| method | variants | s | result, rpm | variants until then | s |",
        "|---|---|---|---|---|---|",
        *rows,
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
        "Mesh, elements, unknowns, mass and stiffness matrix of an inclined shaft.",
        "",
        "| elements | ms | µs per element |",
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
        "The twenty lowest modes of shafts, dense up to 600 unknowns, with Lanczos's method above.",
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
        "Maximum memory of a process with Python and libraries (Linux).",
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
        + " | ".join(f"{1e3 * a:.0f} | {1e3 * b:.0f}" for a, b in (one["steps_s"], one["run_s"]))
        + " |"
        for one in found["runs"]
    ]
    return [
        "## Saving",
        "",
        f"A full field of {found['nodes']} nodes at {found['steps']} steps, {found['mb']:.0f} MB with the rest of the result, takes {found['field_s']:.2f} s to write.",
        "Times in ms in memory and with the result file: of the steps, and of the run with the reading of the case.",
        "",
        "| case | steps | saved | run | saved |",
        "|---|---|---|---|---|",
        *rows,
        "",
        "A file costs some forty milliseconds for the layout, checksum and sync of a hundred datasets.",
        "",
    ]


def _compiler(tables: dict) -> list[str]:
    """Return what the compiler takes."""
    found = tables["compiler"]
    return [
        "## Compilation",
        "",
        "`flexcam run cases/pushrod-engine/intake.toml`:",
        "",
        "| kernel | s |",
        "|---|---|",
        f"| with its compilation | {found['first_s']:.1f} |",
        f"| compiled code from the cache | {found['later_s']:.1f} |",
        f"| not used (`--set run.engine=direct`) | {found['without_s']:.1f} |",
        "",
    ]


def _process(tables: dict) -> list[str]:
    """Return whole commands."""
    rows = [f"| {row['command']} | {row['seconds']:.2f} |" for row in tables["process"]]
    return [
        "## Whole processes",
        "",
        "From call to end, with files and caches in memory.",
        "",
        "| command | s |",
        "|---|---|",
        *rows,
        "",
    ]


SECTIONS: dict[str, Callable[[dict], list[str]]] = {
    "linear": _linear, "contact": _contact, "accuracy": _accuracy, "sweep": _sweep, "gradients": _gradients,
    "derivatives": _derivatives, "searches": _searches, "assembly": _assembly, "modes": _modes, "peaks": _peaks,
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


def _cost(row: dict) -> str:
    return row["missing"] if "missing" in row else _number(row["us_per_step"])


def _ms(row: dict) -> str:
    return "" if "missing" in row else _number(row["before_ms"])


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
