"""Finite elements: conventions, material, section, mesh, frames, the beam element, unknowns, assembly.

Knows no cam and no valve train; may import `linalg` and `checks`.
A new element is a file in `elements`; a new concentrated part goes to `lumped`, a new mesh generator to `generate`.
"""

from flexcam.fem.assembly import assemble, geometric, mass, stiffness
from flexcam.fem.conventions import COMPONENTS, ROTATIONS, component, direction
from flexcam.fem.damping import Damping
from flexcam.fem.dofs import DofMap, dof_map
from flexcam.fem.elements import beam
from flexcam.fem.elements.beam import Beams
from flexcam.fem.lumped import PointMass, along, mass_at
from flexcam.fem.material import Material
from flexcam.fem.member import Member, beams
from flexcam.fem.mesh import Mesh, refined
from flexcam.fem.rigid import free_motions
from flexcam.fem.section import Section

__all__ = [
    "COMPONENTS",
    "ROTATIONS",
    "Beams",
    "Damping",
    "DofMap",
    "Material",
    "Member",
    "Mesh",
    "PointMass",
    "Section",
    "along",
    "assemble",
    "beam",
    "beams",
    "component",
    "direction",
    "dof_map",
    "free_motions",
    "geometric",
    "mass",
    "mass_at",
    "refined",
    "stiffness",
]
