"""A checked case: a value, with what it is asked for and the variants that are made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from flexcam.case.records import CaseRecord
from flexcam.case.schema.base import Record
from flexcam.case.schema.run import NewmarkRecord
from flexcam.case.toml_lines import Path as KeyPath
from flexcam.case.toml_lines import Places
from flexcam.core.units import shaft_speed
from flexcam.fem.mesh import Mesh


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
        return self._with("run", self.record.run, changed)

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
        return self._with("fidelity", self.record.fidelity, changed)

    def _with(self, name: str, table: Record, changed: Mapping[str, object]) -> Case:
        made = table.model_copy(update=dict(changed))
        return replace(self, record=self.record.model_copy(update={name: made}))

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
