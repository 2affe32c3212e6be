"""Make docs/trade.md: error and cost of simpler models of the published cases and the pushrod engine.

Run the script after a change of models or time integration; it takes some minutes. Processor times depend on the machine,
work and errors do not.
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
ENGINE = "cases/pushrod-engine/intake.toml"
ENGINE_OVERRIDES = ["run.crank_speed=4000rpm", "run.steps_per_revolution=1440", "run.revolutions=1"]
TOLERANCES = (0.1, 0.01, 0.001)
KINDS = ("lift", "velocity", "acceleration")


def main() -> None:
    """Write the page."""
    lines = [*HEAD, *_cheapest(), *_ladder("cases/tayeb/model-3-shm.toml", []), *_ladder(ENGINE, ENGINE_OVERRIDES), ""]
    (ROOT / "docs" / "trade.md").write_text("\n".join(lines), encoding="utf-8")


HEAD = [
    "# Cost of simpler models",
    "",
    "`flexcam trade CASE` prints such tables for any case ([definitions](topics/fidelity.md#cost-of-simpler-models)).",
    "`docs/make_trade.py` made this page on "
    + platform.machine()
    + ". Errors are in %. The tables of models list the beams",
    "of the case, and the models with a smaller maximum error than every model of less work.",
    "",
    "## The cheapest model within a tolerance of the lift",
    "",
    "The rows of the published models have the largest errors with the three motion laws of the paper.",
    "",
    "| case | error of the reference | " + " | ".join(f"within {100 * t:g} %" for t in TOLERANCES) + " |",
    "|---|---|" + "---|" * len(TOLERANCES),
]


def _evaluate(path: str, overrides: list[str]) -> tuple[Case, Reference, list[ModelEvaluation]]:
    case = read_case(ROOT / path, overrides)
    return case, *evaluate_ladder(case, "valve", repeats=3)


def _cheapest() -> list[str]:
    rows: list[str] = []
    for name, paths, overrides in [
        *((name, paths, list[str]()) for name, paths in PUBLISHED.items()),
        ("intake", [ENGINE], ENGINE_OVERRIDES),
    ]:
        runs = [_evaluate(path, overrides)[1:] for path in paths]
        errors = [reference.errors["lift"] / reference.size["lift"] for reference, _ in runs]
        cells = [
            _maximum([_first(models, tolerance - error) for (_, models), error in zip(runs, errors, strict=True)])
            for tolerance in TOLERANCES
        ]
        rows.append(f"| {name} | {100 * max(errors):.1g} % | {' | '.join(cells)} |")
    return [*rows, ""]


def _first(models: list[ModelEvaluation], tolerance: float) -> tuple[str, float]:
    """Return the first model within a tolerance of the lift, with its error."""
    for model in models:
        if model.errors.get("lift", 1.0) <= tolerance:
            return f"{model.rung}, {model.steps} steps", model.errors["lift"]
    return "none", 0.0


def _maximum(found: list[tuple[str, float]]) -> str:
    """Return the model or models with the maximum error."""
    return f"{' or '.join(dict.fromkeys(model for model, _ in found))}: {100 * max(error for _, error in found):.2g} %"


def _ladder(path: str, overrides: list[str]) -> list[str]:
    case, reference, models = _evaluate(path, overrides)
    kinds = [*KINDS, *(kind for kind in reference.errors if kind not in KINDS)]
    rows = [
        f"| {model.rung} | {model.steps} | {model.unknowns} | {model.work:.3g} | {model.seconds:.2g} | "
        f"{' | '.join(_percent(model.errors.get(kind)) for kind in kinds)} |"
        for model in models
        if model.best or (model.rung == "beams" and model.steps == case.record.run.steps_per_revolution)
    ]
    errors = " | ".join(_percent(reference.errors[kind] / reference.size[kind]) for kind in kinds)
    suffix = f" with {', '.join(f'`{override}`' for override in overrides)}" if overrides else ""
    return [
        f"## {case.record.title}",
        "",
        f"`{path}`{suffix}.",
        "",
        "| model | steps/rev | unknowns | work | cpu s | " + " | ".join(kinds) + " |",
        "|---|---|---|---|---|" + "---|" * len(kinds),
        *rows,
        f"| reference | {reference.steps} | | | | {errors} |",
        "",
    ]


def _percent(ratio: float | None) -> str:
    return "" if ratio is None else f"{float(f'{100.0 * ratio:.2g}'):g}"


if __name__ == "__main__":
    main()
