"""Commands that work on a case: check, run, modes, compare."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from flexcam import fidelity
from flexcam.budget import affordable
from flexcam.case import Case, build_model, read_case
from flexcam.checks import did_you_mean, refuse
from flexcam.commands.app import (
    AllowLarge,
    CaseFile,
    Folder,
    Json,
    Overrides,
    Overwrite,
    app,
    load,
    load_beams,
    quantity,
    running,
)
from flexcam.console.cases import (
    claim_table,
    comparison_json,
    comparison_table,
    comparison_words,
    couplings,
    left_out,
    mac_table,
    mode_table,
    model_table,
    resolved,
)
from flexcam.console.doubts import balances, doubts, input_doubts, lost_energy, run_doubts
from flexcam.console.fidelity import choice_json, choice_words, error_table
from flexcam.console.results import operation_table, periodicity, run_table, strength_table, unknowns
from flexcam.console.watched import Watched
from flexcam.integrate import integrated, solve
from flexcam.io import made_folder, read_result, write_modes
from flexcam.response import Cause, Response, RunFailedError, Stats, Status, heed
from flexcam.runner import (
    budget_of,
    geometry_of,
    mode_likeness,
    prepare,
    recent,
    result_file,
    scalar_probe,
    standing,
    unfinished,
)
from flexcam.runner import modes as case_modes
from flexcam.runner import run as solve_case
from flexcam.terminal import out, print_json, progress
from flexcam.train import StrengthSink, build_structure, member_masses, operation
from flexcam.units import RPM

Prestress = Annotated[
    Literal["rest", "equilibrium"] | None,
    Parameter("--prestress", help="Count in the axial forces as installed (rest), or under all loads (equilibrium)."),
]

Resume = Annotated[
    bool, Parameter("--resume", negative=(), help="Go on with the run that left a partial result in the folder.")
]
TimeLimit = Annotated[
    str | None,
    Parameter("--time-limit", help="End the run after so long, such as 30s, 5min or 2h; what is done stays."),
]


@app.command(
    help_prologue="""\
flexcam check case.toml
flexcam check case.toml --set run.speed=4000rpm --json
"""
)
def check(case: CaseFile, *, overrides: Overrides = None, as_json: Json = False) -> None:
    """Check a case, say what its model contains, and print it with every default filled in."""
    read = load(case, overrides)
    ready = standing(read)
    found, takes = case_modes(read), budget_of(ready, "revolution")
    if as_json:
        mesh, system = ready.model.mesh, ready.problem.system
        print_json({
            "status": "ok", "title": ready.case.record.title,
            "elements": len(mesh.elements()), "dof": system.size,
            "integrated": integrated(ready.problem),
            "left_out": left_out(ready), "nodes": len(mesh.nodes),
            "members": {name: len(line) - 1 for name, line in mesh.lines.items()},
            "masses": {name: part.body.mass for name, part in ready.model.masses.items()},
            "springs": {name: spring.stiffness for name, spring in ready.model.springs.items()},
            "supports": {point: list(held) for point, held in ready.model.supports.items()},
            "member_masses": member_masses(ready.model),
            "free_motions": found.modes.rigid, "steps": ready.problem.steps, "step_s": ready.problem.step,
            "memory_bytes": takes.memory, "result_bytes": takes.file,
            "frequencies_hz": found.modes.frequencies[found.modes.rigid :][:10].tolist(),
            "warnings": doubts(found) + input_doubts(ready),
            "loads": {load.name: [system.names[i] for i in load.vector.nonzero()[0]] for load in system.loads},
            "case": ready.case.record.model_dump(mode="json", by_alias=True),
        })  # fmt: skip
    else:
        out().print(model_table(ready, found, takes))
        for sentence in doubts(found) + input_doubts(ready):
            out().print("\n" + sentence)
        out().print("\n# the case as it is run, SI\n" + resolved(ready.case))


@app.command(
    help_prologue="""\
