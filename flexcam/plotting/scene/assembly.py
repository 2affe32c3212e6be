"""Assembly of the solid parts of a mechanism, and its default instant at full lift."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexcam.case.case import Case
from flexcam.core import FloatArray
from flexcam.dynamics import Response
from flexcam.fem.frames import ROTATIONS
from flexcam.plotting.scene import followers, springs, supports
from flexcam.plotting.scene.instant import SceneState
from flexcam.plotting.scene.layout import CamPlacement, Layout, build_layout
from flexcam.plotting.scene.levers import lever_solids
from flexcam.plotting.scene.lobes import lobe_solid
from flexcam.plotting.scene.motion import centre_line, sweep_outline
from flexcam.plotting.scene.sizes import model_size
from flexcam.plotting.scene.solids import Solid, ball, cylinder, loft, perpendicular_axes, section_outlines
from flexcam.plotting.scene.trains import shafts
from flexcam.plotting.scene.valves import valve_solids
from flexcam.valvetrain import Structure


def full_lift(case: Case, response: Response, angle: FloatArray) -> int:
    """Return the index of the instant at which the valve is farthest from its installed position."""
    at = np.minimum(np.searchsorted(response.angle, angle - 1e-9), len(response.angle) - 1)
    points = {rocker.to for rocker in case.record.rockers.values()}
    names = [name for name, _ in response.outline.probes]
    for chosen in ([name for name in names if name in points], [name for name in names if "." not in name]):
        paths = [np.abs(path[at]) for name in chosen for path in _probe_displacements(response, name)]
        farthest = max(paths, key=lambda path: float(np.ptp(path)), default=np.zeros(1))
        if np.ptp(farthest) > 0.0:
            return int(np.argmax(farthest))
    return len(angle) - 1


def _probe_displacements(response: Response, probe: str) -> list[FloatArray]:
    """Return the translational displacements of a probe, shape (m,) each."""
    history = response[probe]
    if history.displacement.ndim == 1:
        return [history.displacement]
    return [
        path for name, path in zip(history.components, history.displacement.T, strict=True) if name not in ROTATIONS
    ]


_STEEL = 7800.0
"""Density of the sphere drawn for a mass at a node, kg/m^3; its size is limited to a tenth of the model's size."""


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Drawable model.

    Parameters
    ----------
    structure
        Structure of the model.
    layout
        Positions and sizes of parts outside of the mesh.
    """

    structure: Structure
    layout: Layout

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about sizes that the case does not give."""
        return self.layout.notes

    @property
    def upwards(self) -> FloatArray:
        """Unit vector that points up in figures, shape (3,): along the lift, toward increasing coordinates."""
        lift = self.layout.cams[0].lift if self.layout.cams else np.array([0.0, 1.0, 0.0])
        return lift * (np.sign(lift[np.argmax(np.abs(lift))]) or 1.0)

    @property
    def axis(self) -> FloatArray:
        """Unit vector of the camshaft, or one perpendicular to `upwards` without a camshaft, shape (3,)."""
        return self.layout.cams[0].frame.axis if self.layout.cams else perpendicular_axes(self.upwards)[1]

    def solids(self, instant: SceneState) -> list[Solid]:
        """Return all parts at an instant."""
        layout = self.layout
        return [
            *self._members(instant),
            *(lobe_solid(one.frame, instant.angle, instant.nodal[one.node]) for one in layout.cams),
            *(part for one in layout.cams for part in followers.follower(one, instant)),
            *(
                part
                for name, one in layout.levers.items()
                for part in lever_solids(one, self._path(name, instant), layout.thick)
            ),
            *(
                part
                for one in layout.valves
                for part in valve_solids(one, instant.at(one.point, one.away), layout.head)
            ),
            *(part for one in layout.springs for part in springs.spring_solids(one, instant)),
            *(axle for one in layout.cams for axle in self._axle(one, instant)),
            *supports.support_solids(self.structure.model, layout, instant),
            *self._balls(instant),
        ]

    def _members(self, instant: SceneState) -> Iterator[Solid]:
        model, first = self.structure.model, 0
        turning = shafts(model)
        for name, elements in model.mesh.element_ranges().items():
            line = centre_line(self.structure.beams, elements, model.mesh.nodes, instant.nodal)
            rings = [sweep_outline(outline, line) for outline in section_outlines(model.members[name].section)]
            count = len(model.mesh.lines[name])
            values = None
            if instant.values is not None:
                values = np.interp(line.part, np.arange(count), instant.values[first : first + count])
            yield _section_solid("shaft" if name in turning else "member", rings, values)
            first += count

    def _path(self, name: str, instant: SceneState) -> float:
        return instant.along(self.structure.path(self.structure.model.rockers[name]))

    def _axle(self, place: CamPlacement, instant: SceneState) -> list[Solid]:
        """Return the stub shaft through a cam without a member."""
        if self.structure.model.mesh.on_members()[place.node]:
            return []
        frame = place.frame
        middle = frame.centre + instant.nodal[place.node, :3]
        reach, radius = 1.1 * frame.width * frame.axis, 0.4 * frame.follower.base_radius
        return [cylinder("shaft", middle - reach, middle + reach, radius)]

    def _balls(self, instant: SceneState) -> Iterator[Solid]:
        """Yield the masses at nodes without other parts."""
        model = self.structure.model
        shown = {one.point for one in self.layout.valves} | {one.contact.follower for one in self.layout.cams}
        for part in model.masses.values():
            if part.at in shown or part.at not in model.mesh.points:
                continue
            node = model.mesh.node(part.at)
            if not model.mesh.on_members()[node]:
                radius = (0.75 * part.body.mass / (np.pi * _STEEL)) ** (1.0 / 3.0)
                largest = 0.1 * model_size(model)
                yield ball("mass", model.mesh.nodes[node] + instant.nodal[node, :3], min(float(radius), largest))


def _section_solid(kind: str, rings: list[FloatArray], values: FloatArray | None) -> Solid:
    """Return the solid of a swept section; a hole is connected in the reverse direction."""
    if len(rings) == 1:
        return loft(kind, rings[0], values=values)
    there_and_back = np.concatenate([rings[0], rings[1][::-1]])
    return loft(
        kind, there_and_back, cyclic=True, values=None if values is None else np.concatenate([values, values[::-1]])
    )


def build_mechanism(structure: Structure) -> Mechanism:
    """Create the drawable model of a structure."""
    return Mechanism(structure, build_layout(structure))
