"""Make ``docs/performance.md`` and a picture from ``docs/performance.json`` and ``docs/performance-peers.json``.

With ``--measure``, the script first measures the former file again, which takes some minutes; ``make bench-peers`` writes
the latter. Each table has a function here and one in ``benchmarks/measure``.
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
    lines = [HEAD, *_shaft_comparison(peers), *_train_comparison(peers.get("train", {})), *_machine(measured)]
    for name, make in SECTIONS.items():
        if name in tables:
            lines += make(tables)
    return "\n".join(lines)


def _shaft_comparison(found: dict) -> list[str]:
    """Return the comparison with other solvers."""
    if not found:
        return []
    first, rows = found["solvers"][0], []
    for solver in found["solvers"]:
        if solver["missing"]:
            rows.append(f"| {solver['title']} | {solver['missing']} | | | | | |")
            continue
        step, b5 = solver["us_per_step"], solver["b5_s"]
        few = "" if solver["b5_speeds"] == 100 else f" (from {solver['b5_speeds']})"
        errors = ", ".join(f"{error:.0e}" if error else "reference" for error in solver["agreement"].values())
        rows.append(
            f"| {solver['title']} | {_number(step)} | {_number(step / first['us_per_step'])} | {solver['process_s']:.2f} | "
            f"{_number(b5)}{few} | {_number(b5 / first['b5_s'])} | {errors} |"
        )
    allowed = ", ".join(f"{limit:g} on {name}" for name, limit in found["tolerance"].items())
    return [
        "## Comparison with other solvers",
        "",
        fill(_conditions(found), WIDTH),
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
"""Errors of the cam force for the comparison of times."""


def _train_comparison(found: dict) -> list[str]:
    """Return the comparison in contact, and the times by number of valves."""
    if not found:
        return []
    methods, rows, faster = group_methods(found), [], []
    first_times = [time_at(next(iter(methods.values())), error) for error in ERRORS]
    for method, settings in methods.items():
        times = [time_at(settings, error) for error in ERRORS]
        ratios = [time / ref if time and ref else None for time, ref in zip(times, first_times, strict=True)]
        if ratios[1] and ratios[1] < 1.0:
            faster.append(method)
        runs = " ".join(f"{_number(setting['ms'])}/{_power(setting['error'])}" for setting in settings)
        name = settings[0]["name"].removeprefix("tolerance ").replace("e-0", "e-")
        cell = ", ".join("-" if ratio is None else _number(ratio) for ratio in ratios)
        rows.append(f"| {method} | {name} | {runs} | {cell} |")
    rows += [f"| {solver['title']} | {solver['missing']} | | |" for solver in found["solvers"] if solver["missing"]]
    differences = " and ".join(f"{name} by {_power(error)}" for name, error in found["references"].items())
    base = ", ".join("-" if time is None else _number(time) for time in first_times)
    first = ", ".join(
        f"{solver['title']} {_number(max(setting['first_s'] for setting in solver['settings']))}"
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
        fill(f"{text} {_conditions(found, short=True)}", WIDTH),
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
    """Return a number with one digit and a short exponent."""
    return f"{value:.0e}".replace("e-0", "e-")


def group_methods(found: dict) -> dict[str, list[dict]]:
    """Return the settings by method."""
    settings = [setting for solver in found["solvers"] for setting in solver["settings"]]
    return {name: list(group) for name, group in groupby(settings, key=lambda setting: setting["method"])}


def time_at(settings: list[dict], error: float) -> float | None:
    """Return the time of a method at an error, ms, interpolated in logarithms along its fastest settings.

    A method whose fastest setting has a smaller error takes the time of this setting; None if no setting is as accurate.
    """
    best = [
        (setting["error"], setting["ms"])
        for setting in settings
        if not any(other["error"] < setting["error"] and other["ms"] <= setting["ms"] for other in settings)
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
    """Write the figure of error over processor time."""
    from flexcam.plotting.figures import add_legend, create_axes, line_styles, save_figure

    figure, (axes,) = create_axes((7.0, 5.2))
    methods = group_methods(found)
    for (name, settings), (colour, dashes) in zip(methods.items(), line_styles(), strict=False):
        pairs = [(setting["ms"], setting["error"]) for setting in settings]
        width = 2.5 if name.startswith("flexcam") else 1.2
        axes.loglog(
            *zip(*pairs, strict=True),
            dashes,
            label=name.replace("`", ""),
            color=colour,
            marker="o",
            markersize=3,
            linewidth=width,
        )
    axes.set_xlabel("processor time per revolution, ms")
    axes.set_ylabel("relative rms error of the cam force")
    axes.set_ylim(3e-6, 0.2)
    add_legend(figure, axes, columns=3)
    save_figure(figure, PICTURE, overwrite=True)


def _machine(measured: dict) -> list[str]:
    """Return the description and limits of the machine."""
    if not measured:
        return []
    limits = measured["tables"]["bounds"]
    text = f" Its matrix product reaches {limits['GFlop/s']:.0f} GFlop/s, `a = b + c` on long arrays {limits['GB/s']:.0f} GB/s."
    return [
        "## Machine of the tables below",
        "",
        fill(_conditions(measured) + text, WIDTH),
        "",
    ]


def _linear(tables: dict) -> list[str]:
    """Return times of Newmark steps by number of unknowns."""
    rows = []
    shown = [row for row in tables["linear"] if row["unknowns"] not in OMITTED]
    for unknowns, group in groupby(shown, key=lambda row: row["unknowns"]):
        engines = {name: list(pair) for name, pair in groupby(group, key=lambda row: row["path"])}
        cells = [_times_cell(*engines[name]) if name in engines else "" for name in ENGINES]
        selected = next(probes for probes, _ in engines.values() if probes["automatic"])
        rows.append(f"| {unknowns} | {' | '.join(cells)} | {_start_time(selected)} |")
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
OMITTED = (118, 3018, 29988)
"""Unknowns of measured shafts that the table omits."""


def _times_cell(probes: dict, full: dict) -> str:
    """Return the times of a step with the probes and with all unknowns saved; bold for the selected engine."""
    if "missing" in probes:
        return probes["missing"]
    text = f"{_step_time(probes)}/{_step_time(full)}"
    return f"**{text}**" if probes["automatic"] else text


def _contact(tables: dict) -> list[str]:
    """Return times of complete trains in contact."""
    rows = []
    for _, group in groupby(tables["contact"], lambda row: (row["case"], row["overrides"])):
        engines = {row["path"]: row for row in group}
        first = next(iter(engines.values()))
        times = {name: _times_cell(row | {"us_per_step": row["us_probes"]}, row) for name, row in engines.items()}
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
    """Return the errors of two methods in contact."""
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
    """Return the time per speed of a sweep."""
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
    """Return the times of gradients of a run."""
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
    """Return the cost of searches with and without gradients."""
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
    """Return the times of the assembly."""
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
    """Return the times of natural modes."""
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
    """Return the peak memory of processes."""
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
    """Return the times to write result files."""
    found = tables["saving"]
    rows = [
        f"| `{run['case']}` | {' | '.join(f'{1e3 * seconds:.0f}' for seconds in run['steps_s'])} |"
        for run in found["runs"]
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
    """Return the time of compilation."""
    found = tables["compiler"]
    return [
        "## Compilation",
        "",
        fill(
            f"`flexcam run cases/pushrod-engine/intake.toml` takes {found['first_s']:.1f} s with the compilation of the kernel, "
            f"{found['later_s']:.1f} s with compiled code from the cache and {found['without_s']:.1f} s with `--set run.engine=direct`. "
            f"From a wheel that contains the compiled kernel the first run takes {found['wheel_s']:.1f} s.",
            WIDTH,
        ),
        "",
    ]


def _process(tables: dict) -> list[str]:
    """Return the times of complete commands."""
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
"""Sections of the page in order, by table of the JSON file."""


def _conditions(found: dict, *, short: bool = False) -> str:
    """Return machine, versions and date; if short, without system, Python and numpy."""
    machine = found["machine"]
    cores = f"{machine['cores']} core{'s' if machine['cores'] > 1 else ''}"
    packages = ", ".join(f"{package} {number}" for package, number in found["versions"].items() if package != "numpy")
    base = (
        ""
        if short
        else f", {machine['system']}; Python {machine['python']}, numpy {machine['numpy']} with {machine['blas']}"
    )
    return f"{machine['processor']}, {cores}{base}, {packages}; {found['date']}."


def _step_time(row: dict) -> str:
    return row["missing"] if "missing" in row else _number(row["us_per_step"])


def _start_time(row: dict) -> str:
    return "" if "missing" in row else _number(row["before_ms"])


def _number(value: float) -> str:
    """Return a number with two or three digits and no exponent."""
    if value == 0.0:
        return "0"
    digits = max(0, 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{digits}f}"


def read(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def main() -> None:
    parser = argparse.ArgumentParser(description="make docs/performance.md")
    parser.add_argument("--measure", action="store_true", help="measure docs/performance.json first")
    if parser.parse_args().measure:
        command = [sys.executable, "-m", "benchmarks.measure"]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}, check=True)
    peers = read(PEERS)
    PAGE.write_text(page(read(MEASURED), peers), encoding="utf-8")
    if "train" in peers:
        draw(peers["train"])


if __name__ == "__main__":
    main()
