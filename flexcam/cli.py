"""The command line: parse, call, print, exit code. Nothing is computed here.

Results go to standard output, messages to standard error. Exit codes: 0 done, 2 refused input, 3 the run failed,
130 interrupted, 143 terminated, 70 a fault of flexcam itself.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
import traceback
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from types import FrameType
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter
from rich.console import Console

from flexcam import __version__, console, fidelity
from flexcam.case import Case, read_case
from flexcam.checks import Fault, InputError, refuse
from flexcam.integrate import solve
from flexcam.io import made_folder, read_result, write_mesh, write_pvd
from flexcam.response import Cause, RunFailedError, Status
from flexcam.runner import modes as case_modes
from flexcam.runner import prepare, result_file

DONE, REFUSED, FAILED, FAULT, INTERRUPTED, TERMINATED = 0, 2, 3, 70, 130, 143

CaseFile = Annotated[Path, Parameter(help="Case file (TOML).")]
Overrides = Annotated[
    list[str] | None,
    Parameter("--set", negative=(), help="Lay a value over the case's: run.speed=4000rpm. May be repeated."),
]
Json = Annotated[bool, Parameter("--json", negative=(), help="Print one JSON object.")]
Folder = Annotated[Path, Parameter(["-o", "--output"], help="Folder of the results.")]
Overwrite = Annotated[bool, Parameter("--overwrite", negative=(), help="Replace existing results.")]

app = App(
    name="flexcam",
    version=__version__,
    help_format="plaintext",
    help="Flexible valve trains and cam mechanisms by finite elements.",
    help_prologue="""\
flexcam check cases/tayeb/model-3-shm.toml
flexcam compare cases/tayeb/model-3-shm.toml --set run.speed=4000rpm
flexcam run cases/tayeb/model-3-shm.toml -o results
flexcam export results/model-3-shm.vtkhdf --format pvd
""",
    suppress_keyboard_interrupt=False,
)


def _out() -> Console:
    width = None if sys.stdout.isatty() else 160
    return Console(file=sys.stdout, width=width, highlight=False, soft_wrap=False)


def _print_json(content: object) -> None:
    sys.stdout.write(json.dumps(content, indent=2, allow_nan=False) + "\n")


def _load(path: Path, overrides: Sequence[str] | None) -> Case:
    return read_case(path, overrides or ())


@app.command(
    help_prologue="""\
flexcam check case.toml
flexcam check case.toml --set run.speed=4000rpm --json
"""
)
def check(case: CaseFile, *, overrides: Overrides = None, as_json: Json = False) -> int:
    """Check a case and say what its model contains."""
    ready = prepare(_load(case, overrides))
    found = case_modes(ready.case)
    if as_json:
        mesh, system = ready.model.mesh, ready.problem.system
        _print_json({
            "status": "ok", "title": ready.case.record.title,
            "elements": len(mesh.elements()), "dof": system.size, "nodes": len(mesh.nodes),
            "members": {name: len(line) - 1 for name, line in mesh.lines.items()},
            "free_motions": found.modes.rigid, "steps": ready.problem.steps, "step_s": ready.problem.step,
            "frequencies_hz": found.modes.frequencies[found.modes.rigid :][:10].tolist(),
            "loads": {load.name: [system.names[i] for i in load.vector.nonzero()[0]] for load in system.loads},
            "case": ready.case.record.model_dump(mode="json", by_alias=True),
        })  # fmt: skip
    else:
        _out().print(console.model_table(ready, found))
    return DONE


@app.command(
    help_prologue="""\
