"""Read a case file: text, overrides, checked records and one report of all faults."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import ValidationError

from flexcam.case.builder import with_spring_parts
from flexcam.case.case import Case
from flexcam.case.fault_report import convert_errors
from flexcam.case.geometry_checks import coincident_node_faults
from flexcam.case.overrides import apply_overrides, parse_tables, read_tables
from flexcam.case.records import CamsRecord, CaseRecord, SweepFileRecord, SweepRecord
from flexcam.case.references import References
from flexcam.case.schema.base import Record
from flexcam.case.toml_lines import KeyLocations, sort_faults
from flexcam.core.errors import Fault, InputError, refuse
from flexcam.fem.mesh import Mesh
from flexcam.io import Result, read_mesh, resolve_file


def read_case(path: str | Path, overrides: Sequence[str] = ()) -> Case:
    """Read and check a case file.

    Parameters
    ----------
    path
        TOML file.
    overrides
        Overrides, such as ``"run.speed=4000rpm"``.

    Returns
    -------
    Case
        Checked case with all defaults, in SI.

    Raises
    ------
    InputError
        If the file is invalid; the error lists all faults: key path and line, value, allowed values, reason, remedy.

    Examples
    --------
    ``read_case("cases/tayeb/model-3-shm.toml", ["run.speed=4000rpm"])`` is the published case at another speed.
    """
    return CaseFile.open(path).read(overrides)


_REQUIRED_TEXTS = ("case", "case_file", "overrides")
"""Texts of a result that are required to restore its case."""


def case_from_result(result: Result) -> Case:
    """Return the case of a result, from the texts stored in it and on its mesh."""
    about = result.about
    if missing := [name for name in _REQUIRED_TEXTS if name not in about]:
        raise refuse("result", f"nothing about {missing[0]!r}", "a result that keeps its case", "flexcam run keeps it")
    source, text = Path(about["case_file"]), about["case"]
    case = CaseFile(source, text, parse_tables(source, text)).read(json.loads(about["overrides"]), mesh=result.mesh)
    members = {name: one.model_copy(update={"elements": 1}) for name, one in case.record.members.items()}
    return replace(case, record=case.record.model_copy(update={"members": members}), mesh=result.mesh)


@dataclass(frozen=True, eq=False)
class CaseFile:
    """Case file in memory, for reading many variants: text and meshes are read from disk once.

    Parameters
    ----------
    path
        Path of the file.
    text
        Text of the file.
    raw
        Raw tables, not yet checked.
    meshes
        Meshes read so far, by their name in the case.
    """

    path: Path
    text: str
    raw: Mapping[str, Any]
    meshes: dict[str, Mesh] = field(default_factory=dict[str, Mesh])

    @classmethod
    def open(cls, path: str | Path) -> CaseFile:
        """Open a case file."""
        source = Path(path)
        return cls(source, *read_tables(source))

    def read(self, overrides: Sequence[str] = (), *, mesh: Mesh | None = None) -> Case:
        """Return the checked case with overrides."""
        raw = deepcopy(dict(self.raw))
        places, found = apply_overrides(raw, self.text, overrides)
        own, mesh_faults = self._mesh(raw, places) if mesh is None or "mesh" not in raw else (mesh, [])
        record, record_faults = _record(CaseRecord, raw, places, self.path)
        found += [
            *record_faults,
            *mesh_faults,
            *References(raw, own, places).faults(),
            *_exclusive_key_faults(raw, places),
        ]
        found += coincident_node_faults(raw if record is None else {**raw, "nodes": record.nodes}, places)
        if found or record is None:
            raise InputError(sort_faults(found))
        return with_spring_parts(Case(self.path, self.text, tuple(overrides), record, own, places))

    @property
    def sweep(self) -> SweepRecord | None:
        """Checked table ``[sweep]``; None if there is none."""
        if "sweep" not in self.raw:
            return None
        places = KeyLocations.of_text(self.text)
        record, found = _record(SweepFileRecord, {"sweep": self.raw["sweep"]}, places, self.path)
        if record is None:
            raise InputError(found)
        return record.sweep

    def _mesh(self, raw: Mapping[str, Any], places: KeyLocations) -> tuple[Mesh | None, list[Fault]]:
        name = raw.get("mesh")
        if not isinstance(name, str):
            return None, []
        try:
            mesh = self.meshes.get(name) or read_mesh(resolve_file(self.path, name, "mesh"))
        except InputError as refusal:
            where = places.place(("mesh",))
            return None, [replace(f, where=f"{where}{f.where.removeprefix('mesh')}") for f in refusal.faults]
        return self.meshes.setdefault(name, mesh), []


AnyRecord = TypeVar("AnyRecord", bound=Record)


def _record(
    kind: type[AnyRecord], raw: Mapping[str, Any], places: KeyLocations, case: Path
) -> tuple[AnyRecord | None, list[Fault]]:
    """Return the checked record; relative file names refer to the folder of the case."""
    try:
        return kind.model_validate(raw, context={"case": case}), []
    except ValidationError as refusal:
        return None, convert_errors(refusal.errors(include_url=False), places, kind)


def has_mechanism(path: Path) -> bool:
    """Return whether a file describes a mechanism or only cams."""
    return not {"members", "masses", "run"}.isdisjoint(read_tables(path)[1])


def read_cams(path: str | Path, overrides: Sequence[str] = ()) -> CamsRecord:
    """Read and check a file that contains only cams."""
    source = Path(path)
    text, raw = read_tables(source)
    places, found = apply_overrides(raw, text, overrides)
    record, record_faults = _record(CamsRecord, raw, places, source)
    found += [*record_faults, *References(raw, None, places).faults()]
    if found or record is None:
        raise InputError(found)
    return record


def _exclusive_key_faults(raw: Mapping[str, Any], places: KeyLocations) -> list[Fault]:
    """Return the faults of mutually exclusive keys."""
    found = [*_exclusive_keys(raw, ("mesh", "nodes"), 1, "case file", "the geometry comes from one place")]
    if "members" not in raw and "masses" not in raw:
        why = "a mechanism is made of beams, of masses at points, or of both"
        found.append(Fault("case file", "no members and no masses", "[members] or [masses]", why, "add [members]"))
    run = raw.get("run")
    if isinstance(run, Mapping):
        given, where = cast("Mapping[str, Any]", run), places.place(("run",))
        for pair, least in ((("speed", "crank_speed"), 1), (("steps_per_revolution", "step"), 0)):
            found += _exclusive_keys(given, pair, least, where, "one follows from the other")
    return found


def _exclusive_keys(table: Mapping[str, Any], pair: tuple[str, str], least: int, where: str, why: str) -> list[Fault]:
    given = [key for key in pair if key in table]
    if least <= len(given) <= 1:
        return []
    said = " and ".join(given) or f"neither {pair[0]} nor {pair[1]}"
    return [Fault(where, said, f"either {pair[0]} or {pair[1]}", why, "")]
