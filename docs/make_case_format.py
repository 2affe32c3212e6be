"""Make ``docs/case-format.md`` from the case records: ``python docs/make_case_format.py``."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path

from flexcam.cams import KINDS, LAWS
from flexcam.case.case import CaseRecord
from flexcam.core.units import DIMENSIONS

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/case-format.md"

HEAD = """# The case file

This page lists every key of a case file (TOML) with type, unit, range, default and meaning. `flexcam schema` prints the keys as a JSON
Schema. An editor uses it to complete and check a case whose first line is `#:schema case.schema.json`.

## Values

| value | examples |
|---|---|
| quantity: a string with a unit, or a number in the SI unit that the tables give | `"6 mm"`, `0.006`, `"40 kN/m"` |
| direction: a component with an optional sign, or three numbers in global axes | `"uy"`, `"-rx"`, `[0, 1, 0]` |
| point: a name from the point groups of the mesh or from `[nodes]`, or a point that a rocker defines | `"tip"` |
| file: in the folder of the case, in one of the two folders above it, or in a subfolder of these ([security](security.md)) | `"../meshes/tayeb-1.msh"` |

The units m, g, s, N, Pa, J, W, Hz and rad accept the prefixes G, M, k, d, c, m, u or µ, and n. The units %, t, bar, deg or °, rev, rpm,
min, h, in, thou or mil, ft, oz, lb (mass), lbf (force), psi, ksi, hp and K have no prefix. Units combine with a space or `*`, `/` and
`^`: `"2 kN s/m"`, `"490 mm^2"`.