flexcam run case.toml
flexcam run case.toml -o results --set run.revolutions=4 --overwrite
flexcam run case.toml -o results --resume
flexcam run case.toml --time-limit 5min
"""
)
def run(
    case: CaseFile, *, folder: Folder = Path("results"), overrides: Overrides = None, overwrite: Overwrite = False,
    time_limit: TimeLimit = None, resume: Resume = False, allow_large: AllowLarge = False, as_json: Json = False,
) -> Status:  # fmt: skip
    """Solve a case in time and write its result file."""
    until = None if time_limit is None else time.monotonic() + _seconds(time_limit)
    read, choice = fidelity.chosen(load(case, overrides))
    probe = scalar_probe(prepare(read)) if read.record.fidelity.estimate else ""
    ready = prepare(read, until=until, allow_large=allow_large)
    if not allow_large:
        affordable(budget_of(ready, "revolution"), folder)
    earlier = unfinished(ready, folder) if resume else None
    strength, kept, watched = StrengthSink(build_structure(ready.model)), recent(ready), Watched.of(ready)

    def doubtful(stats: Stats) -> list[str]:
        return run_doubts(ready, watched, operation(ready.model, kept.response(), ready.revolution), stats)

    sink = result_file(ready, folder, overwrite=overwrite, resume=earlier, warnings=doubtful)
    running.solving = True
    with progress(ready.problem.steps) as bar:
        response = solve(
            ready.problem, ready.scheme, save=ready.save, sinks=[strength, *watched.sinks, sink, *bar],
            stop=running.stopped, until=until, memory=kept, resume=earlier,
        )  # fmt: skip
    result = sink.path if response.status.ok else sink.partial
    figures = operation(ready.model, response, ready.revolution)
    errors, doubt = _estimated(read, probe) if probe and response.status.ok else ([], [])
    warned = doubtful(response.stats) + doubt
    stressed = strength.members() if read.record.fidelity.model == "beams" else {}
    if as_json:
        print_json({
            "status": str(response.status.cause), "message": response.status.text, "remedy": response.status.remedy,
            "result": str(result), "steps": response.stats.steps, "dof": ready.problem.system.size,
            "integrated": response.stats.unknowns,
            "seconds": response.stats.seconds,
            "events": response.stats.events, "periodicity": periodicity(response),
            "energy_lost": lost_energy(watched.extremes), "imbalance": response.stats.imbalance,
            "warnings": warned,
            "train": {figure.name: figure.value for figure in figures},
            "errors": [asdict(one) for one in errors],
            "choice": None if choice is None else choice_json(choice),
            "strength": {name: asdict(member) for name, member in stressed.items()},
        })  # fmt: skip
    else:
        out().print(run_table(ready.case, watched.extremes))
        if stressed:
            out().print()
            out().print(strength_table(stressed))
        if figures:
            out().print()
            out().print(operation_table(figures))
        if errors:
            out().print()
            out().print(error_table(errors))
        for sentence in choice_words(choice) if choice else []:
            out().print("\n" + sentence)
        for sentence in couplings(ready.case) + warned:
            out().print("\n" + sentence)
        if response.stats.periodicity >= 0.0:
            out().print(f"\nThe start returns after a revolution within {response.stats.periodicity:.3g} of the motion")
        if told := balances(watched.extremes, response.stats):
            out().print(f"\nWhat adds up: {told}")
        out().print(f"\n{response.stats.steps} steps of {unknowns(response)}; result: {result}")
        out().print(f"Open it in ParaView 5.12 or newer; for older ones: flexcam export {result} --format pvd")
    if response.status.ok and choice is not None and not choice.met:
        return Status(Cause.TOLERANCE, f"the tolerance is not met: {choice.why}", "allow more, or refine the case")
    return response.status


@app.command(
    help_prologue="""\
flexcam modes case.toml --count 20
flexcam modes case.toml --prestress rest -o results
flexcam modes case.toml --mac finer.toml
"""
)
def modes(
    case: CaseFile, *, count: int = 12, prestress: Prestress = None, mac: Path | None = None,
    folder: Annotated[Path | None, Parameter(["-o", "--output"], help="Also write shapes for ParaView.")] = None,
    overrides: Overrides = None, overwrite: Overwrite = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Compute natural frequencies and what moves in each mode.

    Parameters
    ----------
    count
        How many of the lowest modes.
    mac
        Another case, as it stands in its file, whose modes are compared with these (modal assurance criterion).
    """
    if count < 1:
        raise refuse("--count", count, "a whole number from 1")
    read = load(case, overrides)
    found = case_modes(read, count, prestress=prestress)
    likeness = None
    if mac is not None:
        other = read_case(mac)
        likeness = mode_likeness(read, found, other, case_modes(other, count, prestress=prestress))
    files: list[Path] = []
    if folder is not None:
        path = made_folder(folder) / f"{read.name}-modes.vtkhdf"
        drawn = geometry_of(build_model(read))
        files = write_modes(path, drawn, found.modes.frequencies, found.modes.shapes, overwrite=overwrite)
    if as_json:
        print_json({
            "status": "ok", "frequencies_hz": found.modes.frequencies.tolist(), "free_motions": found.modes.rigid,
            "effective_masses": found.effective.tolist(), "lost": found.modes.lost,
            "rounding": found.modes.rounding.tolist(), "warnings": doubts(found),
            "moves": [found.words(i) for i in range(len(found.shares))],
            "mac": None if likeness is None else likeness.tolist(), "files": [str(path) for path in files],
        })  # fmt: skip
        return
    out().print(mode_table(found))
    for sentence in doubts(found):
        out().print("\n" + sentence)
    if likeness is not None:
        out().print()
        out().print(mac_table(likeness))
    if files:
        out().print(f"\n{files[0]}: pick a mode in Warp By Vector and press play; {files[1]} holds the still shapes")


