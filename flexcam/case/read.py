"""Read a case file: text, overrides, checked records, one report of all faults."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import ValidationError

from flexcam.case.lines import Path as KeyPath
from flexcam.case.lines import Places, in_order
from flexcam.case.records import CamsRecord, CaseRecord
from flexcam.case.references import References
from flexcam.case.report import faults
from flexcam.case.tables.base import Record
from flexcam.case.tables.run import NewmarkRecord
from flexcam.case.tables.sweep import SweepOnly, SweepRecord
from flexcam.case.toml import toml
from flexcam.checks import Fault, InputError, did_you_mean, refuse, said
from flexcam.fem import Mesh
from flexcam.io import Result, named_file, read_mesh, text_of
from flexcam.units import shaft_speed


@dataclass(frozen=True, eq=False)
class Case:
    """A checked case.

    Parameters
    ----------
    path
        The file it was read from.
    text
        Its text, as it stood there.
    overrides
        The ``key=value`` pairs laid over it.
    record
        The checked values, SI.
    mesh
        The mesh of the file it names; None for a case with its own nodes.
    places
        Where every key was given.

    Examples
    --------
    ``read_case("cases/tayeb/model-3-shm.toml").record.cams["intake"].lift`` is 0.006.
    """

    path: Path
    text: str
    overrides: tuple[str, ...]
    record: CaseRecord
    mesh: Mesh | None
    places: Places

    def __repr__(self) -> str:
        """Return what it is called and where it lies."""
        return f"<Case {self.title!r}, {self.path}>"

    @property
    def name(self) -> str:
        """The file's name without its ending; results are named after it."""
        return self.path.stem

    @property
    def title(self) -> str:
        """What it is called: its title, or the name of its file where it has none."""
        return self.record.title or self.name

    @property
    def speed(self) -> float:
        """Camshaft speed, rad/s."""
        run = self.record.run
        return run.speed if run.speed is not None else 0.5 * (run.crank_speed or 0.0)

    @property
    def turns(self) -> float:
        """Turns of the shaft whose speed the case gives per turn of the camshaft: 2 for the crankshaft."""
        return 2.0 if self.record.run.speed is None else 1.0

    @property
    def told_speed(self) -> str:
        """Its speed in words, with the shaft."""
        return shaft_speed(self.speed, self.turns)

    def at_speed(self, speed: float, revolutions: float | None = None) -> Case:
        """Return the same case at another speed.

        Parameters
        ----------
        speed
            Of the camshaft, rad/s.
        revolutions
            Of the camshaft; those of the case where none are given.

        Returns
        -------
        Case
            Its text and overrides are those it was read from; it counts the same shaft.
        """
        crank = self.turns == 2.0
        changed: dict[str, object] = {
            "speed": None if crank else speed,
            "crank_speed": 2.0 * speed if crank else None,
        }
        if revolutions is not None:
            changed["revolutions"] = revolutions
        return self.with_run(changed)

    def with_average_acceleration(self) -> Case:
        """Return the same case, integrated by Newmark's average acceleration: stable at any step."""
        return self.with_run({"integrator": NewmarkRecord()})

    def with_run(self, changed: Mapping[str, object]) -> Case:
        """Return the same case with other keys of its run.

        Parameters
        ----------
        changed
            Key to checked value.

        Returns
        -------
        Case
            Its text and overrides are those it was read from.
        """
        run = self.record.run.model_copy(update=dict(changed))
        return replace(self, record=self.record.model_copy(update={"run": run}))

    def with_fidelity(self, changed: Mapping[str, object]) -> Case:
        """Return the same case with other keys of its fidelity.

        Parameters
        ----------
        changed
            Key to checked value.

        Returns
        -------
        Case
            Its text and overrides are those it was read from.
        """
        fidelity = self.record.fidelity.model_copy(update=dict(changed))
        return replace(self, record=self.record.model_copy(update={"fidelity": fidelity}))

    def place(self, path: KeyPath) -> str:
        """Return a key path with the line or override it was given by.

        Parameters
        ----------
        path
            Keys and indices from the top of the file.

        Returns
        -------
        str
            Such as ``run.speed (line 62)``.
        """
        return self.places.place(path)


def read_case(path: str | Path, overrides: Sequence[str] = ()) -> Case:
    """Read and check a case file.

    Parameters
    ----------
    path
        The TOML file.
    overrides
        Values laid over the file's, such as ``"run.speed=4000rpm"``.

    Returns
    -------
    Case
        With every default filled in, in SI.

    Raises
    ------
    InputError
        With all faults of the file at once: key path and line, what was given, what is allowed, why, what to do.

    Examples
    --------
    ``read_case("cases/tayeb/model-3-shm.toml", ["run.speed=4000rpm"])`` is the published case at another speed.
    """
    return CaseFile.opened(path).read(overrides)


