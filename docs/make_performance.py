"""Make ``docs/performance.md`` and a picture from ``docs/performance.json`` and ``docs/performance-peers.json``.

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
PICTURE = ROOT / "docs/pictures/peers-contact.svg"
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
    lines = [HEAD, *_peers(peers), *_train(peers.get("train", {})), *_machine(measured)]
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


ERRORS = (1e-2, 1e-3, 1e-4)
"""Errors at which times are compared."""


def _train(found: dict) -> list[str]:
    """Return the comparison in contact, and the time by number of valves."""
    if not found:
        return []
    methods, rows, faster = group_methods(found), [], []
    own = [time_at(next(iter(methods.values())), error) for error in ERRORS]
    for method, settings in methods.items():
        times = [time_at(settings, error) for error in ERRORS]
        ratios = [time / ref if time and ref else None for time, ref in zip(times, own, strict=True)]
        if ratios[1] and ratios[1] < 1.0:
            faster.append(method)
        runs = " ".join(f"{_number(one['ms'])}/{_power(one['error'])}" for one in settings)
        name = settings[0]["name"].removeprefix("tolerance ").replace("e-0", "e-")
        cell = ", ".join("-" if ratio is None else _number(ratio) for ratio in ratios)
        rows.append(f"| {method} | {name} | {runs} | {cell} |")
    rows += [f"| {one['title']} | {one['missing']} | | |" for one in found["solvers"] if one["missing"]]
    differences = " and ".join(f"{name} by {_power(off)}" for name, off in found["references"].items())
    base = ", ".join("-" if time is None else _number(time) for time in own)
    first = ", ".join(
        f"{solver['title']} {_number(max(one['first_s'] for one in solver['settings']))}"
        for solver in found["solvers"]
        if solver["settings"]
    )
    text = (
        "C1 is a valve train of three masses in one axis with cam, push rod, lash and seat (`benchmarks/peers/train.py`) and "
        "Hunt-Crossley contacts, over one revolution of 40 ms. *ms/error*: processor time with set-up, without compilation, and "
        "relative rms error of the cam force at 900 instants, for the first setting and then twice the steps or a tenth of the "
        f"tolerance. From the reference, `DOP853` with 1e-12, {differences} differ. *Ratio*: time at errors of 1e-2, 1e-3 and 1e-4, "
        f"interpolated in logarithms, relative to the first row ({base} ms). At 1e-3, {'; '.join(faster) or 'no others'} "
        f"are faster than flexcam. First runs, with compilation, take up to (s): {first}."
    )
    return [
        "## Comparison in contact",
        "",
        fill(f"{text} {_on(found, short=True)}", WIDTH),
        "",
        "| solver | first setting | ms/error | ratio |",
        "|---|---|---|---|",
        *rows,
        "",
        "![Error of the cam force over processor time](pictures/peers-contact.svg)",
        "",
        *_valves(found["valves"]),
    ]


def _power(value: float) -> str:
    """Return one digit and a short exponent."""
    return f"{value:.0e}".replace("e-0", "e-")


def group_methods(found: dict) -> dict[str, list[dict]]:
    """Return the settings by method."""
    settings = [one for solver in found["solvers"] for one in solver["settings"]]
    return {name: list(its) for name, its in groupby(settings, key=lambda one: one["method"])}


def time_at(settings: list[dict], error: float) -> float | None:
    """Return the time of a method at an error, ms, interpolated in logarithms along its fastest settings.

    A method whose fastest setting has a smaller error takes the time of this setting; None if no setting is as accurate.
    """
    best = [
        (one["error"], one["ms"])
        for one in settings
        if not any(other["error"] < one["error"] and other["ms"] <= one["ms"] for other in settings)
    ]
    errors, times = np.log(sorted(best)).T
    return None if np.log(error) < errors[0] else float(np.exp(np.interp(np.log(error), errors, times)))


def _valves(rows: list[dict]) -> list[str]:
    """Return the time of a step by number of valves."""
    counts = [str(row["valves"]) for row in rows]
    methods = [name for name in rows[0] if name != "valves"]
    return [
        "## Number of valves",
        "",
        "Processor time per step in µs of equal, independent trains C1 in one system, with 3600 steps; `newmark` locates openings and",
        "closings, here at equal instants.",
        "",
        f"| valves | {' | '.join(counts)} |",
        "|---|" + "---|" * len(rows),
        *(f"| `{method}` | {' | '.join(_number(row[method]) for row in rows)} |" for method in methods),
        "",
    ]


def draw(found: dict) -> None:
    """Write the picture of error over time."""
    from flexcam.plotting.figures import add_legend, create_axes, line_styles, save_figure

    figure, (axes,) = create_axes((7.0, 5.2))
    methods = group_methods(found)
    for (name, settings), (colour, dashes) in zip(methods.items(), line_styles(), strict=False):
        pairs = [(one["ms"], one["error"]) for one in settings]
        own = 2.5 if name.startswith("flexcam") else 1.2
        axes.loglog(
            *zip(*pairs, strict=True),
            dashes,
            label=name.replace("`", ""),
            color=colour,
            marker="o",
            markersize=3,
            linewidth=own,
        )
    axes.set_xlabel("processor time per revolution, ms")
    axes.set_ylabel("relative rms error of the cam force")
    axes.set_ylim(3e-6, 0.2)
    add_legend(figure, axes, len(methods), columns=3)
    save_figure(figure, PICTURE, overwrite=True)


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
    shown = [row for row in tables["linear"] if row["unknowns"] not in ONLY_FITTED]
    for unknowns, its in groupby(shown, key=lambda row: row["unknowns"]):
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
ONLY_FITTED = (118, 3018, 29988)
"""Unknowns of shafts that are not in the table, but in the fit."""


def _pair(probes: dict, full: dict) -> str:
    """Return the times of a step with the probes and with all unknowns saved; bold for the selected engine."""
    if "missing" in probes:
        return probes["missing"]
    text = f"{_cost(probes)}/{_cost(full)}"
    return f"**{text}**" if probes["automatic"] else text


def _model(rows: list[dict]) -> list[str]:
    """Return the cost of a step as a function of the unknowns, fitted."""
    lines = []
    for part, name in _parts([row for row in rows if row["saved"] == "probes" and "missing" not in row]):
        n, cost = (np.array([row[key] for row in part], dtype=float) for key in ("unknowns", "us_per_step"))
        power, (a, b), off = min((_fitted(n, cost, power) for power in (1, 2)), key=lambda found: found[2])
        words = f"{_number(a)} + {b:.2g} n{'²' if power == 2 else ''}"
        lines.append(f"{name} {words} ({100.0 * off:.0f} %)")
    if not lines:
        return []
    text = f"Step in µs with probes saved, fitted with n unknowns (maximum error): {'; '.join(lines)}."
    return [fill(text, WIDTH), ""]


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


def _contact(tables: dict) -> list[str]:
    """Return whole trains in contact."""
    rows = []
    for _, pair in groupby(tables["contact"], lambda row: (row["case"], row["overrides"])):
        engines = {row["path"]: row for row in pair}
        first = next(iter(engines.values()))
        times = {name: _pair(row | {"us_per_step": row["us_probes"]}, row) for name, row in engines.items()}
        rows.append(
            f"| `{first['case']}`{', straight' if first['overrides'] else ''} | {first['unknowns']} | {first['forces']} | "
            f"{first['events']} | {first['iterations']:.1f} | {times.get('kernel', '')} | {times.get('direct', '')} |"
        )
    return [
        "## Contact",
        "",
        "Time per step in µs of Newmark's method over the first two camshaft revolutions: the probes saved / every channel, energy and field of the case saved.",
        "Bold: the solver engine that flexcam selects. *Events* are openings and closings of contacts, *iterations* those of",
        "Newton's method per step. *Straight*: the pushrod without bow and geometric stiffness.",
        "",
        "| case | unknowns | local forces | events | iterations | kernel | direct |",
        "|---|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _accuracy(tables: dict) -> list[str]:
    """Return errors of two methods in contact."""
    found = tables["accuracy"]
    methods, steps = (dict.fromkeys(row[name] for row in found) for name in ("method", "steps"))
    rows = [
        f"| `{case}` | `{method}` | {' | '.join(format(row['error'], '.2g') for row in runs if row['method'] == method)} |"
        for case, runs in ((case, list(group)) for case, group in groupby(found, lambda row: row["case"]))
        for method in methods
    ]
    return [
        "## Accuracy in contact",
        "",
        "Half a camshaft revolution with the kernel solver engine, by steps per revolution: relative rms error of the cam force against a",
        "collocation with 115 200 steps. The collocation divides steps that are too long for the contacts, here those of 1800.",
        "",
        f"| case | method | {' | '.join(map(str, steps))} |",
        "|---|---|" + "---|" * len(steps),
        *rows,
        "",
    ]


def _sweep(tables: dict) -> list[str]:
    """Return what a speed costs among many."""
    found = tables["sweep"]
    return [
        "## Many speeds",
        "",
        fill(
            f"{found['speeds']} speeds of `cases/tayeb/model-3-shm.toml` with {found['steps']} steps in one process, ms per speed: "
            f"{found['row_ms']:.1f} for a complete row of a sweep, {found['motion_ms']:.1f} for the motion of the probes and its deviation "
            f"from the rigid train, {found['probes_ms']:.1f} for the motion alone. `flexcam sweep --scalars probes --workers 2` takes "
            f"{found['command_s']:.1f} s for {found['commanded']} speeds.",
            WIDTH,
        ),
        "",
    ]


def _gradients(tables: dict) -> list[str]:
    """Return what derivatives of a run cost."""
    rows = [
        f"| `{row['case']}` | {row['parameters']} | {row['exact_runs']:.1f} | {row['differences_runs']:.1f} |"
        for row in tables["gradients"]
    ]
    return [
        "## Derivatives",
        "",
        "One revolution with Newmark's method and the kernel solver engine: processor time of exact",
        "[derivatives](topics/derivatives.md) of two metrics, and of central differences, in runs with these metrics.",
        "",
        "| case | parameters | exact, runs | differences, runs |",
        "|---|---|---|---|",
        *rows,
        "",
    ]


def _derivatives(tables: dict) -> list[str]:
    """Return derivatives against closed-form solutions."""
    rows = [
        f"| {row['what']} | {row['exact_error']:.0e} | "
        f"{_number(row['exact_ms'])} | {row['differences_error']:.0e} | {_number(row['differences_ms'])} |"
        for row in tables["derivatives"]
    ]
    return [
        "Derivatives with known values (`benchmarks/measure/derivatives.py`): relative error and time of",
        "`flexcam sensitivity --method exact` and `--method differences`, which are [the same](studies.md#derivatives) for",
        "frequencies, static results and Floquet multipliers.",
        "",
        "| derivative | exact, error | ms | differences, error | ms |",
        "|---|---|---|---|---|",
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
        "Highest crank speed of the pushrod engine's intake train with at least 50 N on the nose and a wire stress below 856 MPa, by seven",
        "values of speed, spring and cam (`benchmarks/measure/searches.py`). Variants (of the gradient with derivatives) and processor",
        f"time on one core, in all and until {searched[0]['reached_rpm']:.0f} rpm, 1 % below the result of the gradient.",
        "",
        "| method | variants | s | result, rpm | variants until then | s |",
        "|---|---|---|---|---|---|",
        *rows,
        "",
    ]


def _assembly(tables: dict) -> list[str]:
    """Return the way from a mesh to matrices."""
    times = ", ".join(f"{row['elements']}: {_number(1e3 * row['seconds'])}" for row in tables["assembly"])
    return [
        "## Assembly",
        "",
        fill(
            f"Time in ms of an inclined shaft's mesh, mass and stiffness matrix, by number of elements: {times}.", WIDTH
        ),
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
        f"| `{one['case']}` | {' | '.join(f'{1e3 * part:.0f}' for part in one['steps_s'])} |" for one in found["runs"]
    ]
    return [
        "## Saving",
        "",
        f"A full field of {found['nodes']} nodes at {found['steps']} steps, {found['mb']:.0f} MB with the rest of the result, takes {found['field_s']:.2f} s to write.",
        "Time of the steps in ms, in memory and with the result file:",
        "",
        "| case | memory | file |",
        "|---|---|---|",
        *rows,
        "",
    ]


def _compiler(tables: dict) -> list[str]:
    """Return what the compiler takes."""
    found = tables["compiler"]
    return [
        "## Compilation",
        "",
        fill(
            f"`flexcam run cases/pushrod-engine/intake.toml` takes {found['first_s']:.1f} s with the compilation of the kernel, "
            f"{found['later_s']:.1f} s with compiled code from the cache and {found['without_s']:.1f} s with `--set run.engine=direct`.",
            WIDTH,
        ),
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


def _on(found: dict, *, short: bool = False) -> str:
    """Return machine, day and versions; in short without those of Python and numpy."""
    machine = found["machine"]
    cores = f"{machine['cores']} core{'s' if machine['cores'] > 1 else ''}"
    packages = ", ".join(f"{package} {number}" for package, number in found["versions"].items() if package != "numpy")
    base = (
        ""
        if short
        else f", {machine['system']}; Python {machine['python']}, numpy {machine['numpy']} with {machine['blas']}"
    )
    return f"{machine['processor']}, {cores}{base}, {packages}; {found['date']}."


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
    peers = read(PEERS)
    PAGE.write_text(page(read(MEASURED), peers), encoding="utf-8")
    if "train" in peers:
        draw(peers["train"])


if __name__ == "__main__":
    main()
