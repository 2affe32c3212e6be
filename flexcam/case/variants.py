"""Variants of a case: other numbers by key, other steps and elements, and the text of a changed case."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping, MutableMapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from flexcam.case.builder import build_model
from flexcam.case.case import Case, find_unit
from flexcam.case.fault_report import SYNONYMS, iterate_values, value_at
from flexcam.case.reader import REPLACED_KEYS, CaseFile, case_tables
from flexcam.case.repetition import map_texts, name_pattern
from flexcam.case.schema.run import GivenStartRecord
from flexcam.core import FloatArray
from flexcam.core.errors import InputError, refuse, suggest_name
from flexcam.core.units import PLAIN_NUMBER
from flexcam.fem.recovery import deflection
from flexcam.io import find_referenced_file, format_toml
from flexcam.valvetrain import Structure, build_structure
from flexcam.valvetrain.structure import spring_parts


@dataclass(frozen=True)
class Number:
    """Number of a case."""

    key: str  #: key, such as ``springs.valve.stiffness``; an element of a list has its index: ``rockers.rocker.arms.1``
    value: float  #: value, SI
    unit: str  #: SI unit; empty for a dimensionless number, ``SI`` if it cannot be determined


def get_number(case: Case, key: str, where: str) -> Number:
    """Return a number of a case by key."""
    record = case.record.model_dump(mode="json", by_alias=True)
    known = {".".join(path): value for path, value in iterate_values(record)}
    numbers = [name for name, value in known.items() if isinstance(value, float)]
    copies = [key] if key in known else [name for name in known if name_pattern(key).fullmatch(name)]
    if not copies:
        last, names = key.rpartition(".")[2], [name.rpartition(".")[2] for name in numbers]
        meant = key.removesuffix(last) + SYNONYMS.get(last, last)
        near = suggest_name(meant, numbers) or suggest_name(last, names)
        allowed = f"a numeric key of the case, such as {', '.join(numbers[:6])}"
        raise refuse(where, repr(key), allowed, "there is no such key", near or "flexcam check --echo prints all keys")
    value = known[copies[0]]
    if different := [name for name in copies if known[name] != value]:
        given = f"{known[different[0]]!r} for {different[0]} and {value!r} for {copies[0]}"
        raise refuse(where, given, "a number that all copies share", "one value replaces all", "name one of the copies")
    if not isinstance(value, float):
        if value is None:
            table, _, last = key.rpartition(".")
            others = [f"{table}.{other}" for other in REPLACED_KEYS.get(last, ())]
            given = next((f"use {other}, which the case gives" for other in others if known.get(other) is not None), "")
            raise refuse(where, key, "a number that the case gives", "", given or "give it a value in the case")
        why, remedy = "whole numbers and texts cannot be varied here", "compare its values with flexcam sweep"
        remedy = "" if isinstance(value, str) else remedy
        raise refuse(where, f"{key} = {value!r}", "the key of a number with a continuous value", why, remedy)
    unit = find_unit(case.record, copies[0].split("."))
    return Number(key, value, "SI" if unit is None else unit)


def make_overrides(case: Case, values: Mapping[str, str]) -> tuple[str, ...]:
    """Return the overrides that set values of a case; a list is written in full with its other elements."""
    record = case.record.model_dump(mode="json", by_alias=True)
    lists: dict[str, list[Any]] = {}
    overrides: dict[str, str] = {}
    for key, text in values.items():
        parent, _, last = key.rpartition(".")
        if not (last.isdigit() and isinstance(items := value_at(record, parent.split(".")), list)):
            overrides[key] = text
            continue
        changed = lists.setdefault(parent, [*cast("list[Any]", items)])
        changed[int(last)] = text
        with suppress(ValueError):
            changed[int(last)] = float(text)
        overrides[parent] = json.dumps(changed, ensure_ascii=False)
    return tuple(f"{key}={text}" for key, text in overrides.items())


def number_after_override(case: Case, key: str, text: str, where: str) -> float:
    """Return the number of a case after replacing it by a text."""
    try:
        variant = CaseFile.of(case).read((*case.overrides, *make_overrides(case, {key: text})))
    except InputError as refusal:
        plain = f"{PLAIN_NUMBER}[^,]+"  # which the options refuse
        faults = [replace(fault, where=where, allowed=re.sub(plain, "", fault.allowed)) for fault in refusal.faults]
        raise InputError(faults) from None
    return get_number(variant, key, where).value


def case_text(case: Case, target: Path, comments: Sequence[str] = ()) -> str:
    """Return a case with its overrides as TOML for another folder, with the comments of the case file."""

    def relocate(text: str) -> str:
        """Return a text, adapted to the other folder if it is a relative file name."""
        named = Path(text).suffix and not os.path.isabs(text)
        source = find_referenced_file(case.path, text) if named else None
        return text if source is None else Path(os.path.relpath(source, target.parent)).as_posix()

    import tomlkit

    tables = cast("dict[str, Any]", map_texts(case_tables(case), relocate))
    document = tomlkit.parse(case.text)
    _assign(document, tables)
    text = document.as_string()
    if tomllib.loads(text) != tables:
        text = format_toml(tables)
    return "".join(f"# {line}\n" for line in comments) + text


def _assign(table: MutableMapping[str, Any], values: Mapping[str, Any]) -> None:
    """Give a table the values of another one; entries that are equal keep their text."""
    for key in [key for key in table if key not in values]:
        del table[key]
    for key, value in values.items():
        if isinstance(value, dict) and isinstance(table.get(key), dict):
            _assign(table[key], cast("dict[str, Any]", value))
        elif key not in table or table[key] != value:
            table[key] = value


def map_initial_state(case: Case, other: Case) -> Case:
    """Return a case with the initial state of another one, where that is given at nodes.

    Points between two nodes of a member follow the shape functions of its elements: otherwise a finer mesh would have
    points at rest between moving ones, and start with an impact that the given mesh does not have. Between the ends of
    a spring part the motion is linear.
    """
    start = case.record.run.start
    if not isinstance(start, GivenStartRecord):
        return other
    structure, new = (build_structure(build_model(variant)) for variant in (case, other))
    parts = {name: (m.elements, other.record.members[name].elements) for name, m in case.record.members.items()}
    states = [_map_nodal_values(structure, new, parts, values) for values in (start.displacement, start.velocity)]
    return other.with_run({"start": GivenStartRecord(displacement=states[0], velocity=states[1])})


def _map_nodal_values(
    structure: Structure, new: Structure, parts: Mapping[str, tuple[int, int]], values: Mapping[str, float]
) -> dict[str, float]:
    """Map named values from one mesh to another; values that do not belong to nodes are unchanged."""
    names, mesh = structure.dofs.names, structure.model.mesh
    on_nodes = names[: int((structure.dofs.numbers >= 0).sum())]
    row = np.array([values.get(name, 0.0) if name in on_nodes else 0.0 for name in names])
    nodal = structure.dofs.nodal(row)
    rows, count = np.zeros((len(new.model.mesh.nodes), 6)), len(mesh.nodes)
    for name, elements in mesh.element_ranges().items():
        rows[new.model.mesh.lines[name]] = _interpolate_member(structure, nodal, elements, *parts[name])
        count -= (elements.stop - elements.start) // parts[name][0] * (parts[name][0] - 1)
    rows[:count] = nodal[:count]  # the nodes of the case come first in all its meshes
    free = new.dofs.numbers >= 0
    pairs: list[tuple[int, float]] = list(zip(new.dofs.numbers[free].tolist(), rows[free].tolist(), strict=True))
    mapped = {new.dofs.names[i]: x for i, x in pairs if x}
    off_nodes = {name: value for name, value in values.items() if name not in on_nodes}
    return mapped | _map_spring_values(structure, new, values, off_nodes)


def _map_spring_values(
    structure: Structure, new: Structure, values: Mapping[str, float], off_nodes: Mapping[str, float]
) -> dict[str, float]:
    """Map values of internal spring nodes to springs with another number of parts."""
    result, row = dict(off_nodes), np.array([values.get(name, 0.0) for name in structure.dofs.names])
    for name, spring in structure.model.springs.items():
        old, parts = spring.elements, new.model.springs[name].elements
        if old == parts:
            continue
        ends = spring_parts(structure, name, spring)
        line = [float(ends[0][0] @ row), *(float(high @ row) for _, high in ends)]
        for inner in structure.model.inner_unknowns[f"springs.{name}"]:
            result.pop(inner, None)
        motion = np.interp(np.arange(1, parts) / parts, np.arange(old + 1) / old, line).tolist()
        pairs = zip(new.model.inner_unknowns[f"springs.{name}"], motion, strict=True)
        result |= {inner: value for inner, value in pairs if value}
    return result


def _interpolate_member(structure: Structure, nodal: FloatArray, elements: slice, parts: int, other: int) -> FloatArray:
    """Return the motion at the nodes of a member that has `other` elements per segment instead of `parts`."""
    local = deflection(structure.beams, nodal, other, elements)
    triads = structure.beams.triads[elements]
    vectors = [np.einsum("eji,epj->epi", triads, local[..., kind]) for kind in (slice(0, 3), slice(3, 6))]
    motion = np.concatenate(vectors, axis=-1)
    line = np.concatenate([motion[:, :-1].reshape(-1, 6), motion[-1:, -1]])
    return line[::parts]


def with_steps(case: Case, per_revolution: int) -> Case:
    """Return a case with another number of steps per revolution."""
    return case.with_run({"steps_per_revolution": per_revolution, "step": None})


def with_elements(case: Case, factor: int | None = None, each: int | None = None) -> Case:
    """Return a case with a multiple of the elements of members and springs per segment, or with `each` per member."""
    members, springs = dict(case.record.members), dict(case.record.springs)
    for name, member in members.items():
        members[name] = member.model_copy(update={"elements": each or member.elements * (factor or 1)})
    for name, spring in springs.items():
        if spring.part.mass or spring.elements > 1:
            springs[name] = spring.model_copy(update={"elements": spring.elements * (factor or 1)})
    variant = replace(case, record=case.record.model_copy(update={"members": members, "springs": springs}))
    return map_initial_state(case, variant)


def with_beam_model(case: Case) -> Case:
    """Return a case with all degrees of freedom of its beams, regardless of its fidelity."""
    beams = {"model": "beams", "tolerance": None, "estimate": False, "modes": None, "reduction": "modes"}
    return case.with_fidelity(beams)
