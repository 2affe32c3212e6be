"""Checked case and its variants."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from flexcam.case.fault_report import KeyLocations
from flexcam.case.fault_report import Path as KeyPath
from flexcam.case.records import CaseRecord
from flexcam.case.schema.run import NewmarkRecord
from flexcam.core.html import html_table
from flexcam.core.units import shaft_speed
from flexcam.fem.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Case:
    """Checked case.

    Parameters
    ----------
    path
        File of the case.
    text
        Text of the file.
    overrides
        Overrides of the case, as ``key=value``.
    record
        Checked values in SI units.
    mesh
        Mesh of the mesh file; None for a case with its own nodes.
    places
        Source of every key: line or override.
    files
        Texts of the law and lift files, by name in the case.
    reread
        Function that reads a case again with other values by table and key.
    result_name
        Name of its results; that of its file by default.

    Examples
    --------
    ``read_case("cases/tayeb/model-3-shm.toml").record.cams["intake"].lift`` is 0.006.
    """

    path: Path
    text: str
    overrides: tuple[str, ...]
    record: CaseRecord
    mesh: Mesh | None
    places: KeyLocations
    files: Mapping[str, str]
    reread: Callable[[Case, Mapping[str, object]], Case]
    result_name: str = ""

    def __repr__(self) -> str:
        return f"<Case {self.title!r}, {self.path}>"

    def _repr_html_(self) -> str:
        parts = ("members", "masses", "springs", "rockers", "cams", "contacts", "loads")
        rows = {"file": str(self.path), "speed": self.speed_text, "overrides": ", ".join(self.overrides)}
        return html_table(self.title, rows | {name: ", ".join(getattr(self.record, name)) for name in parts})

    @property
    def name(self) -> str:
        """Name of results: that of the file without suffix by default."""
        return self.result_name or self.path.stem

    @property
    def title(self) -> str:
        """Title of the case, or the name of its file."""
        return self.record.title or self.name

    @property
    def speed(self) -> float:
        """Camshaft speed, rad/s."""
        run = self.record.run
        return run.speed if run.speed is not None else 0.5 * (run.crank_speed or 0.0)

    @property
    def turns(self) -> float:
        """Revolutions of the shaft whose speed the case gives, per camshaft revolution: 2 for the crankshaft."""
        return 2.0 if self.record.run.speed is None else 1.0

    @property
    def speed_text(self) -> str:
        """Speed with unit and shaft, for messages."""
        return shaft_speed(self.speed, self.turns)

    def at_speed(self, speed: float, revolutions: float | None = None) -> Case:
        """Return the same case at another speed.

        Parameters
        ----------
        speed
            Camshaft speed, rad/s.
        revolutions
            Camshaft revolutions; those of the case by default.

        Returns
        -------
        Case
            Case with unchanged text and overrides; its speed refers to the same shaft.
        """
        changed: dict[str, object] = {"speed": speed, "crank_speed": None}
        if self.turns == 2.0:
            changed = {"speed": None, "crank_speed": 2.0 * speed}
        if revolutions is not None:
            changed["revolutions"] = revolutions
        return self.with_run(changed)

    def replace(self, values: Mapping[str, object]) -> Case:
        """Return the same case with other values, as `read_case` from its file with these overrides.

        Parameters
        ----------
        values
            Values by dotted key or by table and key: texts with unit, or numbers in SI. A table changes only the keys
            that it has; a new name adds a part.

        Returns
        -------
        Case
            Checked case; its overrides have the changes. Changes by `at_speed` remain.

        Raises
        ------
        InputError
            If a value or the case is invalid.

        Examples
        --------
        ``case.replace({"springs.valve.stiffness": "60 kN/m"})``, or ``case.replace({"springs": {"valve": {"stiffness":
        6e4}}})``
        """
        return self.reread(self, values)

    def with_stable_method(self) -> Case:
        """Return the same case if its method is stable at any time step, otherwise with the average acceleration."""
        given = self.record.run.integrator
        limited = given is not None and given.part.stability_limit() < math.inf
        return self.with_newmark() if limited else self

    def with_newmark(self) -> Case:
        """Return the same case with Newmark's method, whose steps are those of derivatives along a run."""
        return self.with_run({"integrator": NewmarkRecord()})

    def with_run(self, changed: Mapping[str, object]) -> Case:
        """Return the same case with changed keys of ``[run]``.

        Parameters
        ----------
        changed
            Checked values by key.

        Returns
        -------
        Case
            Case with unchanged text and overrides.
        """
        return self._with({"run": self.record.run.model_copy(update=dict(changed))})

    def with_fidelity(self, changed: Mapping[str, object]) -> Case:
        """Return the same case with changed keys of ``[fidelity]``.

        Parameters
        ----------
        changed
            Checked values by key.

        Returns
        -------
        Case
            Case with unchanged text and overrides.
        """
        return self._with({"fidelity": self.record.fidelity.model_copy(update=dict(changed))})

    def _with(self, tables: Mapping[str, object]) -> Case:
        return replace(self, record=self.record.model_copy(update=tables))

    def place(self, path: KeyPath) -> str:
        """Return a key path with its line or override.

        Parameters
        ----------
        path
            Keys and indices from the root of the file.

        Returns
        -------
        str
            Such as ``run.speed (line 62)``.
        """
        return self.places.place(path)
