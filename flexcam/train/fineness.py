"""Whether steps and elements resolve the motion of a run: looked at while it goes on, from what it saves.

The frequency that counts is that of the accelerations: ``w^2 = sum(m a^2)/sum(m v^2)`` over the saved instants, with
the mass of every unknown. It lies above that of the motion itself where modes are excited, far above after impacts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.fem.recovery import section_forces
from flexcam.linalg import FloatArray, IntArray
from flexcam.response import Block, Outline, Stats, Status
from flexcam.system import System
from flexcam.train.loads import element_loads
from flexcam.train.structure import Structure

_BENDS = 0.01
"""Part of the strain energy in bending, of all members, from which a member counts as one that bends."""

_LOOKS = 8
"""Blocks of which each is looked at for bending; later on one of so many, which is enough to tell."""

_WAVE = 2.0 * math.pi


@dataclass(frozen=True)
class Fineness:
    """How finely a run is divided.

    Parameters
    ----------
    frequency
        Of the accelerations, Hz; zero where nothing moves.
    steps
        In a period of it; infinite where nothing moves.
    elements
        Member that bends, to elements per wave of bending at that frequency.
    impacts
        Contact to steps of the impact in which its largest force came; contacts that stay closed or open have none.
    """

    frequency: float
    steps: float
    elements: dict[str, float]
    impacts: dict[str, int]


class FinenessSink:
    """Sink that follows how finely a run is divided.

    Parameters
    ----------
    structure
        The structure.
    system
        The system that is run.
    outline
        Names of what will come.
    step
        s.
    """

    def __init__(self, structure: Structure, system: System, outline: Outline, step: float) -> None:
        self._structure, self._step = structure, step
        self._mass = system.mass.diagonal()
        self._spread = element_loads(structure)
        self._squares, self._blocks = np.zeros(2), 0
        self._bent = np.zeros(len(structure.beams))
        names = [name for name, _ in outline.channels]
        contacts = [i for i, name in enumerate(names) if name.startswith("contacts.") and name.endswith(".force")]
        self._names = [names[i].split(".")[1] for i in contacts]
        self._touches = _Touches(np.array(contacts, dtype=np.intp))

    def write(self, block: Block) -> None:
        """Take a block."""
        self._touches.follow(block.channels)
        if not len(block.field_time):
            return
        fields = block.fields
        if fields.velocity.shape[1] == len(self._mass):
            self._squares += [((one**2) @ self._mass).sum() for one in (fields.acceleration, fields.velocity)]
        if self._blocks < _LOOKS or self._blocks % _LOOKS == 0:
            self._bend(block)
        self._blocks += 1

    def close(self, status: Status, stats: Stats) -> None:
        """Do nothing: the figures are asked for with `found`."""

    def _bend(self, block: Block) -> None:
        """Follow the strain energy in bending, of the last field of a block; what damping bears stores none."""
        beams, nodal = self._structure.beams, self._structure.dofs.nodal
        moved, pushed = (nodal(one[-1:]) for one in (block.fields.displacement, block.fields.acceleration))
        moments = section_forces(beams, moved, acceleration=pushed, spread=self._spread)[0, :, :, 4:]
        rigidity = np.stack([beams.EIy, beams.EIz], axis=1)
        mean = (moments**2).sum(axis=1) + moments[:, 0] * moments[:, 1]  # of a moment that changes linearly
        self._bent = np.maximum(self._bent, beams.length / 6.0 * (mean / rigidity).sum(axis=1))

    def found(self) -> Fineness:
        """Return how finely the run was divided."""
        pushed, moving = self._squares
        omega = math.sqrt(pushed / moving) if moving > 0.0 else 0.0
        steps = _WAVE / (omega * self._step) if omega > 0.0 else math.inf
        return Fineness(omega / _WAVE, steps, self._waves(omega), self._touches.named(self._names))

    def _waves(self, omega: float) -> dict[str, float]:
        """Return elements per wave of every member that bends."""
        beams = self._structure.beams
        if not omega or not self._bent.any():
            return {}
        rigidity = np.minimum(beams.EIy, beams.EIz)
        lengths = _WAVE * (rigidity / (beams.rho_A * omega**2)) ** 0.25 / beams.length
        ranges = self._structure.model.mesh.element_ranges()
        energies = {name: float(self._bent[part].sum()) for name, part in ranges.items()}
        whole = sum(energies.values())
        return {name: float(lengths[part].min()) for name, part in ranges.items() if energies[name] > _BENDS * whole}


class _Touches:
    """Steps of the impact in which each of some contacts had its largest force."""

    def __init__(self, columns: IntArray) -> None:
        self._columns = columns
        self._largest = np.zeros(len(columns))
        self._steps = np.zeros(len(columns), dtype=np.intp)

    def follow(self, channels: FloatArray) -> None:
        """Take the next steps."""
        if not len(self._columns) or not len(channels):
            return
        forces = channels[:, self._columns]
        peaks = forces.max(axis=0)
        for i in np.flatnonzero(peaks > self._largest).tolist():
            self._largest[i] = peaks[i]
            self._steps[i] = _around(forces[:, i] > 0.0, int(np.argmax(forces[:, i])))

    def named(self, names: list[str]) -> dict[str, int]:
        """Return the steps of those that came as an impact."""
        return {name: int(steps) for name, steps in zip(names, self._steps, strict=True) if steps}


def _around(closed: NDArray[np.bool_], at: int) -> int:
    """Return for how many steps a contact is closed around one; zero where its begin or end is not in the block."""
    open_ = np.flatnonzero(~closed)
    before, after = open_[open_ < at], open_[open_ > at]
    return int(after[0] - before[-1] - 1) if len(before) and len(after) else 0
