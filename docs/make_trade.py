"""Make docs/trade.md: error and cost of simpler models of the published cases and of the pushrod engine.

Run it after a change of the models or of the integration; it takes some minutes. Work and errors are the same on every
machine, processor times are not.
"""

from __future__ import annotations

import platform
from pathlib import Path

from flexcam import read_case
from flexcam.analysis.model_choice import ModelEvaluation, Reference, evaluate_ladder
from flexcam.case.case import Case

ROOT = Path(__file__).parents[1]
PUBLISHED = [f"cases/tayeb/model-{n}-{law}.toml" for n in (1, 2, 3) for law in ("shm", "parabolic", "cycloidal")]
FLAGSHIP = "cases/pushrod-engine/intake.toml"
SHORTER = ["run.crank_speed=4000rpm", "run.steps_per_revolution=1440", "run.revolutions=1"]
TOLERANCES = (0.1, 0.01, 0.001)
KINDS = ("lift", "velocity", "acceleration")


def main() -> None:
    """Write the page."""
    lines = [*HEAD, *_cheapest(), *_ladder("cases/tayeb/model-3-shm.toml", []), *_ladder(FLAGSHIP, SHORTER), ""]
    (ROOT / "docs" / "trade.md").write_text("\n".join(lines), encoding="utf-8")


HEAD = [
    "# Cost of simpler models",
    "",
    "The cheapest model of the published cases and of the pushrod engine within a given error, and error against cost of the models.",
    "`flexcam trade CASE` prints the same for any case. Made by `docs/make_trade.py` on " + platform.machine() + ".",
    "",
    "The reference has three times the elements and four times the steps of the case. An error is relative to the maximum (of the lift:",
    "to its range): the root mean square over the run for motions, the maximum difference for forces. Work is unknowns times steps.",
    "",
    "## The cheapest model within a tolerance of the lift",
    "",
    "| case | error of the reference | " + " | ".join(f"within {100 * t:g} %" for t in TOLERANCES) + " |",
    "|---|---|" + "---|" * len(TOLERANCES),
]


def _traded(path: str, overrides: list[str]) -> tuple[Case, Reference, list[ModelEvaluation]]:
    case = read_case(ROOT / path, overrides)
    return case, *evaluate_ladder(case, "valve", repeats=3)


def _cheapest() -> list[str]:
    rows: list[str] = []
    for path, overrides in [*((path, list[str]()) for path in PUBLISHED), (FLAGSHIP, SHORTER)]:
        case, against, found = _traded(path, overrides)
        own = against.errors["lift"] / against.size["lift"]
        cells = [_first(found, tolerance - own) for tolerance in TOLERANCES]
        rows.append(f"| {case.name} | {100 * own:.1g} % | {' | '.join(cells)} |")
    return [*rows, ""]


def _first(found: list[ModelEvaluation], tolerance: float) -> str:
    for one in found:
        if one.errors.get("lift", 1.0) <= tolerance:
            return f"{one.rung}, {one.steps} steps: {100 * one.errors['lift']:.2g} %"
    return "none"


def _ladder(path: str, overrides: list[str]) -> list[str]:
    case, against, found = _traded(path, overrides)
    kinds = [*KINDS, *(kind for kind in against.errors if kind not in KINDS)]
    rows = [
        f"| {one.rung} | {one.steps} | {one.unknowns} | {one.work:.3g} | {one.seconds:.2g} | "
        f"{' | '.join(_percent(one.errors.get(kind)) for kind in kinds)} |"
        for one in found
        if one.best or (one.rung == "beams" and one.steps == case.record.run.steps_per_revolution)
    ]
    own = " | ".join(_percent(against.errors[kind] / against.size[kind]) for kind in kinds)
    given = f" with {', '.join(f'`{one}`' for one in overrides)}" if overrides else ""
    return [
        f"## {case.record.title}",
        "",
        f"`{path}`{given}. Errors in % of the beams of the case, and of the models",
        "with a smaller maximum error than every model of less work.",
        "",
        "| model | steps/rev | unknowns | work | cpu s | " + " | ".join(kinds) + " |",
        "|---|---|---|---|---|" + "---|" * len(kinds),
        *rows,
        f"| reference | {against.steps} | | | | {own} |",
        "",
    ]


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100.0 * share:.2g}"


if __name__ == "__main__":
    main()
