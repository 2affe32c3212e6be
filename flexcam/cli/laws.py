"""Commands and tables about motion laws: law, laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from flexcam.cams import LAWS, Criteria, Extreme, Law, criteria, kind_names, residual_spectrum
from flexcam.case.lift import parse_law, read_law
from flexcam.case.toml_lines import parse_toml
from flexcam.cli.app import Json, Overwrite, Picture, app, check_figure_path
from flexcam.cli.arguments import check_distinct_files
from flexcam.core.errors import refuse, suggest_name
from flexcam.report.formatting import remove_noise
from flexcam.report.terminal import facts_table, plain_table, print_json, result_console

_CURVES = (("velocity", "s'"), ("acceleration", "s''"), ("jerk", "s'''"), ("moment", "s' s''"))


def law_json(found: Criteria) -> dict[str, object]:
    """Return the criteria of a law for ``--json``."""
    ends = {f"z={z}": dict(zip(("s", "s'", "s''", "s'''"), end, strict=True)) for z, end in enumerate(found.ends)}
    return {
        "Cv": found.Cv, "Ca": found.Ca, "Cj": found.Cj, "Cm": found.Cm,
        "extremes": {name: [asdict(one) for one in getattr(found, name)] for name, _ in _CURVES},
        "jumps": list(found.jumps), "end_conditions": ends, "rest_at_ends": found.rest_at_ends,
        "symmetric": found.symmetric, "broken": list(found.violations), "rms": list(found.rms),
        "harmonics": list(found.harmonics),
    }  # fmt: skip


def law_facts(name: str, found: Criteria) -> Table:
    """Return the table of the criteria of one law."""
    criteria = (("C_v", found.Cv), ("C_a", found.Ca), ("C_j", found.Cj), ("C_m", found.Cm))
    rows = [("criteria", ", ".join(f"{n} {'infinite' if x is None else f'{x:.6g}'}" for n, x in criteria))]
    rows += [
        (f"{symbol} ({curve})", f"{_format_position(low)}, {_format_position(high)}")
        for curve, symbol in _CURVES
        for low, high in [getattr(found, curve)]
    ]
    steps = ", ".join(_CURVES[order - 1][0] for order in found.jumps)
    peaks = [1.0, *(max(abs(one.value) for one in getattr(found, curve)) for curve, _ in _CURVES[:3])]
    ends = [", ".join(f"{remove_noise(v, peak):.6g}" for v, peak in zip(end, peaks, strict=True)) for end in found.ends]
    largest = max(found.harmonics, default=0.0)
    rows += [
        ("steps inside", steps or "none"),
        ("s, s', s'', s''' at z = 0", ends[0]),
        ("s, s', s'', s''' at z = 1", ends[1]),
        ("symmetric", "yes" if found.symmetric else "no"),
        ("rms of s', s'', s'''", ", ".join(f"{value:.6g}" for value in found.rms)),
        ("harmonics of s''", ", ".join(f"{remove_noise(value, largest):.3g}" for value in found.harmonics)),
        *(("not met between dwells", said) for said in found.violations),
    ]
    return facts_table(f"Motion law {name}", rows)


def _format_position(extreme: Extreme) -> str:
    return f"{extreme.value:.6g} at z = {', '.join(f'{z:.6f}' for z in (extreme.at, *extreme.also))}"


def laws_table(found: Mapping[str, Criteria]) -> Table:
    """Return a table that compares all laws."""
    rest = ("none", "s'", "s' s''", "s' s'' s'''")
    rows = [
        (name, *(f"{x:.4f}" for x in (c.Cv, c.Ca)), "infinite" if c.Cj is None else f"{c.Cj:.3f}", f"{c.Cm:.4f}",
         rest[c.rest_at_ends])
        for name, c in found.items()
    ]  # fmt: skip
    return plain_table(
        "Motion laws, lift 1 over angle 1", ("law", "C_v", "C_a", "C_j", "C_m", "zero at both ends"), rows
    )


def spectrum_table(spectra: Mapping[str, Sequence[float]], ratios: Sequence[float]) -> Table:
    """Return a table that compares residual vibrations."""
    rows = [(name, *(f"{value:.6f}" for value in values)) for name, values in spectra.items()]
    return plain_table(
        "Residual vibration over lift, by rise time over period", ("law", *(f"{r:g}" for r in ratios)), rows
    )


_RATIOS = (1.0, 1.5, 2.0, 3.0, 5.0)

Ratios = Annotated[
    list[float] | None,
    Parameter("--residual", negative=(), help="Rise time over the period of an oscillator. May be repeated."),
]


Spectrum = Annotated[
    Path | None,
    Parameter("--spectrum", help="Also draw the residual vibration over the rise time (.svg, .png or .pdf)."),
]


def find_law(name: str, parameters: list[str] | None = None) -> Law:
    """Return a law given by name and parameters, or by a file."""
    if name.endswith(".toml"):
        if parameters:
            raise refuse("--with", ", ".join(parameters), "nothing beside a law file", "the file says all of it")
        return read_law(Path(name)).law
    if not parameters and name not in LAWS and name not in kind_names():
        known = list(dict.fromkeys([*LAWS, *kind_names()]))
        raise refuse("law", repr(name), ", ".join(known) + ", or a law file (.toml)", "", suggest_name(name, known))
    given: dict[str, object] = {"id": name}
    for one in parameters or ():
        key, equals, value = one.partition("=")
        if not equals:
            raise refuse("--with", repr(one), "key=value, such as b=0.25")
        if key.strip() in given:
            raise refuse(
                "--with", repr(one), "every parameter once", f"{key.strip()!r} is given twice", "leave one out"
            )
        try:
            given[key.strip()] = parse_toml(f"value = {value}")["value"]
        except ValueError:
            raise refuse("--with", repr(one), "a number or a list, such as exponents=[3,4,5]") from None
    return parse_law(given).law


@app.command(
    help_prologue="""\