flexcam run case.toml
flexcam run case.toml -o results --set run.revolutions=4 --overwrite
"""
)
def run(
    case: CaseFile, *, folder: Folder = Path("results"), overrides: Overrides = None, overwrite: Overwrite = False,
    as_json: Json = False,
) -> int:  # fmt: skip
    """Solve a case in time and write its result file."""
    ready = prepare(_load(case, overrides))
    sink = result_file(ready, folder, overwrite=overwrite)
    _solving.append(True)
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[sink], stop=lambda: bool(_signals))
    result = sink.path if response.status.ok else sink.partial
    if as_json:
        _print_json({
            "status": str(response.status.cause), "message": response.status.text, "remedy": response.status.remedy,
            "result": str(result), "steps": response.stats.steps, "dof": response.stats.unknowns,
            "seconds": response.stats.seconds,
        })  # fmt: skip
    else:
        out = _out()
        out.print(console.run_table(ready.case, response))
        out.print(f"\n{response.stats.steps} steps of {response.stats.unknowns} unknowns; result: {result}")
        out.print("Open it in ParaView 5.12 or newer; for older ones: " + f"flexcam export {result} --format pvd")
    return _ended(response.status)


@app.command(
    help_prologue="""\
flexcam modes case.toml
flexcam modes case.toml --count 20 --json
"""
)
def modes(case: CaseFile, *, count: int = 12, overrides: Overrides = None, as_json: Json = False) -> int:
    """Compute natural frequencies and what moves in each mode.

    Parameters
    ----------
    count
        How many of the lowest modes.
    """
    if count < 1:
        raise refuse("--count", count, "a whole number from 1")
    found = case_modes(_load(case, overrides), count)
    if as_json:
        _print_json({
            "status": "ok", "frequencies_hz": found.modes.frequencies.tolist(), "free_motions": found.modes.rigid,
            "effective_masses": found.effective.tolist(),
            "moves": [found.words(i) for i in range(len(found.shares))],
        })  # fmt: skip
    else:
        _out().print(console.mode_table(found))
    return DONE


@app.command(
    help_prologue="""\
flexcam compare case.toml
flexcam compare case.toml --probe valve --set run.speed=4000rpm
"""
)
def compare(case: CaseFile, *, probe: str | None = None, overrides: Overrides = None, as_json: Json = False) -> int:
    """Compare the flexible mechanism with the rigid one at a probe.

    Parameters
    ----------
    probe
        Point or component to compare at; the point of the first rocker, or the first probe, by default.
    """
    read = _load(case, overrides)
    at = probe or _default_probe(read)
    found = fidelity.deviation(read, at)
    published = any(contact.model == "published-load" for contact in read.record.contacts.values())
    mode_hz = fidelity.loaded_mode(read)[0] if published else None
    claims = fidelity.claims(read, at, found) if read.record.paper else []
    if as_json:
        _print_json({
            "status": str(found.status.cause), "probe": at, "speed_rpm": found.speed_rpm,
            "peak_deviation": found.peak_deviation, "rms_deviation": found.rms_deviation,
            "peak_acceleration_ratio": found.peak_acceleration_ratio, "loaded_mode_hz": mode_hz,
            "deviations": [{**asdict(one), "of_rigid": one.of_rigid} for one in found.deviations],
            "claims": [asdict(claim) for claim in claims],
        })  # fmt: skip
    else:
        out = _out()
        out.print(console.comparison_table(found))
        words = console.comparison_words(found, mode_hz)
        words += [console.COUPLINGS[m] for m in dict.fromkeys(c.model for c in read.record.contacts.values())]
        for sentence in words:
            out.print("\n" + sentence)
        if claims:
            out.print()
            out.print(console.claim_table(claims))
    return _ended(found.status)


@app.command(
    help_prologue="""\
