"""Make ``docs/case-format.md`` from the case records: ``python docs/make_case_format.py``."""

from __future__ import annotations

import inspect
import json
from pathlib import Path

from flexcam.cams import KINDS, LAWS
from flexcam.case.records import CaseRecord

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/case-format.md"

HEAD = """# The case file

The case file is TOML. `make docs-pages` generates this page from the records that check a case; `flexcam schema` prints them as
JSON Schema for editors (for example `#:schema case.schema.json` on the first line).

Numbers are SI, or texts with a unit: `"6 mm"`, `"40 kN/m"`, `"3000 rpm"`, `"180 deg"`. A number without a unit is SI: an angle in
rad, a speed in rad/s. The command line can override every key: `--set run.speed=4000rpm`; the index of a number in a list counts
from 0: `--set rockers.rocker.arms.1="42 mm"`. An override also replaces a key that excludes it: `crank_speed` and `speed`, `step` and
`steps_per_revolution`.

A direction is a component with an optional sign (`"uy"`, `"-rx"`) or three numbers in global axes. Points are named nodes: the
mesh's point groups, or `[nodes]`; a rocker defines one more. A node without member moves if a mass at it has inertia, and along springs
at it; a train of masses and springs needs no material, section or member (`cases/li`). The published cases are in `cases/tayeb`.

Files that a case names must be in its folder, up to two folders above it, or below these; [security.md](security.md) gives the
reasons and the way to allow others. flexcam accepts an implausible number such as `E = 207` (207 Pa instead of 207 GPa) and
[warns of it](long-runs.md#checks-of-a-run). A complete case without a mesh file:

```toml
"""


def kind(schema: dict, definitions: dict) -> str:
    """Return the type of a key in a few words."""
    if "$ref" in schema:
        return f"table [{title(schema['$ref'])}]"
    if "anyOf" in schema or "oneOf" in schema:
        parts = [kind(s, definitions) for s in schema.get("anyOf") or schema["oneOf"] if s.get("type") != "null"]
        return "quantity" if parts == ["number", "text"] else " or ".join(dict.fromkeys(parts))
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if schema.get("type") == "object" and "properties" in schema:
        return (
            "table of "
            + ", ".join(f"`{key}`" for key in schema["properties"])
            + (" …" if "id" in schema["properties"] else "")
        )
    inner = next(iter(schema.get("patternProperties", {}).values()), schema.get("additionalProperties"))
    if schema.get("type") == "object" and isinstance(inner, dict):
        return f"by name: {kind(inner, definitions)}"
    if schema.get("type") == "array":
        inside = schema.get("prefixItems") or [schema.get("items", {})]
        return (
            f"{len(inside)} x {kind(inside[0], definitions)}"
            if len(inside) > 1
            else f"list of {kind(inside[0], definitions)}"
        )
    names = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false"}
    return names.get(schema.get("type", ""), "value")


def title(reference: str) -> str:
    return reference.rpartition("/")[2].removesuffix("Record")


def about(schema: dict) -> str:
    texts = [schema.get("description", "")]
    examples = schema.get("examples") or [e for s in schema.get("anyOf", []) for e in s.get("examples", [])]
    return "; ".join(t for t in [*texts, f"such as `{json.dumps(examples[0])}`" if examples else ""] if t)


def rows(schema: dict, definitions: dict) -> list[str]:
    required = schema.get("required", [])
    lines = ["| key | type | default | |", "|---|---|---|---|"]
    for name, key in schema["properties"].items():
        default = (
            "required"
            if name in required
            else f"`{json.dumps(key['default'])}`"
            if key.get("default") is not None
            else ""
        )
        lines.append(f"| `{name}` | {kind(key, definitions)} | {default} | {about(key)} |".replace("\n", " "))
    return lines


def page() -> str:
    schema = CaseRecord.model_json_schema(by_alias=True)
    definitions = schema["$defs"]
    example = (ROOT / "cases/checks/cantilever.toml").read_text(encoding="utf-8")
    parts = [HEAD + example + "```\n", "## Case", "", *rows(schema, definitions), ""]
    for name, record in definitions.items():
        parts += [f"## {title(name)}", "", record.get("description", "").strip(), "", *rows(record, definitions), ""]
    return "\n".join([*parts, *laws()])


def laws() -> list[str]:
    """Return the laws by name and the kinds with their parameters."""
    lines = ["## Motion laws", "", "By name alone: " + ", ".join(f"`{name}`" for name in LAWS) + ".", ""]
    lines += ["With parameters, `law = { id = ..., ... }`:", "", "| id | parameters | |", "|---|---|---|"]
    for name, make in KINDS.items():
        parameters = [
            f"`{p.name}`" + ("" if p.default is p.empty else f" = {p.default}")
            for p in inspect.signature(make, eval_str=True).parameters.values()
        ]
        first = (inspect.getdoc(make) or "").splitlines()[0]
        lines.append(f"| `{name}` | {', '.join(parameters)} | {first} |")
    return [
        *lines,
        "",
        "Other packages add kinds by entry points of the group `flexcam.laws`. A law in a separate file,",
        '`law = "NAME.toml"`, is a table `[law]` with the same keys; a lift in a file, `lift_table = "NAME.toml"`, is a',
        "table `[lift]` with `mean`, `cosine` and `sine`, the harmonics in m.",
        "",
    ]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
