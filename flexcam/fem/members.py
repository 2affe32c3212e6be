"""Members: material, section and beam theory of a chain of nodes, and the element arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse, suggest_name
from flexcam.fem.elements.beam import Beams
from flexcam.fem.frames import default_orientation, triads
from flexcam.fem.mesh import Mesh
from flexcam.fem.sections import Material, Section, Taper


@dataclass(frozen=True)
class Member:
    """Material, section and beam theory of one member.

    Parameters
    ----------
    material, section
        Material and cross-section, which may vary over the length.
    orientation
        Vector in the local x-y plane, global axes; None for the default of `flexcam.fem.frames`.
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
    mass: Literal["consistent", "lumped"] = "consistent"
    geometric_stiffness: bool = False
    bow: float = 0.0
    temperature: float = 0.0


def beams(mesh: Mesh, members: Mapping[str, Member]) -> Beams:
    """Return the element arrays of a mesh; a tapered element has the section at its middle."""
    for name in mesh.lines:
        if name not in members:
            raise refuse(f"members.{name}", "nothing", "data for every line group", remedy=suggest_name(name, members))
    chosen = [members[name] for name in mesh.lines]
    repeats = [len(line) - 1 for line in mesh.lines.values()]
    middles = [0.5 * (shares[1:] + shares[:-1]) for shares in (_shares(mesh, name) for name in mesh.lines)]
    sections = [section for m, at in zip(chosen, middles, strict=True) for section in map(m.section.at, at.tolist())]
    ends = mesh.nodes[mesh.elements()]
    span = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(span, axis=1)
    axes = span / length[:, None]
    orientations, bow = default_orientation(axes), np.zeros((len(length), 6))
    for member, part in zip(chosen, mesh.element_ranges().values(), strict=True):
        bow[part] = _initial_bow(member.bow, length[part])
        if member.orientation is not None:
            orientations[part] = member.orientation

    def each(values: list[float]) -> FloatArray:
        return np.repeat(np.array(values, dtype=float), np.array(repeats, dtype=np.intp))

    def of_sections(key: str) -> FloatArray:
        return np.array([getattr(section, key) for section in sections], dtype=float)

    E, G = each([m.material.E for m in chosen]), each([m.material.G for m in chosen])
    rho, A = each([m.material.density for m in chosen]), of_sections("A")
    Iy, Iz = of_sections("Iy"), of_sections("Iz")
    shear, rotary = each([float(m.shear) for m in chosen]), each([float(m.rotary_inertia) for m in chosen])
    kappa_y, kappa_z = of_sections("kappa_y"), of_sections("kappa_z")
    expansion = each([m.material.expansion * m.temperature for m in chosen])
    return Beams(
        nodes=mesh.elements(), length=length, triads=triads(axes, orientations),
        EA=E * A, GJ=G * of_sections("J"), EIy=E * Iy, EIz=E * Iz,
        rho_A=rho * A, rho_Ip=rho * (Iy + Iz), rho_Iy=rotary * rho * Iy, rho_Iz=rotary * rho * Iz,
        phi_y=shear * 12.0 * E * Iz / (kappa_y * A * G * length**2),
        phi_z=shear * 12.0 * E * Iy / (kappa_z * A * G * length**2),
        lumped=each([float(m.mass == "lumped") for m in chosen]),
        arched=each([float(m.geometric_stiffness) for m in chosen]), bow=bow,
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