_KEPT = ("case", "case_file", "overrides")
"""What a result must hold for its case to be made again."""


def recalled_case(result: Result) -> Case:
    """Return the case that a result was computed from, out of the result itself, on the result's mesh.

    Parameters
    ----------
    result
        From `flexcam.read_result`.

    Returns
    -------
    Case
        As it was run. Neither its file nor that of its mesh is read; files of laws and lifts that it names are.

    Raises
    ------
    InputError
        If the result keeps no case, such a file is gone, or the case is none that this version reads.

    Examples
    --------
    ``recalled_case(read_result("results/intake.vtkhdf")).record.title``
    """
    about = result.about
    if missing := [name for name in _KEPT if name not in about]:
        raise refuse("result", f"nothing about {missing[0]!r}", "a result that keeps its case", "flexcam run keeps it")
    source, text = Path(about["case_file"]), about["case"]
    case = CaseFile(source, text, _tables(source, text)).read(json.loads(about["overrides"]), mesh=result.mesh)
    members = {name: one.model_copy(update={"elements": 1}) for name, one in case.record.members.items()}
    return replace(case, record=case.record.model_copy(update={"members": members}), mesh=result.mesh)


@dataclass(frozen=True, eq=False)
class CaseFile:
    """A case file in memory, from which many variants are read: text and meshes are taken from the disk once.

    Parameters
    ----------
    path
        The file.
    text
        Its text.
    raw
        Its tables, not yet checked.
    meshes
        Those read so far, by the name the case gives them.

    Examples
    --------
    ``[file.read([f"run.speed={n}rpm"]) for n in (1000, 2000)]``
    """

    path: Path
    text: str
    raw: Mapping[str, Any]
    meshes: dict[str, Mesh] = field(default_factory=dict[str, Mesh])

    @classmethod
    def opened(cls, path: str | Path) -> CaseFile:
        """Return the file of a path.

        Raises
        ------
        InputError
            If it is no readable TOML document.
        """
        source = Path(path)
        return cls(source, *_parsed(source))

    def read(self, overrides: Sequence[str] = (), *, mesh: Mesh | None = None) -> Case:
        """Return the checked case with values laid over the file's.

        Parameters
        ----------
        overrides
            Values laid over the file's.
        mesh
            Stands for that of the file it names.

        Returns
        -------
        Case
            With every default filled in, in SI.

        Raises
        ------
        InputError
            As `read_case`.
        """
        raw = deepcopy(dict(self.raw))
        places, found = _overridden(raw, self.text, overrides)
        own, mesh_faults = self._mesh(raw, places) if mesh is None or "mesh" not in raw else (mesh, [])
        record, record_faults = _record(CaseRecord, raw, places, self.path)
        found += [*record_faults, *mesh_faults, *References(raw, own, places).faults(), *_either_or(raw, places)]
        if found or record is None:
            raise InputError(in_order(found))
        return Case(self.path, self.text, tuple(overrides), record, own, places)

    @property
    def sweep(self) -> SweepRecord | None:
        """The checked table ``[sweep]``; None where there is none.

        Raises
        ------
        InputError
            With all faults of the table.
        """
        if "sweep" not in self.raw:
            return None
        places = Places.of_text(self.text)
        record, found = _record(SweepOnly, {"sweep": self.raw["sweep"]}, places, self.path)
        if record is None:
            raise InputError(found)
        return record.sweep

    def _mesh(self, raw: Mapping[str, Any], places: Places) -> tuple[Mesh | None, list[Fault]]:
        name = raw.get("mesh")
        if not isinstance(name, str):
            return None, []
        try:
            mesh = self.meshes.get(name) or read_mesh(named_file(self.path, name, "mesh"))
        except InputError as refusal:
            where = places.place(("mesh",))
            return None, [replace(f, where=f"{where}{f.where.removeprefix('mesh')}") for f in refusal.faults]
        return self.meshes.setdefault(name, mesh), []


