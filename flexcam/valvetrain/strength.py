"""Stresses over a run, member by member, and the margin against fatigue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexcam.core import FloatArray
from flexcam.dynamics import Block, Stats, Status
from flexcam.fem.recovery import fibres, section_forces
from flexcam.valvetrain.loads import element_loads
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.structure import Structure


@dataclass(frozen=True)
class MemberStrength:
    """Maximum stress and fatigue safety of a member over a run.

    Parameters
    ----------
    von_mises
        Largest equivalent stress, Pa.
    mean, alternating
        Mean and amplitude at the point of minimum safety, Pa, including torsion as in the equivalent stress.
    safety
        Goodman's factor, ``1/(alternating/endurance + mean/ultimate)``; None without material strengths, and without
        tensile or alternating stress.
    place
        Name of the node.
    rated
        Whether the material has strength values.
    """

    von_mises: float
    mean: float
    alternating: float
    safety: float | None
    place: str
    rated: bool


class StrengthSink:
    """Sink that tracks the stresses of every member at the saved instants.

    It stores minimum and maximum normal stress per outline point and torsional stress per section. Mean and amplitude
    are combined as ``sqrt(sigma^2 + 3 tau^2)``, and safety is Goodman's line, with no credit for compressive means
    (torsion has no sign): J. E. Shigley, Mechanical Engineering Design, 9th ed., eqs. 6-46, 6-55 and 6-56.

    Parameters
    ----------
    structure
        The structure.
    """

    def __init__(self, structure: Structure) -> None:
        self._structure = structure
        mesh, members = structure.model.mesh, structure.model.members
        self._fibres = fibres([members[name].section for name, line in mesh.lines.items() for _ in line[1:]])
        self._spread = element_loads(structure)
        self._normal: tuple[FloatArray, FloatArray] | None = None
        self._shear: tuple[FloatArray, FloatArray] | None = None
        self._von_mises = np.zeros((len(structure.beams), 2))

    def write(self, block: Block) -> None:
        """Update with a block."""
        if not len(block.field_time):
            return
        nodal, fields = self._structure.dofs.nodal, block.fields
        forces = section_forces(
            self._structure.beams,
            nodal(fields.displacement),
            velocity=nodal(fields.velocity),
            acceleration=nodal(fields.acceleration),
            damping=self._structure.model.damping,
            spread=self._spread,
        )
        self._normal = _extend_range(self._normal, self._fibres.normal(forces))
        self._shear = _extend_range(self._shear, self._fibres.shear(forces))
        self._von_mises = np.maximum(self._von_mises, self._fibres.von_mises(forces).max(axis=0))

    def close(self, status: Status, stats: Stats) -> None:
        """Do nothing."""

    def members(self) -> dict[str, MemberStrength]:
        """Return the strength results of every member; empty without saved fields."""
        if self._normal is None or self._shear is None:
            return {}
        (normal, swing), (shear, twist) = _halves(*self._normal), _halves(*self._shear)
        mean, alternating = _equivalent(normal, shear), _equivalent(swing, twist)
        pulled = _equivalent(np.maximum(normal, 0.0), shear)
        return {name: self._member(name, part, mean, alternating, pulled) for name, part in self._ranges().items()}

    def _ranges(self) -> Mapping[str, slice]:
        return self._structure.model.mesh.element_ranges()

    def _member(
        self, name: str, part: slice, mean: FloatArray, alternating: FloatArray, pulled: FloatArray
    ) -> MemberStrength:
        model: Model = self._structure.model
        material = model.members[name].material
        m, a = mean[part], alternating[part]
        rated = bool(material.ultimate_strength and material.endurance_limit)
        use = np.zeros_like(m)
        if material.ultimate_strength and material.endurance_limit:
            use = a / material.endurance_limit + pulled[part] / material.ultimate_strength
        worst = float(use.max())
        ranked = use if worst > 0.0 else a + np.abs(m)
        element, end, fibre = np.unravel_index(int(np.argmax(ranked)), ranked.shape)
        return MemberStrength(
            von_mises=float(self._von_mises[part].max()),
            mean=float(m[element, end, fibre]),
            alternating=float(a[element, end, fibre]),
            safety=1.0 / worst if worst > 0.0 else None,
            place=model.mesh.node_name(int(model.mesh.lines[name][element + end])),
            rated=rated,
        )


def _extend_range(bounds: tuple[FloatArray, FloatArray] | None, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    least, largest = values.min(axis=0), values.max(axis=0)
    return (least, largest) if bounds is None else (np.minimum(bounds[0], least), np.maximum(bounds[1], largest))


def _halves(least: FloatArray, largest: FloatArray) -> tuple[FloatArray, FloatArray]:
    return 0.5 * (largest + least), 0.5 * (largest - least)


def _equivalent(normal: FloatArray, shear: FloatArray) -> FloatArray:
    """Return the equivalent stress with the sign of the normal one, shape (e, 2, f)."""
    size = np.sqrt(normal**2 + 3.0 * shear[..., None] ** 2)
    return np.where(normal < 0.0, -size, size)