`--set` on the command line overrides any key. Indices in lists count from 0: `--set run.speed=4000rpm`,
`--set rockers.rocker.arms.1="42 mm"`. An override removes the alternatives of its key: `speed` or `crank_speed`, `step` or
`steps_per_revolution`, and `phase`, `centreline` or `timing`. flexcam accepts an implausible number such as `E = 207` (Pa instead of
GPa) and [warns](long-runs.md#checks-of-a-run).

A node that belongs to no member can translate if it has a mass, can rotate if this mass has `inertia` or an `offset`, and can move in
the directions of its springs. So a train of masses and springs needs no material, section or member (`cases/li`).
`cases/checks/cantilever.toml` is a short complete case; `flexcam new` writes cases with comments.

In the tables below, *type* gives the type or SI unit of a value, its range and its default. A key that is not required may be absent.
*Tables* have names that the user chooses, such as `[materials.steel]`. *By name* means one table with an entry per name, such as
`tip = [0, 0, 0.1]` in `[nodes]`.
"""

EXAMPLES = {kind.example: kind for kind in DIMENSIONS.values()}
"""Quantities by their examples, which identify them in the schema."""


def type_text(schema: dict) -> str:
    """Return a short text with type, unit and range of a key."""
    if "$ref" in schema:
        return link(schema["$ref"])
    if quantity := next((EXAMPLES[e] for e in schema.get("examples", ()) if e in EXAMPLES), None):
        number = next((s for s in schema.get("anyOf", ()) if s.get("type") == "number"), {})
        return (quantity.si or "number") + range_text(number | schema)
    if "anyOf" in schema or "oneOf" in schema:
        parts = [s for s in schema.get("anyOf") or schema["oneOf"] if s.get("type") != "null"]
        words = [link(s["$ref"]) if "$ref" in s else type_text(s) for s in parts]
        if words == ["number", "string"]:
            return "quantity"
        return (", " if len(words) > 2 else " or ").join(dict.fromkeys(words))
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if schema.get("type") == "object" and "properties" in schema:
        return (
            "table of "
            + ", ".join(f"`{k}`" for k in schema["properties"])
            + (" …" if "id" in schema["properties"] else "")
        )
    inner = next(iter(schema.get("patternProperties", {}).values()), schema.get("additionalProperties"))
    if schema.get("type") == "object" and isinstance(inner, dict):
        return f"tables: {type_text(inner)}" if "Record" in str(inner) else f"by name: {type_text(inner)}"
    if schema.get("type") == "array":
        items = schema.get("prefixItems") or [schema.get("items", {})]
        first, *others = dict.fromkeys(map(element_text, items))
        count = f"{len(items)}" if len(items) > 1 else "list of"
        return f"pairs of {first} and {others[0]}" if others else f"{count} {first}"
    names = {"string": "string", "integer": "integer", "number": "number", "boolean": "true or false"}
    return names.get(schema.get("type", ""), "value") + range_text(schema)


def element_text(schema: dict) -> str:
    """Return a short text with the type of the elements of a list."""
    words = type_text(schema)
    if "examples" in schema:
        return words.replace("number", "numbers") if words.startswith("number") else f"values in {words}"
    return {"string": "strings", "number": "numbers"}.get(words, words)


def range_text(schema: dict) -> str:
    """Return the range of a number."""
    minimum, maximum = schema.get("minimum"), schema.get("maximum", schema.get("le"))
    if minimum is not None and minimum == maximum:
        return f" {minimum}"
    if minimum is not None and maximum is not None:
        return f", {minimum} to {maximum:g}"
    if minimum is not None:
        return f" ≥ {minimum}"
    return f" > {schema['exclusiveMinimum']:g}" if "exclusiveMinimum" in schema else ""


def title(reference: str) -> str:
    return reference.rpartition("/")[2].removesuffix("Record")


def link(reference: str) -> str:
    return f"[{title(reference)}](#{title(reference).lower()})"


def description(schema: dict) -> str:
    """Return the description of a key, without that of its quantity, and an example unless it is that of a quantity."""
    text = schema.get("description", "")
    examples = [json.dumps(e) for e in schema.get("examples", []) if e not in EXAMPLES]
    return "; ".join(t for t in ["" if "SI number" in text else text, *(f"such as `{e}`" for e in examples[:1])] if t)


def default_text(name: str, key: dict, required: list[str]) -> str:
    """Return a text that the key is required, or its default."""
    if name in required:
        return ", required"
    value = key.get("default")
    return "" if value in (None, "", [], {}) else f", default `{json.dumps(value)}`"


def rows(schema: dict) -> list[str]:
    """Return a row per key, except for the key that selects the record."""
    lines = list[str]()
    for name, key in schema["properties"].items():
        if "const" in key:
            continue
        cells = [f"`{name}`", type_text(key) + default_text(name, key, schema.get("required", [])), description(key)]
        lines.append(f"| {' | '.join(cells)} |".replace("\n", " "))
    return lines


def table(lines: list[str]) -> list[str]:
    return ["| key | type | meaning |", "|---|---|---|", *lines, ""] if lines else []


SHARED = 3
"""Minimum number of shared keys for a reference to the section of another record."""


def section(name: str, record: dict, earlier: dict[str, list[str]]) -> list[str]:
    """Return the section of a record: selecting key, description, keys, and keys shared with an earlier record."""
    constants = [f'`{key} = "{value["const"]}"`.' for key, value in record["properties"].items() if "const" in value]
    text = " ".join([*constants, record.get("description", "").strip()])
    own = rows(record)
    shared = {title: len(set(own) & set(lines)) for title, lines in earlier.items()}
    other = max(shared, key=shared.__getitem__, default="")
    earlier[name] = own
    if shared.get(other, 0) < SHARED:
        return [f"## {name}", "", text, "", *table(own)]
    *keys, last = (line.split(" | ")[0].removeprefix("| ") for line in own if line in earlier[other])
    lines = [line for line in own if line not in earlier[other]]
    return [
        f"## {name}",
        "",
        f"{text} It also has the keys {', '.join(keys)} and {last} of [{other}](#{other.lower()}).",
        "",
        *table(lines),
    ]


def page() -> str:
    """Return the text of the page."""
    schema = CaseRecord.model_json_schema(by_alias=True)
    parts, earlier = [HEAD, "## Case", "", *table(rows(schema))], dict[str, list[str]]()
    for name, record in schema["$defs"].items():
        parts += section(title(name), record, earlier)
    return "\n".join([*parts, *laws()])


FORMULAS = {
    "polynomial": r"$s = \sum_j a_j z^j$ with given exponents; by default $s(1) = 1$ and as many zero derivatives at 1 as possible",
    "quinquinomial": r"exponents $2,\ 2 + n,\ 2 + 2n,\ 2 + 3n,\ 2 + 4n$ with $n = 3$ times the row",
    "harmonic": r"$s = z - \sum_n c_n \sin(2\pi n z)/(2\pi n)$; pairs `[[n, c_n], ...]`; `[[1, 1]]` gives the cycloidal law",
    "harmonic-acceleration": r"$s'' = \sum_n b_n \sin 2\pi n z$, $n$ from 1",
    "cosine": r"$s = \sum_k d_k \cos k\pi z$, $k$ from 0; $d = (1/2, -1/2)$ is the simple harmonic law",
    "fb2": r"rise of a valve cam without dwell: $s'' = A \sin(\pi z/p)$ up to $z = p$, then $-B \sin(\pi (z - p)/(2 (1 - p)))$",
    "bspline": r"$s = \sum_i c_i B_i(z)$ on clamped knots",
}
"""Formulas of laws; other laws have the first line of their docstring."""


def optional_text(default: object) -> str:
    """Return the default of a law's parameter as in TOML, or a text that the parameter is optional."""
    return f" = `{json.dumps(default)}`" if default else " (optional)"


def laws() -> list[str]:
    """Return the section of the motion laws: names, and kinds with their parameters."""
    lines = [
        "## Motion laws",
        "",
        "These laws need only their name: " + ", ".join(f"`{name}`" for name in LAWS) + ".",
        "",
    ]
    lines += ["With parameters, `law = { id = ..., ... }`:", "", "| id | parameters | law |", "|---|---|---|"]
    for name, make in KINDS.items():
        parameters = [
            f"`{p.name}`" + ("" if p.default is p.empty else optional_text(p.default))
            for p in inspect.signature(make, eval_str=True).parameters.values()
        ]
        first = re.sub("^Return (a|the) law", "Law", (inspect.getdoc(make) or "").splitlines()[0])
        lines.append(f"| `{name}` | {', '.join(parameters)} | {FORMULAS.get(name, first)} |")
    return [
        *lines,
        "",
        'Other packages add laws by entry points of the group `flexcam.laws`. The file of `law = "NAME.toml"` contains a table',
        '`[law]` with the same keys. The file of `lift_table = "NAME.toml"` contains a table `[lift]` with `mean`, `cosine` and',
        "`sine`, the harmonics in m.",
        "",
    ]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
