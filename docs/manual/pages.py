"""The pages of the verification manual, as texts by the names of their files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from manual.rows import Row
from manual.tables import by_source, escaped, sections


@dataclass(frozen=True)
class Published:
    """A published system: the name of its page and figures, its title, and the sources that its rows name."""

    name: str
    title: str
    sources: tuple[str, ...]


SYSTEMS = (
    Published(
        "tayeb-sliman",
        "The published cam mechanism (Tayeb and Sliman)",
        ("Tayeb and Sliman, Flexibility analysis of a cam mechanism",),
    ),
    Published(
        "li",
        "A valve train of three masses (Li)",
        ("C. Li (2014), eqs. 2-4 and 12-13", "Li, Cam motion simulation and optimization (2014)"),
    ),
    Published(
        "petrescu",
        "Settings of the valve spring (Petrescu and Petrescu)",
        (
            "F. I. T. Petrescu and R. V. V. Petrescu (2013), rows 10-43, figures 2-7",
            "Petrescu and Petrescu, Settings of the valve spring (2013)",
        ),
    ),
    Published(
        "pavlovic-lutovac",
        "A new class of camshaft transfer functions (Pavlović and Lutovac)",
        ("Pavlovic and Lutovac, New class of camshaft transfer functions",),
    ),
    Published(
        "roussev",
        "Quinquinomial power functions (Roussev, Paleva-Kadiyska and Galabov)",
        ("Roussev, Paleva-Kadiyska and Galabov, Quinquinomial power functions",),
    ),
)


def _environment() -> Environment:
    folder = FileSystemLoader(Path(__file__).parent)
    return Environment(loader=folder, undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)  # noqa: S701 - Markdown


class Numbers:
    """What templates ask the rows of a page, so that no number in a text can be out of date."""

    def __init__(self, rows: list[Row]) -> None:
        self._computed = {(row["case"], row["quantity"]): row["computed"] for row in rows}

    def __call__(self, case: str, quantity: str, digits: str = ".3g", factor: float = 1.0) -> str:
        """Return a computed number as text, by its case and quantity."""
        return format(factor * self._computed[case, quantity], digits)


def _sorted_out(rows: list[Row]) -> tuple[dict[str, list[Row]], list[Row]]:
    """Return the rows of each published system, and those of none."""
    its = {one.name: [row for row in rows if row["source"] in one.sources] for one in SYSTEMS}
    taken = {source for one in SYSTEMS for source in one.sources}
    return its, [row for row in rows if row["source"] not in taken]


def pages(rows: list[Row]) -> dict[str, str]:
    """Return the texts of all pages."""
    made, (its, others) = _environment(), _sorted_out(rows)
    found = {
        f"{one.name}.md": made.get_template(f"{one.name}.md.j2").render(
            title=one.title, n=Numbers(its[one.name]), tables=sections(its[one.name])
        )
        for one in SYSTEMS
    }
    found["numbers.md"] = made.get_template("numbers.md.j2").render(tables=sections(others))
    summary = [
        (escaped(source), path, len(group), next((s.name for s in SYSTEMS if source in s.sources), "numbers"))
        for source, path, group in by_source(rows)
    ]
    found["index.md"] = made.get_template("index.md.j2").render(
        systems=[(one.name, one.title, len(its[one.name])) for one in SYSTEMS], summary=summary, total=len(rows)
    )
    return found
