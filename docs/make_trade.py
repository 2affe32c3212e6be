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
PUBLISHED = {
    f"model-{n}": [f"cases/tayeb/model-{n}-{law}.toml" for law in ("shm", "parabolic", "cycloidal")] for n in (1, 2, 3)
}
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
    "The cheapest model within a given error, and error against cost of the models, as `flexcam trade CASE` prints them for any case;",
    "[definitions](topics/fidelity.md#cost-of-simpler-models). Made by `docs/make_trade.py` on "
    + platform.machine()
    + ".",
    "Errors of the beams of the case, and of the models with a smaller maximum error than every model of less work, are in %.",
    "",
    "## The cheapest model within a tolerance of the lift",
    "",
    "The rows of the published models have the largest errors with the three motion laws of the paper.",
    "",
    "| case | error of the reference | " + " | ".join(f"within {100 * t:g} %" for t in TOLERANCES) + " |",
    "|---|---|" + "---|" * len(TOLERANCES),
]


def _traded(path: str, overrides: list[str]) -> tuple[Case, Reference, list[ModelEvaluation]]:
    case = read_case(ROOT / path, overrides)
    return case, *evaluate_ladder(case, "valve", repeats=3)


def _cheapest() -> list[str]:
    rows: list[str] = []
    for name, paths, overrides in [
        *((name, paths, list[str]()) for name, paths in PUBLISHED.items()),
        ("intake", [FLAGSHIP], SHORTER),
    ]:
        runs = [_traded(path, overrides)[1:] for path in paths]
        own = [against.errors["lift"] / against.size["lift"] for against, _ in runs]
        cells = [
            _largest([_first(found, tolerance - error) for (_, found), error in zip(runs, own, strict=True)])
            for tolerance in TOLERANCES
        ]
        rows.append(f"| {name} | {100 * max(own):.1g} % | {' | '.join(cells)} |")
    return [*rows, ""]


def _first(found: list[ModelEvaluation], tolerance: float) -> tuple[str, float]:
    """Return the first model within a tolerance of the lift, with its error."""
    for one in found:
        if one.errors.get("lift", 1.0) <= tolerance:
            return f"{one.rung}, {one.steps} steps", one.errors["lift"]
    return "none", 0.0


def _largest(found: list[tuple[str, float]]) -> str:
    """Return the model or models, with the largest error."""
    return f"{' or '.join(dict.fromkeys(model for model, _ in found))}: {100 * max(error for _, error in found):.2g} %"


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
        f"`{path}`{given}.",
        "",
        "| model | steps/rev | unknowns | work | cpu s | " + " | ".join(kinds) + " |",
        "|---|---|---|---|---|" + "---|" * len(kinds),
        *rows,
        f"| reference | {against.steps} | | | | {own} |",
        "",
    ]


def _percent(share: float | None) -> str:
    return "" if share is None else f"{float(f'{100.0 * share:.2g}'):g}"


if __name__ == "__main__":
    main()