flexcam law 4-5-6-7
flexcam law scca --with b=0.25 --with c=0.5 --with d=0.25 --json
flexcam law best.toml --residual 1.5 --plot best.svg
"""
)
def law(
    name: Annotated[str, Parameter(help="Name of a motion law, or a law file (.toml).")], *,
    parameters: Annotated[list[str] | None, Parameter("--with", negative=(), help="A parameter of the law.")] = None,
    residual: Ratios = None, plot: Picture = None, spectrum: Spectrum = None, overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Say what a motion law does: its criteria, extremes, ends and symmetry, normalized to lift 1 over angle 1."""
    one = find_law(name, parameters)
    found, ratios = criteria(one), tuple(residual or _RATIOS)
    left = residual_spectrum(one, ratios).tolist()
    _draw_laws({name: one}, plot, spectrum, overwrite=overwrite)
    if as_json:
        pairs = [{"ratio": ratio, "amplitude": value} for ratio, value in zip(ratios, left, strict=True)]
        print_json({"status": "ok", "law": name, **law_json(found), "residual": pairs})
        return
    result_console().print(law_facts(name, found))
    result_console().print()
    result_console().print(spectrum_table({name: left}, ratios))


def _draw_laws(found: Mapping[str, Law], plot: Path | None, spectrum: Path | None, *, overwrite: bool) -> None:
    """Draw laws and their residual vibration, if requested."""
    if plot is None and spectrum is None:
        return
    check_distinct_files({"--plot": plot, "--spectrum": spectrum})
    check_figure_path(plot, overwrite)
    check_figure_path(spectrum, overwrite)
    from flexcam.plotting.curves import law_figure, spectrum_figure
    from flexcam.plotting.figures import save_figure

    for path, figure in ((plot, law_figure), (spectrum, spectrum_figure)):
        if path is not None:
            save_figure(figure(found), path, overwrite=overwrite)


def _names_by_law(given: Mapping[str, Law]) -> dict[str, str]:
    """Return the first name of every law, with all its names."""
    rows: dict[str, str] = {}
    for name, one in given.items():
        first = next((other for other in rows if given[other] == one), name)
        rows[first] = f"{rows[first]}, {name}" if first in rows else name
    return rows


@app.command(help_prologue="flexcam laws\nflexcam laws --plot laws.svg\n")
def laws(
    *, residual: Ratios = None, plot: Picture = None, spectrum: Spectrum = None, overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:  # fmt: skip
    """List all motion laws that are complete by their name, with their criteria side by side."""
    found = {name: criteria(one) for name, one in LAWS.items()}
    ratios = tuple(residual or _RATIOS)
    spectra = {name: residual_spectrum(one, ratios).tolist() for name, one in LAWS.items()}
    _draw_laws(LAWS, plot, spectrum, overwrite=overwrite)
    if as_json:
        print_json({
            "status": "ok", "ratios": list(ratios), "kinds": list(kind_names()),
            "laws": {name: {**law_json(one), "residual": spectra[name]} for name, one in found.items()},
        })  # fmt: skip
        return
    rows = _names_by_law(LAWS)
    result_console().print(laws_table({said: found[name] for name, said in rows.items()}))
    result_console().print()
    result_console().print(spectrum_table({said: spectra[name] for name, said in rows.items()}, ratios))
    result_console().print(f"\nKinds with parameters (flexcam law KIND --with key=value): {', '.join(kind_names())}")
