"""Resolution of a run: time steps and elements compared with accelerations, bending waves and impacts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexcam.dynamics import Block, Outline, Stats, Status, System
from flexcam.fem.recovery import section_forces
from flexcam.valvetrain.structure import Structure, element_loads

_BENDS = 0.01  # fraction of strain energy in bending above which a member counts as bending
_BLOCK_INTERVAL = 8  # number of initial blocks evaluated for bending; later, one of as many blocks is evaluated
_FIELD_INTERVAL = 32  # one of as many fields of such a block is evaluated

_WAVE = 2.0 * math.pi


@dataclass(frozen=True)
class Resolution:
    """Temporal and spatial resolution of a run."""

    #: mean frequency of the accelerations, from their rms over that of the velocities, Hz; zero without motion
    frequency: float
    steps: float  #: steps per period; infinite without motion
    elements: dict[str, float]  #: elements per bending wavelength at that frequency, by member
    #: steps during the impact of maximum force, by contact; none for contacts that stay closed or open
    impacts: dict[str, int]


class ResolutionSink:
    """Sink that evaluates the resolution of a run."""

    def __init__(self, structure: Structure, system: System, outline: Outline, step: float) -> None:
        self._structure, self._step = structure, step
        self._mass = system.mass.diagonal()
        self._spread = element_loads(structure)
        self._squares, self._blocks = np.zeros(2), 0
        self._energy = np.zeros(len(structure.beams))
        names = [name for name, _ in outline.channels]
        contacts = [i for i, name in enumerate(names) if name.startswith("contacts.") and name.endswith(".force")]
        self._contacts = {names[i].split(".")[1]: i for i in contacts}
        # largest force and steps of its impact
        self._impacts: dict[str, tuple[float, int]] = dict.fromkeys(self._contacts, (0.0, 0))

    def write(self, block: Block) -> None:
        """Update with a block."""
        for name, column in self._contacts.items() if len(block.channels) else ():
            force = block.channels[:, column]
            peak = int(np.argmax(force))
            if force[peak] > self._impacts[name][0]:
                self._impacts[name] = float(force[peak]), contact_duration(force > 0.0, peak)
        if not len(block.field_time):
            return
        fields = block.fields
        if fields.velocity.shape[1] == len(self._mass):
            self._squares += [((field**2) @ self._mass).sum() for field in (fields.acceleration, fields.velocity)]
        if self._blocks < _BLOCK_INTERVAL or self._blocks % _BLOCK_INTERVAL == 0:
            self._update_energy(block)
        self._blocks += 1

    def close(self, status: Status, stats: Stats) -> None:
        """Do nothing."""

    def _update_energy(self, block: Block) -> None:
        """Update the strain energy in bending with the last field of a block and some before it."""
        beams, nodal, some = self._structure.beams, self._structure.dofs.nodal, slice(None, None, -_FIELD_INTERVAL)
        u, a = (nodal(field[some]) for field in (block.fields.displacement, block.fields.acceleration))
        moments = section_forces(beams, u, acceleration=a, spread=self._spread)[:, :, :, 4:]
        rigidity = np.stack([beams.EIy, beams.EIz], axis=1)
        mean = (moments**2).sum(axis=2) + moments[:, :, 0] * moments[:, :, 1]  # of a moment that changes linearly
        energies = beams.length / 6.0 * (mean / rigidity).sum(axis=2)
        self._energy = np.maximum(self._energy, energies.max(axis=0))

    def evaluate(self) -> Resolution:
        """Return the resolution of the run."""
        acceleration, velocity = self._squares
        omega = math.sqrt(acceleration / velocity) if velocity > 0.0 else 0.0
        steps = _WAVE / (omega * self._step) if omega > 0.0 else math.inf
        impacts = {name: count for name, (_, count) in self._impacts.items() if count}
        return Resolution(omega / _WAVE, steps, self._waves(omega), impacts)

    def _waves(self, omega: float) -> dict[str, float]:
        beams = self._structure.beams
        if not omega or not self._energy.any():
            return {}
        rigidity = np.minimum(beams.EIy, beams.EIz)
        with np.errstate(divide="ignore"):  # a member without mass has no waves
            lengths = _WAVE * (rigidity / (beams.rho_A * omega**2)) ** 0.25 / beams.length
        ranges = self._structure.model.mesh.element_ranges()
        energies = {name: float(self._energy[part].sum()) for name, part in ranges.items()}
        total = sum(energies.values())
        return {name: float(lengths[part].min()) for name, part in ranges.items() if energies[name] > _BENDS * total}


def contact_duration(closed: NDArray[np.bool_], at: int) -> int:
    """Return the number of steps of an impact around a step; zero if it does not begin within the block.

    A contact that remains closed after an impact has twice the steps from its first touch to the maximum.
    """
    open_ = np.flatnonzero(~closed)
    before, after = open_[open_ < at], open_[open_ > at]
    if not len(before):
        return 0
    rise = 2 * int(at - before[-1]) - 1
    return min(rise, int(after[0] - before[-1] - 1)) if len(after) else rise
