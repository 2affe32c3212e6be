"""Commands for case files and for the installation: new, check, schema, selftest."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import prepare_without_periodic_search
from flexcam.analysis.run import estimate_case_resources
from flexcam.analysis.run_checks import check_input
from flexcam.analysis.selftest import all_checks, installation_info
from flexcam.case.case import CaseRecord
from flexcam.case.input_checks import check_coil_bind
from flexcam.case.reader import complete_case_tables
from flexcam.case.starters import new_case, templates
from flexcam.cli import app as cli
from flexcam.core.errors import refuse
from flexcam.dynamics import Cause, Status, integrated_size
from flexcam.io import format_toml
from flexcam.report.tables import describe_inactive, model_table, spring_curve_rows, spring_curve_table
from flexcam.report.terminal import facts_table, plain_table, print_json
from flexcam.valvetrain import member_masses


@cli.command("""\
flexcam new --list
flexcam new pushrod-engine
flexcam new measured-lift -o engine/intake.toml
""")
def new(
    template: Annotated[str | None, Parameter(help="Name of the starter case; without it, all are listed.")] = None, *,
    every: Annotated[bool, Parameter("--list", help="List all starter cases.")] = False,
    target: Annotated[Path | None, Parameter(["-o", "--output"], help="Case file; TEMPLATE.toml by default.")] = None,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Write a commented starter case to edit.

    Without a name it lists the starter cases. Start here, then check and run the file.
    """
    if every and template is not None:
        raise refuse("--list", template, "--list alone", "it lists every starter case", "leave one out")
    if template is None:
        table = plain_table("Starter cases", ("flexcam new", "content"), templates().items())
        return cli.CommandOutput([table], {"templates": templates()})
    files = new_case(template, target, overwrite=overwrite)
    text = f"Next: flexcam check {files[0]}, flexcam run {files[0]}, flexcam view {files[0]}"
    return cli.CommandOutput(["\n".join(map(str, files)), text], {"files": files})


@cli.command("""\
flexcam check case.toml
flexcam check case.toml --set run.speed=4000rpm --json
flexcam check case.toml --echo
""")
def check(
    case: cli.CaseFile, *,
    echo: Annotated[bool, Parameter("--echo", help="Also print the case as TOML with all default values.")] = False,
    overrides: cli.Overrides = None, units: cli.Units = None, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Check a case file and summarize its model: size, masses, natural frequencies, warnings.

    It reports as many errors as possible at once. An error in a table can hide further errors in that table and in
    tables that refer to it: correct the reported errors, then run check again. If the TOML syntax is wrong, it reports
    only that error. It estimates the memory and disk space of a run, but does not run the case.
    """
    read = cli.load_case(case, overrides)
    ready = prepare_without_periodic_search(read)
    modal, resources = modes(read), estimate_case_resources(ready, "revolution")
    warnings = [*filter(None, [modal.modes.describe_rounding()]), *check_input(ready)]
    if not ready.problem.system.is_kinematic:  # `check_input` has it for rigid trains; a run reports it from its motion
        warnings += check_coil_bind(ready.model, read.speed)
    springs = {name: spring for name, spring in ready.model.springs.items() if spring.table or spring.coils}
    mesh, system = ready.model.mesh, ready.problem.system
    curves = {name: spring_curve_rows(spring) for name, spring in springs.items()}
    json = {
        "title": ready.case.record.title,
        "elements": len(mesh.elements()), "dof": system.size, "integrated": integrated_size(ready.problem),
        "left_out": describe_inactive(ready), "nodes": len(mesh.nodes),
        "members": {name: len(line) - 1 for name, line in mesh.lines.items()},
        "masses": {name: part.body.mass for name, part in ready.model.masses.items()},
        "springs": {name: spring.stiffness for name, spring in ready.model.springs.items()},
        **({"spring_curves": curves} if curves else {}),
        "supports": {point: list(components) for point, components in ready.model.supports.items()},
        "member_masses": member_masses(ready.model),
        "free_motions": modal.modes.rigid, "steps": ready.problem.steps, "step_s": ready.problem.step,
        "memory_bytes": resources.memory, "result_bytes": resources.file,
        "frequencies_hz": modal.modes.frequencies[modal.modes.rigid :][:10],
        "warnings": warnings,
        "loads": {load.name: [system.names[i] for i in load.vector.nonzero()[0]] for load in system.loads},
        "case": ready.explicit_case.record.model_dump(mode="json", by_alias=True),
    }  # fmt: skip
    parts = [model_table(ready, modal, resources), *(spring_curve_table(*item) for item in springs.items()), *warnings]
    if not echo:
        return cli.CommandOutput([*parts, "--echo prints the case with all default values."], json)
    text = "\n# the case with all default values\n" + format_toml(complete_case_tables(ready.explicit_case))
    return cli.CommandOutput(parts, json, text=text)


@cli.command("flexcam schema > case.schema.json\n")
def schema(*, as_json: cli.Json = False) -> None:
    """Print the JSON Schema of case files, which editors use for completion and checks.

    The output is JSON with and without --json.
    """
    del as_json
    standard = "https://json-schema.org/draft/2020-12/schema"
    print_json({"$schema": standard, **CaseRecord.model_json_schema(by_alias=True)})


@cli.command("""\
flexcam selftest
flexcam selftest --json
""")
def selftest(*, as_json: cli.Json = False) -> cli.CommandOutput:
    """Check this installation: closed-form solutions, published values, and a comparison of the solver engines.

    It takes some seconds, or half a minute when code is compiled for the first time. The exit code is 3 if a check
    fails.
    """
    checks = list(all_checks())
    failed = [result.quantity for result in checks if not result.passed]
    status = Status()
    if failed:
        text = f"{len(failed)} of {len(checks)} checks exceed their tolerance: {'; '.join(failed)}"
        remedy = "install flexcam again in a new environment; if that does not help, please report it"
        status = Status(Cause.FAULT, text, remedy)
    rows = [
        (result.quantity, f"{result.reference:.8g} {result.unit}".removesuffix(" 1"), f"{result.computed:.8g}",
         f"{result.error:.1e}", f"{result.tolerance:.1e}", "passed" if result.passed else "FAILED", result.source)
        for result in checks
    ]  # fmt: skip
    heads = ("quantity", "reference", "computed", "error", "allowed", "result", "source of the reference")
    installed = [(name.replace("extra ", "optional packages: "), text) for name, text in installation_info().items()]
    parts = [plain_table("Checks", heads, rows), facts_table("Installed packages", installed)]
    parts += [f"All {len(checks)} checks passed"] if status.ok else []
    json = {
        "status": status.cause, "message": status.text, "remedy": status.remedy,
        "checks": [{**asdict(result), "error": result.error, "passed": result.passed} for result in checks],
        "installed": installation_info(),
    }  # fmt: skip
    return cli.CommandOutput(parts, json, status=status)
