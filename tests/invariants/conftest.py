"""A frame in space for all invariants: two members at an angle, with different bending planes."""

from __future__ import annotations

import numpy as np
import pytest

from flexcam.fem.assembly import Member, build_beams
from flexcam.fem.dofs import DofMap, dof_map
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import Mesh, refine
from flexcam.fem.sections import Section

NODES = np.array([[0.0, 0.0, 0.0], [0.5, 0.1, -0.2], [0.7, 0.6, 0.1]])
ORIENTATION = np.array([0.2, 0.3, 1.0])


class Frame:
    """Frame that may be rotated by `rotation`, scaled, and have its members reversed."""

    def __init__(self, material, rotation, *, size=1.0, backwards=False, parts=3, held=True, **member):
        order = (lambda line: line[::-1]) if backwards else (lambda line: line)
        points = {"foot": [0], "knee": [1], "tip": [2]}
        mesh = Mesh(size * NODES @ rotation.T, {"a": order([0, 1]), "b": order([1, 2])}, points)
        self.mesh: Mesh = refine(mesh, {"a": parts, "b": parts})
        section = Section(
            A=4e-4 * size**2, Iy=2e-8 * size**4, Iz=7e-9 * size**4, J=1e-8 * size**4, kappa_y=0.8, kappa_z=0.6
        )
        data = Member(material, section, orientation=tuple(rotation @ ORIENTATION), **member)
        self.beams: Beams = build_beams(self.mesh, {"a": data, "b": data})
        self.dofs: DofMap = dof_map(self.mesh, [("foot", ("ux", "uy", "uz", "rx", "ry", "rz"))] if held else [])


@pytest.fixture(scope="session")
def frame(steel):
    """Return a function that builds a frame for a rotation and options."""

    def make(rotation=None, **options):
        return Frame(options.pop("material", steel), np.eye(3) if rotation is None else rotation, **options)

    return make