flexcam export results/case.vtkhdf --format pvd --every 5
flexcam export case.toml --format msh -o meshes
"""
)
def export(
    source: Annotated[Path, Parameter(help="Result file, or a case file for --format msh.")], *,
    form: Annotated[Literal["pvd", "msh"], Parameter("--format", help="pvd: ParaView 5.11; msh: Gmsh 2.2.")] = "pvd",
    folder: Annotated[Path | None, Parameter(["-o", "--output"], help="Folder; that of the source by default.")] = None,
    every: Annotated[int, Parameter("--every", help="Take every so many of the saved instants.")] = 1,
    overwrite: Overwrite = False, as_json: Json = False,
) -> int:  # fmt: skip
    """Write a result as a ParaView collection, or a case's mesh as a Gmsh file."""
    target = made_folder(folder or source.parent)
    if form == "msh":
        path = target / f"{source.stem}.msh"
        write_mesh(prepare(read_case(source)).model.mesh, path, overwrite=overwrite)
        files = [path]
    else:
        files = write_pvd(read_result(source), target / f"{source.stem}.pvd", every=every, overwrite=overwrite)
    if as_json:
        _print_json({"status": "ok", "files": [str(path) for path in files]})
    else:
        _out().print(f"{files[0]} ({len(files)} files)" if len(files) > 1 else str(files[0]))
    return DONE


def _default_probe(case: Case) -> str:
    rockers = [rocker.to for rocker in case.record.rockers.values()]
    known = [*(p for p in case.record.output.probes if p in rockers), *case.record.output.probes]
    if not known:
        raise refuse("output.probes", "none", "at least one point to compare at", "", 'add probes = ["valve"]')
    return known[0]


def _ended(status: Status) -> int:
    if status.ok:
        return DONE
    sys.stderr.write(f"{status}\n")
    return _signal_code() if status.cause is Cause.INTERRUPTED else FAILED


def _refused(faults: Sequence[Fault], as_json: bool) -> int:
    if as_json:
        _print_json({"status": "refused", "errors": [fault.as_dict() for fault in faults]})
    else:
        sys.stderr.write("".join(f"{fault}\n" for fault in faults))
    return REFUSED


def _failed(status: Status, as_json: bool) -> int:
    if as_json:
        _print_json({"status": str(status.cause), "message": status.text, "remedy": status.remedy})
    return _ended(status)


def _crashed(words: Sequence[str], as_json: bool) -> int:
    with tempfile.NamedTemporaryFile(
        "w", prefix="flexcam-crash-", suffix=".txt", delete=False, encoding="utf-8"
    ) as file:
        file.write(f"flexcam {__version__}\n{' '.join(words)}\n\n{traceback.format_exc()}")
    message = f"a fault of flexcam itself; please report it with {file.name}"
    if as_json:
        _print_json({"status": "fault", "message": message, "crash_file": file.name})
    sys.stderr.write(f"{message}\n")
    return FAULT


_INTERRUPTED = Status(Cause.INTERRUPTED, "stopped by the user before anything was computed")
_signals: list[int] = []
_solving: list[bool] = []


def _on_signal(signum: int, frame: FrameType | None) -> None:
    """Let a run end at its next step; stop anything else at once."""
    del frame
    _signals.append(signum)
    if not _solving or len(_signals) > 1:
        raise KeyboardInterrupt


def _signal_code() -> int:
    return TERMINATED if signal.SIGTERM in _signals else INTERRUPTED


def _dispatch(words: Sequence[str]) -> int:
    as_json = "--json" in words
    try:
        code = int(app(words, exit_on_error=False, print_error=False, result_action="return_value") or DONE)
    except CycloptsError as fault:
        given = " ".join(words) or "nothing"
        code = _refused([Fault("command line", given, "see flexcam --help", str(fault), "")], as_json)
    except InputError as refusal:
        code = _refused(refusal.faults, as_json)
    except RunFailedError as failure:
        code = _failed(failure.status, as_json)
    except KeyboardInterrupt:
        code = _failed(_INTERRUPTED, as_json)
    except Exception:  # noqa: BLE001 - the one place where a fault of flexcam itself becomes a message
        code = _crashed(words, as_json)
    # A signal that arrived inside a finalizer was swallowed there; it still counts.
    return _signal_code() if _signals and code == DONE else code


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process with its exit code.

    Parameters
    ----------
    arguments
        Words after ``flexcam``; None for those of the process.

    Raises
    ------
    SystemExit
        Always, with the exit code.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _on_signal)
    try:
        code = _dispatch(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()
    except BrokenPipeError:  # the reader went away; Python would complain again when it closes the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = DONE
    raise SystemExit(code)