def _parsed(source: Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a file and its tables."""
    text = _text(source)
    return text, _tables(source, text)


def _tables(source: Path, text: str) -> dict[str, Any]:
    try:
        tables = toml(text)
    except ValueError as fault:
        remedy = "strings need quotes, tables need [brackets]"
        raise refuse(str(source), str(fault), "a TOML document", "", remedy) from None
    return tables


def _overridden(raw: dict[str, Any], text: str, overrides: Sequence[str]) -> tuple[Places, list[Fault]]:
    """Lay overrides over the tables; return where every key was given, and what is wrong with them."""
    places, found = Places.of_text(text), list[Fault]()
    for override in overrides:
        found += _lay_over(raw, override)
        places = places.overridden(_key(override), override)
    return places, found


def _text(path: Path) -> str:
    try:
        return text_of(path)
    except FileNotFoundError:
        near = did_you_mean(path.name, [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else [])
        raise refuse("case file", str(path), "an existing file", "", near) from None
    except (OSError, UnicodeDecodeError) as fault:
        raise refuse("case file", str(path), "a readable UTF-8 text file", said(fault)) from None


def _key(override: str) -> KeyPath:
    return tuple(step.strip() for step in override.partition("=")[0].split("."))


def _lay_over(raw: dict[str, Any], override: str) -> list[Fault]:
    """Put one ``a.b.c=value`` into the tables; return what is wrong with it."""
    path, (_, equals, value) = _key(override), override.partition("=")
    where = f"--set {override}"
    if not equals or not all(path):
        return [Fault(where, repr(override), "key=value, such as run.speed=4000rpm", "", "")]
    table: dict[str, Any] = raw
    for depth, step in enumerate(path[:-1]):
        new = depth == 1 and path[0] != "run" and not did_you_mean(step, table)
        known = list(CaseRecord.model_fields) if depth == 0 else [*table, *_OPTIONAL_TABLES]
        inner = table.setdefault(step, {}) if step in known or new else None
        if not isinstance(inner, dict):
            return [Fault(where, repr(step), f"a table: {', '.join(table)}", "", did_you_mean(step, table))]
        table = cast("dict[str, Any]", inner)
    table[path[-1]] = _toml_value(value.strip())
    return []


_OPTIONAL_TABLES = {"damping", "integrator"}
"""Tables inside tables that a file may leave out."""


def _toml_value(text: str) -> object:
    try:
        return toml(f"value = {text}")["value"]
    except ValueError:
        return text


AnyRecord = TypeVar("AnyRecord", bound=Record)


def _record(
    kind: type[AnyRecord], raw: Mapping[str, Any], places: Places, case: Path
) -> tuple[AnyRecord | None, list[Fault]]:
    """Return the checked record; files beside the case are found from it."""
    try:
        return kind.model_validate(raw, context={"case": case}), []
    except ValidationError as refusal:
        return None, faults(refusal.errors(include_url=False), places, kind)


def holds_mechanism(path: Path) -> bool:
    """Tell whether a file describes a whole mechanism, or cams alone.

    Parameters
    ----------
    path
        The TOML file.

    Returns
    -------
    bool
        Whether it has members, masses or a run.

    Raises
    ------
    InputError
        If it is no readable TOML document.
    """
    return not {"members", "masses", "run"}.isdisjoint(_parsed(path)[1])


def read_cams(path: str | Path, overrides: Sequence[str] = ()) -> CamsRecord:
    """Read and check a file with cams alone.

    Parameters
    ----------
    path
        The TOML file.
    overrides
        Values laid over the file's, such as ``"cams.intake.lift=7 mm"``.

    Returns
    -------
    CamsRecord
        With every default filled in, in SI.

    Raises
    ------
    InputError
        With all faults of the file at once.
    """
    source = Path(path)
    text, raw = _parsed(source)
    places, found = _overridden(raw, text, overrides)
    record, record_faults = _record(CamsRecord, raw, places, source)
    found += [*record_faults, *References(raw, None, places).faults()]
    if found or record is None:
        raise InputError(found)
    return record


def _either_or(raw: Mapping[str, Any], places: Places) -> list[Fault]:
    """Return the faults of keys of which exactly one, or at most one, may stand."""
    found = [*_one_of(raw, ("mesh", "nodes"), 1, "case file", "the geometry comes from one place")]
    if "members" not in raw and "masses" not in raw:
        why = "a mechanism is made of beams, of masses at points, or of both"
        found.append(Fault("case file", "no members and no masses", "[members] or [masses]", why, "add [members]"))
    run = raw.get("run")
    if isinstance(run, Mapping):
        given, where = cast("Mapping[str, Any]", run), places.place(("run",))
        for pair, least in ((("speed", "crank_speed"), 1), (("steps_per_revolution", "step"), 0)):
            found += _one_of(given, pair, least, where, "one follows from the other")
    return found


def _one_of(table: Mapping[str, Any], pair: tuple[str, str], least: int, where: str, why: str) -> list[Fault]:
    given = [key for key in pair if key in table]
    if least <= len(given) <= 1:
        return []
    said = " and ".join(given) or f"neither {pair[0]} nor {pair[1]}"
    return [Fault(where, said, f"either {pair[0]} or {pair[1]}", why, "")]
