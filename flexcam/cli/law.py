"""Command that evaluates motion laws: law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from flexcam import plotting
from flexcam.cams import LAWS, Criteria, Extreme, Law, criteria, kind_names, residual_spectrum
from flexcam.case.curves import parse_law, read_law
from flexcam.case.fault_report import parse_toml
from flexcam.cli import app as cli
from flexcam.core.errors import refuse, suggest_name
from flexcam.report.terminal import facts_table, plain_table, remove_noise

_CURVES = {"velocity": "s'", "acceleration": "s''", "jerk": "s'''", "moment": "s' s''"}


def _law_json(result: Criteria) -> dict[str, object]:
    ends = {f"z={z}": dict(zip(("s", "s'", "s''", "s'''"), end, strict=True)) for z, end in enumerate(result.ends)}
    return {
        "Cv": result.Cv, "Ca": result.Ca, "Cj": result.Cj, "Cm": result.Cm,
        "extremes": {name: getattr(result, name) for name in _CURVES},
        "jumps": result.jumps, "end_conditions": ends, "rest_at_ends": result.rest_at_ends,
        "symmetric": result.symmetric, "broken": result.violations, "rms": result.rms,
        "harmonics": result.harmonics,
    }  # fmt: skip


def format_criteria(found: Criteria, digits: int = 6) -> list[str]:
    """Return C_v, C_a, C_j and C_m of a law as texts."""
    values = (found.Cv, found.Ca, found.Cj, found.Cm)
    return ["infinite" if value is None else f"{value:.{digits}g}" for value in values]


def _law_facts(name: str, result: Criteria) -> Table:
    curves = {symbol: getattr(result, curve) for curve, symbol in _CURVES.items()}
    peaks = [1.0, *(max(abs(extreme.value) for extreme in curves[symbol]) for symbol in ("s'", "s''", "s'''"))]
    ends = [", ".join(f"{remove_noise(v, top):.6g}" for v, top in zip(end, peaks, strict=True)) for end in result.ends]
    largest = max(result.harmonics, default=0.0)
    rows = [
        ("criteria", "C_v {}, C_a {}, C_j {}, C_m {}".format(*format_criteria(result))),
        *((f"{symbol} ({curve})", "; ".join(map(_format_position, ("min", "max"), curves[symbol])))
          for curve, symbol in _CURVES.items()),
        ("discontinuities inside", ", ".join(list(_CURVES)[order - 1] for order in result.jumps) or "none"),
        ("s, s', s'', s''' at z = 0", ends[0]),
        ("s, s', s'', s''' at z = 1", ends[1]),
        ("symmetric", "yes" if result.symmetric else "no"),
        ("rms of s', s'', s'''", ", ".join(f"{value:.6g}" for value in result.rms)),
        ("harmonics of s''", ", ".join(f"{remove_noise(value, largest):.3g}" for value in result.harmonics)),
        *(("between two dwells", violation) for violation in result.violations),
    ]  # fmt: skip
    return facts_table(f"Motion law {name}, z = angle / duration of the rise", rows)


def _format_position(kind: str, extreme: Extreme) -> str:
    places = " and ".join(f"{round(z, 6):g}" for z in (extreme.at, *extreme.also))
    return f"{kind} {extreme.value:.6g} at z = {places}"


CRITERIA_LEGEND = (
    "C_v, C_a, C_j: max velocity, acceleration and jerk of the law, lift 1 over angle 1; "
    "C_m: max product of velocity and acceleration, which is proportional to the inertia torque"
)


def _spectrum_table(spectra: Mapping[str, Sequence[float]], ratios: Sequence[float]) -> Table:
    rows = [(name, *(f"{value:.6f}" for value in values)) for name, values in spectra.items()]
    title = "Residual vibration divided by lift; columns: rise time divided by the natural period"
    return plain_table(title, ("law", *(f"{r:g}" for r in ratios)), rows)


def find_law(name: str, parameters: list[str] | None = None) -> Law:
    """Return a law given by name and parameters, or by a file."""
    if name.endswith(".toml"):
        if parameters:
            raise refuse("--with", ", ".join(parameters), "nothing with a law file", "the file has all parameters")
        return read_law(Path(name)).law
    if not parameters and name not in LAWS and name not in kind_names():
        names = list(dict.fromkeys([*LAWS, *kind_names()]))
        allowed = f"one of {', '.join(names)}, or a law file (.toml)"
        raise refuse("law", repr(name), allowed, "", suggest_name(name, names))
    data: dict[str, object] = {"id": name}
    for parameter in parameters or ():
        key, equals, value = parameter.partition("=")
        if not equals:
            raise refuse("--with", repr(parameter), "key=value, such as b=0.25")
        if key.strip() in data:
            why = f"{key.strip()!r} is given twice"
            raise refuse("--with", repr(parameter), "every parameter once", why, "leave one out")
        try:
            data[key.strip()] = parse_toml(f"value = {value}")["value"]
        except ValueError:
            raise refuse("--with", repr(parameter), "a number or a list, such as exponents=[3,4,5]") from None
    return parse_law(data).law


@cli.command("""\
flexcam law --list
flexcam law 4-5-6-7
flexcam law scca --with b=0.25 --with c=0.5 --with d=0.25 --json
flexcam law best.toml --residual 1.5 --plot best.svg
""")
def law(
    name: Annotated[str | None, Parameter(help="Name of a motion law, or a law file (.toml).")] = None, *,
    every: Annotated[bool, Parameter("--list", help="List all motion laws with their criteria.")] = False,
    parameters: Annotated[list[str] | None, Parameter(
        "--with", help="Parameter of the law: KEY=VALUE. Repeatable.")] = None,
    residual: Annotated[list[float] | None, Parameter(
        "--residual", help="Ratio of rise time to natural period at which the residual vibration is computed. "
        "Repeatable.")] = None,
    plot: cli.Picture = None,
    spectrum: Annotated[Path | None, Parameter(
        "--spectrum", help="Also draw the residual vibration over rise time / period (.svg, .png or .pdf).")] = None,
    overwrite: cli.Overwrite = False, as_json: cli.Json = False,
) -> cli.CommandOutput:  # fmt: skip
    """Show the criteria of a motion law, or compare all laws: max velocity, acceleration, jerk, residual vibration.

    All values are normalized to lift 1 over angle 1.
    """
    ratios = tuple(residual or (1.0, 1.5, 2.0, 3.0, 5.0))
    if every:
        if name is not None or parameters is not None:
            text = name if name is not None else f"--with {', '.join(parameters or ())}"
            raise refuse("--list", text, "--list alone", "it lists every law", "leave one out")
        files = _draw_laws(LAWS, plot, spectrum, overwrite=overwrite)
        return replace(_compare_laws(ratios), files=files)
    if name is None:
        raise refuse("law", "nothing", "the name of a motion law, a law file (.toml), or --list")
    motion_law = find_law(name, parameters)
    result, vibration = criteria(motion_law), residual_spectrum(motion_law, ratios).tolist()
    pairs = [{"ratio": ratio, "amplitude": value} for ratio, value in zip(ratios, vibration, strict=True)]
    return cli.CommandOutput(
        [_law_facts(name, result), _spectrum_table({name: vibration}, ratios)],
        {"law": name, **_law_json(result), "residual": pairs},
        files=_draw_laws({name: motion_law}, plot, spectrum, overwrite=overwrite),
    )


def _compare_laws(ratios: Sequence[float]) -> cli.CommandOutput:
    results = {name: criteria(motion_law) for name, motion_law in LAWS.items()}
    spectra = {name: residual_spectrum(motion_law, ratios).tolist() for name, motion_law in LAWS.items()}
    names: dict[str, str] = {}  # first name of every law, with all its names
    for name, motion_law in LAWS.items():
        first = next((other for other in names if LAWS[other] == motion_law), name)
        names[first] = f"{names[first]}, {name}" if first in names else name
    rest = ("none", "s'", "s' s''", "s' s'' s'''")
    rows = [
        (names[name], *(f"{x:.4f}" for x in (c.Cv, c.Ca)), "infinite" if c.Cj is None else f"{c.Cj:.3f}",
         f"{c.Cm:.4f}", rest[c.rest_at_ends])
        for name, c in results.items() if name in names
    ]  # fmt: skip
    head = ("law", "C_v", "C_a", "C_j", "C_m", "zero at both ends")
    parts = [
        plain_table("Motion laws, lift 1 over angle 1", head, rows),
        CRITERIA_LEGEND,
        _spectrum_table({label: spectra[first] for first, label in names.items()}, ratios),
        f"Laws with parameters (flexcam law NAME --with KEY=VALUE): {', '.join(kind_names())}",
    ]
    laws = {name: {**_law_json(result), "residual": spectra[name]} for name, result in results.items()}
    return cli.CommandOutput(parts, {"ratios": ratios, "kinds": kind_names(), "laws": laws})


def _draw_laws(laws: Mapping[str, Law], plot: Path | None, spectrum: Path | None, *, overwrite: bool) -> list[Path]:
    cli.check_distinct_files({"--plot": plot, "--spectrum": spectrum})
    paths = [path for path in (plot, spectrum) if path is not None]
    for path in paths:
        plotting.figures.check_figure_path(path, overwrite=overwrite)
    draw = {plot: lambda: plotting.curves.law_figure(laws), spectrum: lambda: plotting.curves.spectrum_figure(laws)}
    return [plotting.figures.save_figure(draw[path](), path, overwrite=overwrite) for path in paths]
