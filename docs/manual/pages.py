"""The pages of the verification manual, as texts by the names of their files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from manual.rows import Row
from manual.tables import by_source, largest_error, sections


@dataclass(frozen=True)
class Published:
    """A published system or benchmark: name of its page, title, sources of its rows, its cases or references."""

    name: str
    title: str
    sources: tuple[str, ...]
    notes: str


SYSTEMS = (
    Published(
        "tayeb-sliman",
        "The published cam mechanism (Tayeb and Sliman)",
        ("Tayeb and Sliman, Flexibility analysis of a cam mechanism",),
        "`cases/tayeb`",
    ),
    Published(
        "li",
        "A valve train of three masses (Li)",
        ("C. Li (2014), eqs. 2-4 and 12-13", "Li, Cam motion simulation and optimization (2014)"),
        "`cases/li`, `cases/cams/li-*.toml`",
    ),
    Published(
        "petrescu",
        "Settings of the valve spring (Petrescu and Petrescu)",
        (
            "F. I. T. Petrescu and R. V. V. Petrescu (2013), rows 10-43, figures 2-7",
            "Petrescu and Petrescu, Settings of the valve spring (2013)",
        ),
        "`cases/petrescu`, `cases/cams/petrescu-cos.toml`",
    ),
    Published(
        "pavlovic-lutovac",
        "A new class of camshaft transfer functions (Pavlović and Lutovac)",
        ("Pavlovic and Lutovac, New class of camshaft transfer functions",),
        "laws `pavlovic-*`, `gutman-1-3`",
    ),
    Published(
        "roussev",
        "Quinquinomial power functions (Roussev, Paleva-Kadiyska and Galabov)",
        ("Roussev, Paleva-Kadiyska and Galabov, Quinquinomial power functions",),
        "`cases/cams/roussev-single-dwell.toml`",
    ),
)

BENCHMARKS = (
    Published(
        "corner-impact",
        "A cam follower at a corner of its cam's curvature (Alzate, di Bernardo et al.)",
        ("Alzate, di Bernardo et al., corner impact of a cam follower",),
        "closed-form solution",
    ),
    Published(
        "code-aster",
        "Beams and a mass on stops (code_aster)",
        (
            "SDNL32 of code_aster, hinged beam on an elastic stop",
            "Hinged beam on a stop, natural modes in closed form and DOP853",
            "SDNL301 of code_aster, tube in loose supports",
            "Tube in loose supports, DOP853 on 25 modes",
            "SDND101 of code_aster, closed form",
        ),
        "computed by others and by another method; closed-form solution",
    ),
    Published(
        "impacts",
        "Impacts and sustained contact in closed form",
        (
            "Orbits of the impact oscillator",
            "Ball on a floor",
            "One-dimensional wave theory",
            "Sustained unilateral contact, closed form",
        ),
        "closed-form solution",
    ),
    Published(
        "spin-test",
        "Spin tests of valve masses (partial validation)",
        ("Spin tests of valve masses, small-block V8 (measured)",),
        "measured",
    ),
)


def _environment() -> Environment:
    folder = FileSystemLoader(Path(__file__).parent)
    return Environment(loader=folder, undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)  # noqa: S701 - Markdown


class Numbers:
    """Computed numbers of a page, for its template: no number in a text can be out of date."""

    def __init__(self, rows: list[Row]) -> None:
        self._computed = {(row["case"], row["quantity"]): row["computed"] for row in rows}

    def __call__(self, case: str, quantity: str, digits: str = ".3g", factor: float = 1.0) -> str:
        """Return a computed number as text, by its case and quantity."""
        return format(factor * self._computed[case, quantity], digits)


def _group_rows(rows: list[Row]) -> tuple[dict[str, list[Row]], list[Row]]:
    """Return the rows of each published system and benchmark, and the other rows."""
    its = {one.name: [row for row in rows if row["source"] in one.sources] for one in (*SYSTEMS, *BENCHMARKS)}
    taken = {source for one in (*SYSTEMS, *BENCHMARKS) for source in one.sources}
    return its, [row for row in rows if row["source"] not in taken]


def _summary(one: Published, rows: list[Row]) -> tuple[str, str, str, int, str]:
    return one.name, one.title, one.notes, len(rows), largest_error(rows)


def pages(rows: list[Row]) -> dict[str, str]:
    """Return the texts of all pages."""
    made, (its, others) = _environment(), _group_rows(rows)
    found = {
        f"{one.name}.md": made.get_template(f"{one.name}.md.j2").render(
            title=one.title, n=Numbers(its[one.name]), tables=sections(its[one.name])
        )
        for one in (*SYSTEMS, *BENCHMARKS)
    }
    found["numbers.md"] = made.get_template("numbers.md.j2").render(tables=sections(others))
    found["index.md"] = made.get_template("index.md.j2").render(
        systems=[_summary(one, its[one.name]) for one in SYSTEMS],
        benchmarks=[_summary(one, its[one.name]) for one in BENCHMARKS],
        others={"sources": len(by_source(others)), "rows": len(others), "error": largest_error(others)},
        total=len(rows),
    )
    return found