@app.command(
    help_prologue="""\
flexcam compare case.toml
flexcam compare case.toml --probe valve --set run.speed=4000rpm
"""
)
def compare(
    case: Annotated[Path, Parameter(help="Case file (TOML), or a result with --against another.")], *,
    probe: str | None = None,
    against: Annotated[
        str | None, Parameter(help="Model of the ladder, other case, or result; rigid if absent.")
    ] = None,
    overrides: Overrides = None, as_json: Json = False,
) -> Status:  # fmt: skip
    """Compare the flexible mechanism with the rigid one at a probe, or any two models, cases or results.

    Parameters
    ----------
    probe
        Point or component to compare at; by default a rocker's point, else the first probe that a cam moves.
    """
    if against is not None:
        return _two(case, against, probe, overrides, as_json)
    read = load_beams(case, overrides)
    at = probe or scalar_probe(prepare(read))
    found = fidelity.deviation(read, at)
    published = any(contact.model == "published-load" for contact in read.record.contacts.values())
    mode_hz = fidelity.loaded_mode(read)[0] if published else None
    claims = fidelity.claims(read, at, found) if read.record.paper and found.status.ok else []
    if as_json:
        print_json({
            **comparison_json(found), "loaded_mode_hz": mode_hz,
            "claims": [asdict(claim) for claim in claims],
        })  # fmt: skip
        return found.status
    out().print(comparison_table(found))
    words = comparison_words(found, mode_hz)
    for sentence in words + couplings(read):
        out().print("\n" + sentence)
    if claims:
        out().print()
        out().print(claim_table(claims))
    return found.status


def _seconds(text: str) -> float:
    """Return the time a run is given, s."""
    given = quantity("--time-limit", text, "time", "s")
    if not given > 0.0:
        raise refuse("--time-limit", text, "a time above zero, such as 30s, 5min or 2h")
    return given


def _estimated(case: Case, probe: str) -> tuple[list[fidelity.Error], list[str]]:
    """Return how far the numbers may be off, or a sentence why that is not known."""
    try:
        return fidelity.estimate(case, probe), []
    except RunFailedError as failure:
        return [], [
            f"Warning: no error is estimated, as a run with other steps or elements ended: {failure.status.text}"
        ]


def _two(case: Path, against: str, probe: str | None, overrides: Overrides, as_json: bool) -> Status:
    """Compare two models of a case, two cases or two results."""
    if case.suffix == _RESULT:
        from flexcam.commands.sources import Source

        one, read = read_result(case).response, None
        at = probe or scalar_probe(Source(case).ready)
    else:
        read = load(case, overrides)
        one, at = _whole(solve_case(read)), probe or scalar_probe(prepare(read))
    other = _other(against, read, overrides)
    found = fidelity.between(one, other, at, _speed_rpm(one), (case.stem, Path(against).stem))
    if as_json:
        print_json({**comparison_json(found), "compared": list(found.names)})
        return found.status
    out().print(comparison_table(found))
    for sentence in comparison_words(found, None):
        out().print("\n" + sentence)
    return found.status


def _other(against: str, read: Case | None, overrides: Overrides) -> Response:
    """Return what is compared with: a result, another case, or a model of the case's ladder."""
    path = Path(against)
    if path.suffix == _RESULT:
        return read_result(path).response
    if path.suffix == ".toml":
        return _whole(solve_case(load(path, overrides)))
    rungs = {} if read is None else {rung.name: rung for rung in fidelity.ladder(read)}
    if against not in rungs:
        allowed = f"a case, a result, or one of {', '.join(rungs)}" if rungs else "a case or a result"
        raise refuse("--against", repr(against), allowed, "", did_you_mean(against, list(rungs)))
    return _whole(rungs[against].run())


def _whole(response: Response) -> Response:
    """Return a run that is compared with; a Ctrl-C in it ends the command."""
    heed(response.status)
    return response


def _speed_rpm(response: Response) -> float:
    """Return the mean camshaft speed of a run, rpm."""
    turned, passed = (float(one[-1] - one[0]) for one in (response.angle, response.time))
    return turned / passed / RPM if passed > 0.0 else 0.0


_RESULT = ".vtkhdf"
