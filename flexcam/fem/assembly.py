"""Members as element arrays, and assembly of element matrices into matrices of the free degrees of freedom."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from flexcam.core import FloatArray, Triplets
from flexcam.core.errors import positive, refuse, suggest_name
from flexcam.fem.dofs import DofMap, default_orientation, triads
from flexcam.fem.elements import beam
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.sections import Material, Section, Taper

_MassKind = Literal["consistent", "lumped"]


@dataclass(frozen=True)
class Member:
    """Material, section and beam theory of one member.

    Parameters
    ----------
    material, section
        Material and cross-section, which may vary over the length.
    orientation
        Vector in the local x-y plane, global axes; None for the default of `flexcam.fem.dofs`.
    shear
        Timoshenko instead of Euler-Bernoulli bending.
    rotary_inertia
        Rotary inertia of the sections in bending (the torsional inertia always counts).
    mass
        ``"consistent"`` or ``"lumped"``.
    geometric_stiffness
        Whether axial force and bending are coupled during a run.
    bow
        Initial half wave in the local x-y plane, at mid-length, m; only with the geometric stiffness.
    temperature
        Rise over the temperature of assembly, K; negative for a colder member.

    Examples
    --------
    >>> Member(Material(E=207e9, nu=0.29, density=7800.0), Section.circle(0.025)).shear
    False
    """

    material: Material
    section: Section | Taper
    orientation: tuple[float, float, float] | None = None
    shear: bool = False
    rotary_inertia: bool = True
    mass: _MassKind = "consistent"
    geometric_stiffness: bool = False
    bow: float = 0.0
    temperature: float = 0.0

    def __post_init__(self) -> None:
        if self.mass not in get_args(_MassKind):
            raise refuse("mass", repr(self.mass), " or ".join(get_args(_MassKind)))


def build_beams(mesh: Mesh, members: Mapping[str, Member]) -> Beams:
    """Return the element arrays of a mesh; a tapered element has the section at its middle."""
    for name in mesh.lines:
        if name not in members:
            raise refuse(f"members.{name}", "nothing", "data for every line group", remedy=suggest_name(name, members))
    ordered = [members[name] for name in mesh.lines]
    repeats = [len(line) - 1 for line in mesh.lines.values()]
    middles = [0.5 * (shares[1:] + shares[:-1]) for shares in (_shares(mesh, name) for name in mesh.lines)]
    sections = [section for m, at in zip(ordered, middles, strict=True) for section in map(m.section.at, at.tolist())]
    ends = mesh.nodes[mesh.elements()]
    span = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(span, axis=1)
    axes = span / length[:, None]
    orientations, bow = default_orientation(axes), np.zeros((len(length), 6))
    for member, part in zip(ordered, mesh.element_ranges().values(), strict=True):
        bow[part] = _initial_bow(member.bow, length[part])
        if member.orientation is not None:
            orientations[part] = member.orientation

    def repeat(values: list[float]) -> FloatArray:
        return np.repeat(np.array(values, dtype=float), np.array(repeats, dtype=np.intp))

    def of_sections(key: str) -> FloatArray:
        return np.array([getattr(section, key) for section in sections], dtype=float)

    E, G = repeat([m.material.E for m in ordered]), repeat([m.material.G for m in ordered])
    rho, A = repeat([m.material.density for m in ordered]), of_sections("A")
    Iy, Iz = of_sections("Iy"), of_sections("Iz")
    shear, rotary = repeat([float(m.shear) for m in ordered]), repeat([float(m.rotary_inertia) for m in ordered])
    kappa_y, kappa_z = of_sections("kappa_y"), of_sections("kappa_z")
    expansion = repeat([m.material.expansion * m.temperature for m in ordered])
    return Beams(
        nodes=mesh.elements(), length=length, triads=triads(axes, orientations),
        EA=E * A, GJ=G * of_sections("J"), EIy=E * Iy, EIz=E * Iz,
        rho_A=rho * A, rho_Ip=rho * (Iy + Iz), rho_Iy=rotary * rho * Iy, rho_Iz=rotary * rho * Iz,
        phi_y=shear * 12.0 * E * Iz / (kappa_y * A * G * length**2),
        phi_z=shear * 12.0 * E * Iy / (kappa_z * A * G * length**2),
        lumped=repeat([float(m.mass == "lumped") for m in ordered]),
        arched=repeat([float(m.geometric_stiffness) for m in ordered]), bow=bow,
        thermal=E * A * expansion,
    )  # fmt: skip


def _initial_bow(bow: float, length: FloatArray) -> FloatArray:
    """Return slopes and rotations, shape (e, 6), of elements with a half wave of given height in their x-y plane."""
    x = np.concatenate([[0.0], np.cumsum(length)])
    wave = np.pi / x[-1]
    y0 = np.zeros((len(length), 6))
    y0[:, 0] = bow * np.diff(np.sin(wave * x)) / length
    y0[:, 1], y0[:, 2] = bow * wave * np.cos(wave * x[:-1]), bow * wave * np.cos(wave * x[1:])
    return y0


def _shares(mesh: Mesh, name: str) -> FloatArray:
    """Return the place of every node of a member as a share of its length, shape (m + 1,)."""
    length = np.linalg.norm(np.diff(mesh.nodes[mesh.lines[name]], axis=0), axis=1)
    return np.append(0.0, np.cumsum(length)) / length.sum()


def sections_at_nodes(mesh: Mesh, members: Mapping[str, Member]) -> dict[str, list[Section]]:
    """Return the sections of every member at its nodes."""
    return {name: list(map(members[name].section.at, _shares(mesh, name).tolist())) for name in mesh.lines}


_BLOCK_SIZE = 1000  # number of elements processed together, so that their matrices fit in the processor cache


def _assemble_blocks(beams: Beams, local: Callable[[slice], FloatArray], dofs: DofMap) -> Triplets:
    """Return the matrix assembled from element matrices that are computed in blocks.

    The triplets are written in place; memory for full element matrices is reserved but not touched.
    """
    capacity = (144 if dofs.ties is None else 576) * len(beams)
    rows, cols, values = np.empty(capacity, np.intp), np.empty(capacity, np.intp), np.empty(capacity)
    end = 0
    for first in range(0, len(beams), _BLOCK_SIZE):
        part = slice(first, first + _BLOCK_SIZE)
        block = beams.part(part)
        unknowns, matrices = dofs.congruence(block.nodes, to_global(block, local(part)))
        free = unknowns >= 0
        keep = (matrices != 0.0) & free[:, :, None] & free[:, None, :]
        pairs = np.broadcast_arrays(unknowns[:, :, None], unknowns[:, None, :])
        entries = pairs[0][keep], pairs[1][keep], matrices[keep]
        begin, end = end, end + len(entries[0])
        for array, data in zip((rows, cols, values), entries, strict=True):
            array[begin:end] = data
    return Triplets(dofs.size, rows[:end], cols[:end], values[:end])


def to_global(beams: Beams, local: FloatArray) -> FloatArray:
    """Return element matrices, shape (e, 12, 12), transformed from local to global axes, ``T^T k T``."""
    rotated = _rotate_rows(beams, local)
    return _rotate_rows(beams, rotated.swapaxes(1, 2)).swapaxes(1, 2)


def _rotate_rows(beams: Beams, matrices: FloatArray) -> FloatArray:
    """Return ``T^T m``; each group of three rows is a vector at one end."""
    R_T = np.swapaxes(beams.triads, -1, -2)[:, None]
    return (R_T @ matrices.reshape(-1, 4, 3, 12)).reshape(-1, 12, 12)


def stiffness(beams: Beams, dofs: DofMap) -> Triplets:
    """Return the assembled elastic stiffness, SI."""
    return _assemble_blocks(beams, lambda part: beam.stiffness(beams.part(part)), dofs)


def mass(beams: Beams, dofs: DofMap) -> Triplets:
    """Return the assembled mass of the beams, SI."""
    return _assemble_blocks(beams, lambda part: beam.mass(beams.part(part)), dofs)


def geometric(beams: Beams, axial_force: FloatArray, dofs: DofMap) -> Triplets:
    """Return the assembled geometric stiffness under given axial forces."""
    return _assemble_blocks(beams, lambda part: beam.geometric(beams.part(part), axial_force[part]), dofs)


def distributed_load(beams: Beams, elements: slice, per_length: FloatArray) -> FloatArray:
    """Return the element loads of a force distributed uniformly over elements.

    The loads are consistent with the cubic shape functions: q L/2 at both ends and the fixed-end moments q L^2/12.
    Reference: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 7.2.
    """
    L = beams.length[elements]
    x, y, z = (beams.triads[elements] @ per_length).T
    half, moment = [x * L / 2.0, y * L / 2.0, z * L / 2.0], [0.0 * L, -z * L**2 / 12.0, y * L**2 / 12.0]
    loads = np.zeros((len(beams), 12))
    loads[elements] = np.stack([*half, *moment, *half, *(-m for m in moment)], axis=-1)
    return loads


def element_weight(beams: Beams, gravity: FloatArray) -> FloatArray:
    """Return the element loads of the weight: the mass matrix times the acceleration."""
    acceleration = beams.triads @ gravity
    zero = np.zeros_like(acceleration)
    return np.einsum("eij,ej->ei", beam.mass(beams), np.hstack([acceleration, zero, acceleration, zero]))


def thermal_load(beams: Beams) -> FloatArray:
    """Return the element loads that extend each element by its free thermal strain: ``EA alpha dT`` at both ends.

    Reference: J. S. Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 5.6 (bar element).
    """
    loads = np.zeros((len(beams), 12))
    loads[:, beam.AXIAL] = beams.thermal[:, None] * np.array([-1.0, 1.0])
    return loads


def assemble_loads(beams: Beams, loads: FloatArray, dofs: DofMap) -> FloatArray:
    """Assemble the load vector of element loads."""
    global_loads = np.einsum("eji,ekj->eki", beams.triads, loads.reshape(-1, 4, 3))
    return dofs.gather(beams.nodes, global_loads.reshape(-1, 2, 6))


@dataclass(frozen=True)
class Damping:
    """Damping of the whole structure; Rayleigh and modal damping add to the dampers of the model.

    Parameters
    ----------
    alpha
        Factor of the mass, 1/s.
    beta
        Factor of the stiffness, s.
    modal
        Damping ratio of every mode of the undamped structure.

    Examples
    --------
    >>> Damping(alpha=5.36, beta=7.46e-5).modal
    0.0
    """

    alpha: float = 0.0
    beta: float = 0.0
    modal: float = 0.0

    def __post_init__(self) -> None:
        positive("damping.alpha", self.alpha, "1/s", zero=True)
        positive("damping.beta", self.beta, "s", zero=True)
        positive("damping.modal", self.modal, "", zero=True)


def rayleigh_damping(mass: Triplets, stiffness: Triplets, alpha: float, beta: float) -> Triplets:
    """Return ``alpha M + beta K``."""
    parts = [matrix.scale(factor) for matrix, factor in ((mass, alpha), (stiffness, beta)) if factor != 0.0]
    return sum(parts, start=Triplets.zeros(mass.size))


def modal_damping(mass: Triplets, shapes: FloatArray, omegas: FloatArray, ratio: float) -> Triplets:
    """Return the damping matrix that gives the modes one damping ratio.

    C = M Phi diag(2 zeta omega) Phi^T M with Phi^T M Phi = I; the matrix is full. Reference: R. W. Clough and J.
    Penzien, Dynamics of Structures, 3rd ed. (2003), eq. 12-56.
    """
    M_Phi = np.column_stack([mass.times(shape) for shape in shapes.T]) if shapes.size else shapes
    return Triplets.from_dense((M_Phi * (2.0 * ratio * omegas)) @ M_Phi.T)
