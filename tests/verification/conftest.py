"""Fixtures: cases from text, and straight beams in classical supports."""

import numpy as np
import pytest

from flexcam import read_case
from flexcam.dynamics import modes
from flexcam.fem.assembly import build_beams, mass, stiffness
from flexcam.fem.assembly import geometric as fem_geometric
from flexcam.fem.dofs import dof_map
from flexcam.fem.mesh import chain

PLANE = ("uz", "rx", "ry")
"""Components fixed at every node for plane bending in x-y."""

SUPPORTS = {
    "pinned-pinned": {"start": ("ux", "uy"), "end": ("uy",)},
    "fixed-free": {"start": ("ux", "uy", "rz"), "end": ()},
    "fixed-fixed": {"start": ("ux", "uy", "rz"), "end": ("uy", "rz")},
    "fixed-pinned": {"start": ("ux", "uy", "rz"), "end": ("uy",)},
}


class StraightBeam:
    """Elements, degrees of freedom and matrices of a straight beam."""

    def __init__(self, member, length, elements, held):
        self.mesh = chain((0, 0, 0), (length, 0, 0), elements, "beam")
        self.beams = build_beams(self.mesh, {"beam": member})
        self.dofs = dof_map(self.mesh, held)
        self.mass, self.stiffness = mass(self.beams, self.dofs), stiffness(self.beams, self.dofs)

    def geometric(self, force):
        return fem_geometric(self.beams, np.full(len(self.beams), float(force)), self.dofs)

    def frequencies(self, count, force=0.0):
        return modes(self.mass, self.stiffness + self.geometric(force), count).frequencies


@pytest.fixture
def case_of(tmp_path):
    """Return a function that reads a case from text and overrides."""

    def make(text, *overrides):
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return read_case(path, list(overrides))

    return make


@pytest.fixture(scope="session")
def straight_beam():
    """Return the class of a beam, built from member, length, elements and a list of (point, components)."""
    return StraightBeam


@pytest.fixture(scope="session")
def plane_beam():
    """Return a function that builds a beam in x-y bending from member, length, elements and supports by name."""

    def make(member, length, elements, supports):
        ends = [(point, PLANE + held) for point, held in SUPPORTS[supports].items()]
        inner = [("inner", PLANE)] if elements > 1 else []
        return StraightBeam(member, length, elements, ends + inner)

    return make
