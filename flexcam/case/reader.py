"""Read a case file: text, overrides, checked records and one report of all faults."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path, PurePath
from typing import Any, cast

import numpy as np

from flexcam.case.builder import build_model
from flexcam.case.case import (
    CamsRecord,
    Case,
    CaseRecord,
    PartialRecord,
    SweepRecord,
    find_unit,
    resolve_record,
    si_unit,
)
from flexcam.case.cross_checks import RawTables
from flexcam.case.fault_report import REPLACED_KEYS, KeyLocations, check_record, parse_toml, sort_faults, value_at
from flexcam.case.fault_report import Path as KeyPath
from flexcam.case.problem_builder import build_equations, check_run, locate_run_faults
from flexcam.case.repetition import Repetition
from flexcam.case.schema.base import records_at
from flexcam.case.schema.cams import LIFT_TABLE_CONFLICTS
from flexcam.case.schema.parts import RepeatRecord
from flexcam.case.valid_parts import TRAIN, ValidParts
from flexcam.core.errors import Fault, InputError, refuse, suggest_name, system_message
from flexcam.dynamics import RunFailedError
from flexcam.fem.mesh import Mesh
from flexcam.io import Result, read_mesh, read_text, resolve_file
from flexcam.valvetrain.springs import count_spring_parts


def read_case(path: str | Path, overrides: Sequence[str] | Mapping[str, object] = ()) -> Case:
    """Read and check a case file.

    Parameters
    ----------
    path
        TOML file.
    overrides
        Overrides, such as ``"run.speed=4000rpm"``, or values by key.

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
    ``read_case("cases/tayeb/model-3-shm.toml", ["run.speed=4000rpm"])`` is the published case at another speed, and so
    is ``read_case("cases/tayeb/model-3-shm.toml", {"run.speed": "4000 rpm"})``.
    """
    if not isinstance(overrides, Mapping):
        return CaseFile.open(path).read(overrides)
    return _read_with_values(CaseFile.open(path), (), overrides)


def _read_with_values(file: CaseFile, overrides: Sequence[str], values: Mapping[str, object]) -> Case:
    """Return a case with values of Python by dotted key; errors name the key, not an option of the command line."""
    texts = [f"{key}={_toml_text(value, key)}" for key, value in values.items()]
    try:
        return file.read([*overrides, *texts])
    except InputError as refusal:
        faults = [replace(fault, where=fault.where.replace("--set ", "")) for fault in refusal.faults]
        raise InputError(faults) from None


def _toml_text(value: object, where: str) -> str:
    """Return a value of a key as TOML on one line; tables and arrays as well."""
    if isinstance(value, np.ndarray | np.generic):
        value = cast("object", value.tolist())
    if isinstance(value, Mapping):
        table = cast("Mapping[str, object]", value)
        return f"{{ {', '.join(f'{json.dumps(key)} = {_toml_text(item, where)}' for key, item in table.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_toml_text(item, where) for item in cast('Sequence[object]', value))}]"
    if isinstance(value, str | PurePath):
        return json.dumps(str(value), ensure_ascii=False)
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise refuse(where, repr(value), "a string, a finite number, true or false, or a list or table of these")
    return json.dumps(value)


def replace_values(case: Case, values: Mapping[str, object]) -> Case:
    """Return a case with other values by table and key; changes of its record by `Case.with_run` remain."""
    file = CaseFile.of(case)
    changes = dict(_changed_values(file.complete(case.overrides)[0], values, ""))
    before, after = (_read_with_values(file, case.overrides, changed) for changed in ({}, changes))
    keys = set(changes)
    keys |= {f"run.{other}" for path in changes for other in REPLACED_KEYS.get(path.removeprefix("run."), ())}

    def edits(name: str) -> dict[str, object]:
        record = getattr(before.record, name)
        items = ((key, value) for key, value in getattr(case.record, name) if f"{name}.{key}" not in keys)
        return {key: value for key, value in items if value != getattr(record, key)}

    return replace(after.with_run(edits("run")).with_fidelity(edits("fidelity")), result_name=case.result_name)


def _changed_values(
    tables: Mapping[str, object], values: Mapping[str, object], path: str
) -> Iterator[tuple[str, object]]:
    """Yield the dotted key and the value of each change; a table that the case has changes key by key."""
    for key, value in values.items():
        table = tables.get(key)
        if isinstance(table, Mapping) and isinstance(value, Mapping):
            inner = cast("Mapping[str, object]", table), cast("Mapping[str, object]", value)
            yield from _changed_values(*inner, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def case_from_result(result: Result) -> Case:
    """Return the case of a result, from the texts stored in it and on its mesh."""
    about = result.about
    source, text = Path(about["case_file"]), about["case"]
    file, overrides = CaseFile(source, text, files=json.loads(about.get("files", "{}"))), json.loads(about["overrides"])
    if name := file.complete(overrides)[0].get("mesh"):
        file.meshes[name] = result.mesh
    case = file.read(overrides)
    pairs = ((case.record.nodes, result.mesh.points), (case.record.members, result.mesh.lines))
    if missing := [name for names, known in pairs for name in names if name not in known]:
        raise refuse("result", f"a mesh without {', '.join(missing)}", "the mesh of its case", "", "compute it again")
    members = {name: member.model_copy(update={"elements": 1}) for name, member in case.record.members.items()}
    return replace(case, record=case.record.model_copy(update={"members": members}), mesh=result.mesh)


def _with_spring_parts(case: Case) -> Case:
    """Return a case with the springs that have mass divided into parts, unless the case gives the number of parts."""
    springs = case.record.springs
    heavy = {name: s for name, s in springs.items() if s.part.mass and "elements" not in s.model_fields_set}
    if not heavy:
        return case
    lifts = [cam.part.event for cam in case.record.cams.values()]
    counts = {name: count_spring_parts(s.part, lifts, case.speed) for name, s in heavy.items()}
    divided = {
        name: s.model_copy(update={"elements": math.ceil(counts[name] / len(s.coils or [0]))})
        for name, s in heavy.items()
    }
    return replace(case, record=case.record.model_copy(update={"springs": springs | divided}))


@dataclass(frozen=True, eq=False)
class CaseFile:
    """Case file in memory, for reading many variants: it and the files in its folder are read from disk once."""

    path: Path  #: path of the file
    text: str  #: text of the file
    meshes: dict[str, Mesh] = field(default_factory=dict[str, Mesh])  #: meshes read so far, by their name in the case
    files: dict[str, str] = field(default_factory=dict[str, str])  #: texts of law and lift files, by name

    @classmethod
    def open(cls, path: str | Path) -> CaseFile:
        """Open a case file."""
        source = Path(path)
        try:
            return cls(source, read_text(source))
        except FileNotFoundError:
            below = next(source.parent.glob(f"*/{source.stem}.toml"), None)
            near = suggest_name(source.name, [file.name for file in source.parent.glob("*.toml")])
            near = near or (f"did you mean {str(below)!r}?" if below else "")
            raise refuse("case file", str(source), "", f"{source} does not exist", near) from None
        except OSError as fault:
            if source.suffix == ".vtkhdf":
                remedy = "give the case file of this result"
                raise refuse("case file", str(source), "a case file (.toml)", "it is a result", remedy) from None
            raise refuse("case file", str(source), "a readable UTF-8 text file", system_message(fault)) from None

    def __post_init__(self) -> None:
        _ = self.raw  # raises an error of its syntax

    @classmethod
    def of(cls, case: Case) -> CaseFile:
        """Return the file of a case as it was read."""
        meshes = {} if case.mesh is None else {str(case.record.mesh): case.mesh}
        return cls(case.path, case.text, meshes, dict(case.files))

    @cached_property
    def raw(self) -> Mapping[str, Any]:
        """Raw tables, not yet checked."""
        try:
            return parse_toml(self.text)
        except ValueError as fault:
            pattern = r"(?:Cannot (?:overwrite|declare)|Duplicate inline table key (\S+)).*line (\d+)"
            if match := re.match(pattern, str(fault)):
                line = self.text.split("\n")[int(match[2]) - 1].strip()
                table, key = line.partition("#")[0].strip(), match[1] or repr(line.partition("=")[0].strip())
                name, given = (table, table) if line.startswith("[") else (key, f"key {key}")
                where, why = f"{self.path}, line {match[2]}", f"{name} is given twice"
                raise refuse(where, given, "every key and table only once", why, "delete one of the two") from None
            if self.path.suffix != ".toml":
                why = f"it is not a TOML document: {fault}"
                raise refuse("case file", str(self.path), "a case file (.toml)", why) from None
            remedy = "strings need quotes, tables need [brackets]"
            raise refuse(str(self.path), "text that is not TOML", "a TOML document", str(fault), remedy) from None

    def read(self, overrides: Sequence[str] = ()) -> Case:
        """Return the checked case with overrides."""
        raw, places, faults = self.complete(overrides)
        if "cams" in raw and raw.keys() <= CamsRecord.model_fields.keys():
            remedy = "give a complete case; flexcam cam reads a file of cams"
            raise refuse("case file", str(self.path), "a complete case", "it has only cams", remedy)
        case, other_faults, *_ = self._check(raw, places, overrides)
        if case is None or faults or other_faults:
            raise self.complete_refusal(InputError(()), overrides)
        return _with_spring_parts(case)

    def complete_refusal(self, refusal: InputError, overrides: Sequence[str] = ()) -> InputError:
        """Return an error with the faults of all other parts added: faulty ones are left out until none is found."""
        raw, places, file_faults = self.complete(overrides)
        _, part_faults, tables, places = self._check(raw, places)
        faults = dict.fromkeys([*refusal.faults, *file_faults, *part_faults])
        valid = ValidParts(deepcopy(tables), self._mesh(tables, places)[0])
        while len(faults) <= _MAX_FAULTS and "repeat" not in raw:
            case, part_faults, *_ = self._check(valid.tables(), KeyLocations({}))
            if case is not None and not part_faults:
                part_faults = _case_faults(case, valid)
                faults |= dict.fromkeys(places.locate(fault) for fault in part_faults if not valid.follows(fault))
            if not valid.leave_out(part_faults):
                break
        return InputError(sort_faults(dict.fromkeys(_name_unknown_part(f, faults, raw, places) for f in faults)))

    def _check(
        self, raw: Mapping[str, Any], places: KeyLocations, overrides: Sequence[str] = ()
    ) -> tuple[Case | None, list[Fault], dict[str, Any], KeyLocations]:
        """Return the case of some tables, their faults, the tables without unknown keys, and the sources of these."""
        record, faults, tables, places = check_record(CaseRecord, raw, places, {"case": self.path, "texts": self.files})
        mesh, mesh_faults = self._mesh(tables, places)
        faults += [*mesh_faults, *RawTables(tables, mesh, places).faults()]
        if record is None:
            return None, faults, tables, places
        case = Case(self.path, self.text, tuple(overrides), record, mesh, places, self.files, replace_values)
        return case, faults, tables, places

    def templates(self, overrides: Sequence[str]) -> tuple[list[str], dict[str, Any], KeyLocations, list[Fault]]:
        """Return the overrides of templates, the tables with them but without copies, the sources and the faults."""
        tables, places = deepcopy(dict(self.raw)), KeyLocations.of_text(self.text)
        first = [entry for entry in overrides if entry.startswith("repeat.") or "{" in entry.partition("=")[0]]
        return first, tables, *_apply_overrides(tables, places, first)

    def complete(self, overrides: Sequence[str]) -> tuple[dict[str, Any], KeyLocations, list[Fault]]:
        """Return the tables with overrides and copies, the sources of all keys and the faults.

        If `repeat` is faulty, it remains in the tables, with one copy of each part for the checks of its values.
        """
        first, tables, places, first_faults = self.templates(overrides)
        repeat = tables.get("repeat", {})
        record, faults, *_ = check_record(PartialRecord, {"repeat": repeat}, places, {})
        marks = [mark.strip("{}") for mark in cast("dict[str, Any]", repeat)] if isinstance(repeat, dict) else []
        repeats = record.repeat if record else dict.fromkeys(marks, RepeatRecord.model_validate({"names": ["1"]}))
        faulty: dict[str, Any] = {} if record else {"repeat": repeat}
        copies = Repetition.of(tables, repeats)
        places = replace(places, templates=copies.templates, raw=copies.tables)
        later = [entry for entry in overrides if entry not in first and not faulty]
        places, later_faults = _apply_overrides(copies.tables, places, later)
        return copies.tables | faulty, places, [*first_faults, *faults, *copies.faults(places), *later_faults]

    @property
    def sweep(self) -> SweepRecord | None:
        """Checked table ``[sweep]``; None if there is none."""
        if "sweep" not in self.raw:
            return None
        places = KeyLocations.of_text(self.text)
        record, faults, *_ = check_record(PartialRecord, {"sweep": self.raw["sweep"]}, places, {})
        if record is None or faults:
            raise InputError(faults)
        return record.sweep

    def _mesh(self, raw: Mapping[str, Any], places: KeyLocations) -> tuple[Mesh | None, list[Fault]]:
        name = raw.get("mesh")
        if not isinstance(name, str):
            return None, []
        try:
            mesh = self.meshes.get(name) or read_mesh(resolve_file(self.path, name, "mesh"))
        except InputError as refusal:
            where, faults = places.place(("mesh",)), refusal.faults
            return None, [replace(f, where=f"{where} {f.where.removeprefix('mesh').strip()}".rstrip()) for f in faults]
        return self.meshes.setdefault(name, mesh), []


_MAX_FAULTS, _MAX_NODES = 100, 20_000  # other faults, and nodes of the mesh, up to which the model is checked as well


def _name_unknown_part(fault: Fault, faults: Iterable[Fault], raw: Mapping[str, Any], places: KeyLocations) -> Fault:
    """Return a fault of a part that only overrides name in place of that of a key missing in it."""
    part = tuple(fault.where.partition(" (")[0].split(".")[:2])
    new = fault.given == "nothing" and places.notes.get(part, "").startswith("created by")
    if not new or records_at(part, CaseRecord) != records_at(part[:1], CaseRecord):  # an optional table is no part
        return fault
    allowed = ", ".join(name for name in raw[part[0]] if name != part[1])
    name = ".".join(part)
    missing = [f.where.partition(" (")[0] for f in faults if f.given == "nothing"]
    missing = [key for key in dict.fromkeys(missing) if key.startswith(f"{name}.")]
    remedy = f"to create it, set at least {', '.join(missing)} as well"
    return Fault(places.place(part), repr(part[1]), allowed, f"the case has no {name}", remedy)


# tables whose values decide whether a rigid train can move
_RIGID = ("cams", "contacts", "rockers", "springs", "loads")


def _case_faults(case: Case, valid: ValidParts) -> Sequence[Fault]:
    """Return the faults of the parts on their mesh, else of their equations, else of their run."""
    kind = case.record.fidelity.model
    try:
        case = _with_spring_parts(case)
        model = build_model(case)
        if len(model.mesh.nodes) > _MAX_NODES:
            return ()
        possible = valid.connected and (kind != "rigid" or valid.keeps(_RIGID))
        equations = build_equations(case, model, kind if possible else "beams")
        check_run(case, *equations, method=valid.keeps((*TRAIN, "materials", "sections")))
    except InputError as refusal:
        return locate_run_faults(case, refusal).faults
    except RunFailedError:
        return ()  # no equilibrium exists
    return ()


def case_tables(case: Case) -> dict[str, Any]:
    """Return the tables of a case as written, with its overrides."""
    return CaseFile.of(case).complete(case.overrides)[0]


def template_tables(case: Case) -> dict[str, Any]:
    """Return the table ``[repeat]`` of a case and the parts with marks in their names, with the overrides of both."""
    tables = CaseFile.of(case).templates(case.overrides)[1]
    marked = {
        kind: {name: part for name, part in cast("dict[str, Any]", table).items() if "{" in name}
        for kind, table in tables.items()
        if isinstance(table, dict)
    }
    return marked | {"repeat": tables.get("repeat", {})}


def complete_case_tables(case: Case) -> dict[str, Any]:
    """Return the tables of a case as written, with its overrides and all defaults, which have SI units."""
    defaults = resolve_record(case.record)
    for cam in defaults["cams"].values():
        for key in LIFT_TABLE_CONFLICTS if "lift_table" in cam else ():
            cam.pop(key, None)
    if case.record.fidelity.model != "chain":
        defaults["fidelity"].pop("masses")  # of a chain only
    return _add_defaults(case_tables(case), defaults, (), case.record)


def _add_defaults(
    tables: Mapping[str, Any], defaults: Mapping[str, Any], path: tuple[str, ...], record: CaseRecord
) -> dict[str, Any]:
    result = dict(tables)
    for key, value in defaults.items():
        current: object = result.get(key, {})
        inner = (*path, key)
        if isinstance(value, dict) and isinstance(current, dict) and not (key == "law" and current):
            table = _add_defaults(cast("dict[str, Any]", current), cast("dict[str, Any]", value), inner, record)
            result |= {key: table} if table else {}
        elif key not in result:
            unit = si_unit(inner) and find_unit(record, inner)
            result[key] = _with_unit(cast("object", value), unit)
    return {key: result[key] for key in dict.fromkeys([*defaults, *tables]) if key in result}


def _with_unit(value: object, unit: str | None) -> object:
    if isinstance(value, list):
        return [_with_unit(item, unit) for item in cast("list[object]", value)]
    return f"{value!r} {unit}" if isinstance(value, float) and unit else value


def has_mechanism(path: Path) -> bool:
    """Return whether a file describes a mechanism or only cams."""
    return not {"members", "masses", "superelements", "run"}.isdisjoint(CaseFile.open(path).raw)


def read_cams(path: str | Path, overrides: Sequence[str] = ()) -> CamsRecord:
    """Read and check a file that contains only cams."""
    file = CaseFile.open(path)
    raw, places, faults = file.complete(overrides)
    record, record_faults, tables, places = check_record(CamsRecord, raw, places, {"case": file.path})
    faults += [*record_faults, *RawTables(tables, None, places).reference_faults()]
    if faults or record is None:
        raise InputError(faults)
    return record


_OPTIONAL_TABLES = {"adaptive", "damping", "fluctuation", "free_running", "integrator"}  # optional nested tables


def _apply_overrides(
    raw: dict[str, Any], places: KeyLocations, overrides: Sequence[str]
) -> tuple[KeyLocations, list[Fault]]:
    """Apply overrides ``a.b.c=value`` to raw tables; return the sources of all keys and the faults."""
    keys = [tuple(step.strip() for step in override.partition("=")[0].split(".")) for override in overrides]
    notes, faults = dict[KeyPath, str](), list[Fault | None]()
    for key, override in zip(keys, overrides, strict=True):
        new = len(key) > 2 and value_at(raw, key[:2]) is None
        faults.append(_apply_override(raw, key, override))
        if new and faults[-1] is None:
            notes[key[:2]] = f"created by --set {override}"
        elif new and isinstance(table := value_at(raw, key[:1]), dict):
            cast("dict[str, object]", table).pop([*key][1], None)  # otherwise its missing keys would be faults, too
    for *parents, key in (key for key, fault in zip(keys, faults, strict=True) if fault is None):
        table = value_at(raw, parents) if parents[:1] in (["run"], ["cams"]) else None
        for other in REPLACED_KEYS.get(key, ()):
            if isinstance(table, dict) and (*parents, other) not in keys:  # overrides that exclude each other remain
                cast("dict[str, object]", table).pop(other, None)
    notes |= {key: f"--set {override}" for key, override in zip(keys, overrides, strict=True)}
    return replace(places, notes={**places.notes, **notes}), [fault for fault in faults if fault is not None]


def _apply_override(raw: dict[str, Any], path: KeyPath, override: str) -> Fault | None:
    """Set a value in raw tables; return the fault if the path leads nowhere."""
    where, (_, equals, text) = f"--set {override}", override.partition("=")
    if not equals or not all(path):
        return Fault(where, repr(override), "key=value, such as run.speed=4000rpm", "", "")
    target: Any = raw
    for depth, step in enumerate(path):
        names, key = list[str](), cast("Any", step)
        if isinstance(target, list):
            count = len(cast("list[Any]", target))
            if not step.isdecimal() or int(step) >= count:
                return Fault(where, repr(step), f"a position in the list, 0 to {count - 1}", "", "")
            key = int(step)
        else:
            names = list(cast("dict[str, Any]", target))
        if depth == len(path) - 1:
            target[key] = _toml_value(text.strip())
            return None
        if isinstance(target, dict):
            known = list(CaseRecord.model_fields) if depth == 0 else [*names, *_OPTIONAL_TABLES]
            new = depth == 1 and path[0] != "run" and not suggest_name(step, names)
            if step not in names and not (step in known or new):
                tables = [name for name in names if isinstance(cast("Any", target)[name], dict | list)]
                allowed, why = "a table that the case has", f"{'.'.join(path[:depth])} contains no table"
                if tables:
                    allowed += f": {', '.join('.'.join((*path[:depth], name)) for name in tables)}"
                    why = ""
                return Fault(where, ".".join(path[: depth + 1]), allowed, why, suggest_name(step, known))
            cast("dict[str, Any]", target).setdefault(step, {})
        target = cast("Any", target)[key]
        if not isinstance(target, dict | list):
            prefix = ".".join(path[: depth + 1])
            given, allowed = f"key {path[depth + 1]!r}", f"no key inside {step!r}"
            return Fault(where, given, allowed, "it holds one value, no table", f"write --set {prefix}=...")
    return None


def _toml_value(text: str) -> object:
    with suppress(ValueError):
        tables = parse_toml(f"value = {text}")
        if len(tables) == 1:  # text with further lines is invalid
            return tables["value"]
    return text
