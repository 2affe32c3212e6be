"""Modes of a model with a description by kinetic energy of members and masses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexcam import dynamics
from flexcam.cams import event_extremes
from flexcam.core import (
    ComplexArray,
    FloatArray,
    IntArray,
    Triplets,
    component_members,
    connected_components,
    null_space,
    select_constraints,
)
from flexcam.core.errors import refuse
from flexcam.dynamics import (
    ActiveDofs,
    CamMotion,
    ConstantSpeed,
    DofSubset,
    ModeBasis,
    Modes,
    NotPositiveError,
    Problem,
    RunFailedError,
    System,
    Tangents,
    active_dofs_of,
    equilibrium,
    instability_status,
    project_system,
    static_displacement,
)
from flexcam.fem.assembly import geometric as fem_geometric
from flexcam.fem.assembly import thermal_load
from flexcam.fem.dofs import COMPONENTS
from flexcam.fem.elements import beam
from flexcam.fem.recovery import section_forces
from flexcam.fem.rigid_bodies import scalar_matrix
from flexcam.valvetrain.loads import series_stiffness
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, Lash, PublishedLoad
from flexcam.valvetrain.structure import Structure, build_structure, scalar_inertias, stop_row, superelement_dofs
from flexcam.valvetrain.system_builder import build_system

_LOCAL = "bending in local x-"  # plane of bending of a member that is not along a global axis
_ALONG = 1e-6  # tolerance of a direction along a global axis
_ENERGY_FRACTION = 0.05  # fraction of a mode's kinetic energy above which a part is named


@dataclass(frozen=True, eq=False)
class ModelModes:
    """Modes of a model."""

    modes: Modes  #: frequencies and shapes
    #: effective masses along ux uy uz and about rx ry rz through the origin, shape (k, 6), kg and kg m^2
    effective: FloatArray
    #: kinetic energy by part, one dict per mode: ``"camshaft torsion"`` or ``"mass valve"`` to its share
    shares: tuple[dict[str, float], ...]

    def words(self, mode: int) -> str:
        """Describe a mode, such as ``mass valve 60 %, pushrod axial 30 %``."""
        shares = sorted(self.shares[mode].items(), key=lambda item: -item[1])
        parts = [(part, share) for part, share in shares if share >= _ENERGY_FRACTION]
        # A rocker may be named "rocker".
        named = [f"{' '.join(dict.fromkeys(part.split()))} {100.0 * share:.0f} %" for part, share in parts]
        return ("free motion: " if mode < self.modes.rigid else "") + ", ".join(named)


def model_modes(
    structure: Structure, count: int | None = None, *, loaded: FloatArray | None = None,
    held: Sequence[tuple[str, Triplets]] = (),
) -> ModelModes:  # fmt: skip
    """Return the lowest modes of a model."""
    stiffness, free = structure.stiffness, structure.free
    force = None
    if loaded is not None:
        nodal = structure.dofs.nodal(loaded)
        force = section_forces(structure.beams, nodal, spread=thermal_load(structure.beams))[:, 0, 0]
    if held:
        closed = Triplets.sum([matrix for _, matrix in held])
        stiffness, free = stiffness + closed, _unstressed_motions(free, closed, stiffness)
    if force is not None:
        geometric = fem_geometric(structure.beams, force, structure.dofs)
        stiffness, free = stiffness + geometric, _unstressed_motions(free, geometric, stiffness)
    try:
        modes = dynamics.modes(structure.mass, stiffness, count, free=free)
    except NotPositiveError as failure:
        if failure.motion is None:
            raise
        parts = list(held)
        if force is not None:
            for name, elements in structure.model.mesh.element_ranges().items():
                matrix = fem_geometric(structure.beams.part(elements), force[elements], structure.dofs)
                parts.append((f"members.{name}", matrix))
        raise RunFailedError(instability_status(structure.dofs.names, failure.motion, parts)) from None
    effective = (modes.shapes.T @ _base_inertia(structure)) ** 2
    return ModelModes(modes, effective, _shares(structure, modes.shapes))


def _base_inertia(structure: Structure) -> FloatArray:
    """Return the inertia forces M r on the unknowns per unit acceleration of the base along r, shape (n, 6).

    The effective mass of a mass-orthonormal mode is ``(phi^T M r)^2``: R. W. Clough and J. Penzien, Dynamics of
    Structures, 3rd ed. (2003), sec. 26-2. The rows of the free components in M are complete: the motion of supported
    ones acts on them as well. The frame and with it all pivots move. A rocker then does not rotate, and masses at its
    points translate.
    """
    whole = build_structure(replace(structure.model, supports={}))
    motions = [whole.dofs.rigid_motion(whole.model.mesh, unit) for unit in np.eye(6)]
    forces = np.array([whole.mass.times(motion) for motion in motions]).T
    for inertia in (inertia for parts in scalar_inertias(whole).values() for inertia in parts):
        for axis, component in enumerate(inertia.direction.tolist()):
            forces[:, axis] += inertia.mass * inertia.row * (component - float(inertia.row @ motions[axis]))
    places = {name: i for i, name in enumerate(whole.dofs.names)}
    return forces[[places[name] for name in structure.dofs.names]]


def _unstressed_motions(free: FloatArray, geometric: Triplets, stiffness: Triplets) -> FloatArray:
    """Return the free motions without geometric stiffness, which acts against rotation of a member."""
    if not free.shape[1]:
        return free
    values, vectors = np.linalg.eigh(free.T @ geometric.multiply(free))
    size = float((free**2 * stiffness.diagonal()[:, None]).sum(axis=0).max())
    return free @ vectors[:, np.abs(values) <= 1e-12 * size]


def _shares(structure: Structure, shapes: FloatArray) -> tuple[dict[str, float], ...]:
    """Return the kinetic energy of every part as a fraction, one dict per mode; shapes are mass-orthonormal."""
    model, nodal = structure.model, structure.dofs.nodal(shapes.T)
    shares = _member_shares(structure, nodal)
    for name, mass in model.masses.items():
        if structure.is_node(mass.at):
            motion = nodal[:, model.mesh.node(mass.at)]
            shares[f"mass {name}"] = np.einsum("ki,ij,kj->k", motion, mass.body.matrix(), motion)
    for name, body in model.superelements.items():
        numbers = superelement_dofs(structure, name)
        motion = np.where(numbers[:, None] >= 0, shapes[numbers], 0.0)
        shares[f"superelement {name}"] = np.einsum("ik,ij,jk->k", motion, body.mass, motion)
    for name, parts in scalar_inertias(structure).items():
        shares[name] = np.sum([inertia.mass * (inertia.row @ shapes) ** 2 for inertia in parts], axis=0)
    rows = np.array([*shares.values()]).reshape(len(shares), len(nodal)).T.tolist()
    return tuple(dict(zip(shares, row, strict=True)) for row in rows)


def _member_shares(structure: Structure, nodal: FloatArray) -> dict[str, FloatArray]:
    beams, mass = structure.beams, beam.mass(structure.beams)
    ends = nodal[:, beams.nodes].reshape(len(nodal), len(beams.nodes), 4, 3)
    local = np.einsum("eij,nekj->neki", beams.triads, ends).reshape(*ends.shape[:2], 2 * len(COMPONENTS))
    shares: dict[str, FloatArray] = {}
    energies = [
        np.einsum("nei,eij,nej->ne", local[..., dofs], mass[:, dofs[:, None], dofs], local[..., dofs])
        for dofs in (beam.AXIAL, beam.TORSION, beam.PLANE_XY, beam.PLANE_XZ)
    ]
    for member, elements in structure.model.mesh.element_ranges().items():
        x, y, z = (_global_axis(beams.triads[elements, k]) for k in range(3))
        kinds = "axial", "torsion", _bending(x, y, "y"), _bending(x, z, "z")
        for kind, energy in zip(kinds, energies, strict=True):
            shares[f"{member} {kind}"] = energy[:, elements].sum(axis=1)
    return shares


def _global_axis(directions: FloatArray) -> int | None:
    """Return the number of the global axis to which all unit vectors are parallel, shape (e, 3)."""
    sizes = np.abs(directions)
    axis = int(sizes[0].argmax())
    return axis if (np.abs(sizes[:, axis] - 1.0) <= _ALONG).all() else None


def _bending(axis: int | None, deflection: int | None, local: str = "") -> str:
    """Return a plane of bending by the global axes of the member and of the deflection, otherwise by the local axes."""
    if axis is None or deflection is None:
        return f"{_LOCAL}{local}"
    first, second = sorted((axis, deflection))
    return f"bending in {'xyz'[first]}-{'xyz'[second]}"


def explain_planes(words: Iterable[str]) -> list[str]:
    """Explain the local axes in descriptions of modes, if any has them."""
    note = (
        "local: axes of a member that is not along a global axis: x along it, y towards its `orientation`, by default "
        "global y (global -x if the member is within one degree of y)."
    )
    return [note] if any(_LOCAL in text for text in words) else []


def modal_basis(problem: Problem, count: int, *, by_parts: bool = False) -> ModeBasis:
    """Return the lowest modes with the static response to all loads, local forces and probes."""
    n = problem.system.size
    subset = DofSubset(np.arange(n), np.zeros(n))
    if problem.prune:
        active = active_dofs_of(problem)
        subset = DofSubset(np.flatnonzero(active.moving), active.offset)
    if not subset.size:
        return ModeBasis(np.zeros((n, 0)), shift=subset.offset)
    reduced = project_system(problem.system, subset)
    forces = [vector.vectors for force in reduced.local_forces for vector in (*force.sense, *force.act)]
    rows = np.concatenate([reduced.load_vectors(), *forces, *(probe.rows for probe in reduced.probes)])
    rows = rows[rows.any(axis=1)]
    if by_parts:
        boundary, parts = _parts(reduced, rows)
        vectors = dynamics.craig_bampton(reduced.mass, reduced.stiffness, boundary, parts, count)
    else:
        vectors = dynamics.corrected_modes(reduced.mass, reduced.stiffness, rows, count, free=reduced.free)
    return ModeBasis(subset.expand(vectors.T).T, shift=subset.offset)


def _parts(system: System, rows: FloatArray) -> tuple[IntArray, list[IntArray]]:
    """Return the interface unknowns (loaded, observed or otherwise free), and the other unknowns in groups."""
    interface: NDArray[np.bool_] = np.array(rows.any(axis=0))
    inner = np.flatnonzero(~interface)
    while len(inner) and (free := null_space(system.stiffness.part(inner))).shape[1]:
        interface[inner[select_constraints(free)]] = True  # fix one more unknown per free motion between these
        inner = np.flatnonzero(~interface)
    coupling = system.stiffness.part(inner) + system.mass.part(inner)
    labels = connected_components(len(inner), coupling.rows, coupling.cols)
    return np.flatnonzero(interface), [inner[group] for group in component_members(labels)]


_COMPLIANCE_FRACTION = 1e-4  # fraction of the static contact compliance above which a mode is relevant for the contact
_MAX_CONTACT_UNKNOWNS = 3000  # number of unknowns up to which contact matrices are reasonable


@dataclass(frozen=True, eq=False)
class ContactModes:
    """Modes on the lift of a cam."""

    model_modes: ModelModes  #: modes with the stiffness of contacts closed at full lift
    push: FloatArray  #: modal force per contact force, shape (k,), 1/sqrt(kg)
    open_lashes: tuple[str, ...] = ()  #: lashes that are open, and that these modes do not include

    @property
    def relevant_modes(self) -> list[int]:
        """Indices of the modes that contribute to the static contact compliance, without free motions.

        Compared with the modal force, this criterion gives low modes more weight, so that spring surge is not missed
        among the stiff modes of the contact.
        """
        rigid, omegas = self.model_modes.modes.rigid, self.model_modes.modes.omegas
        shares = (self.push[rigid:] / omegas[rigid:]) ** 2
        return (np.flatnonzero(shares > _COMPLIANCE_FRACTION * shares.sum()) + rigid).tolist()


def contact_modes(structure: Structure, contact: str, held: Sequence[tuple[str, Triplets]]) -> ContactModes:
    """Return the modes of a train, and the modal force of a contact in each."""
    modes = model_modes(structure, held=held)
    lashes = {f"contacts.{name}" for name, part in structure.model.contacts.items() if isinstance(part, Lash)}
    open_lashes = tuple(name for name, stiffness in held if name in lashes and not stiffness.values.any())
    return ContactModes(modes, np.abs(structure.push(contact) @ modes.modes.shapes), open_lashes)


def contact_stiffness(
    system: System, motion: CamMotion, displacement: FloatArray, velocity: FloatArray, inner: FloatArray | None = None
) -> list[tuple[str, Triplets]]:
    """Return the stiffness of each local force at an instant."""
    tangents = Tangents(system, motion, displacement, velocity, inner)
    return [(name, Triplets.from_dense(0.5 * (matrix + matrix.T))) for name, matrix in tangents.parts(0)]


def modes_on_the_lift(
    model: Model, contact: str, speed: float, *, base_circle: bool = False,
    acceleration: Callable[[dynamics.CamMotion], FloatArray] | None = None,
) -> ContactModes:  # fmt: skip
    """Return the modes about the static equilibrium at full lift of a cam, or on its base circle.

    The equilibrium includes the inertia forces of an acceleration of all unknowns, shape (n,), at the instant.
    """
    structure, system = build_structure(model), build_system(model, speed)
    if not system.local_forces or system.size > _MAX_CONTACT_UNKNOWNS:
        return contact_modes(structure, contact, ())
    cam = model.cams[model.cam_contacts[contact].cam]
    lowest, highest = event_extremes(cam.event)
    drive = ConstantSpeed(speed, start=cam.drive_angle((lowest if base_circle else highest).at))
    instant = drive.at(np.zeros(1))
    state = equilibrium(system, drive, load=None if acceleration is None else -system.mass.times(acceleration(instant)))
    inner = None if state.inner is None else state.inner[None]
    velocity = np.zeros((1, system.size))
    return contact_modes(
        structure, contact, contact_stiffness(system, instant, state.displacement[None], velocity, inner)
    )


def describe_inactive(structure: Structure, dofs: ActiveDofs) -> list[str]:
    """Describe the inactive degrees of freedom of a structure."""
    texts: list[str] = []
    for group in dofs.inactive:
        reason = "not held and not loaded" if group.free else "not loaded"
        reason = "constant loads in static equilibrium, no motion" if group.loaded else reason
        texts.append(f"{_place(structure, group.unknowns)}: {reason}")
    return [f"{text} ({texts.count(text)} times)" if texts.count(text) > 1 else text for text in dict.fromkeys(texts)]


def _place(structure: Structure, unknowns: IntArray) -> str:
    """Return members, motion and components of unknowns, or their names if not on a member."""
    positions = np.argwhere(structure.dofs.numbers >= 0)
    nodes, components = positions[unknowns[unknowns < len(positions)]].T
    elements: IntArray = np.flatnonzero(np.isin(structure.beams.nodes, nodes).any(axis=1))
    if len(nodes) < len(unknowns) or not len(elements):
        indices: list[int] = unknowns.tolist()
        return ", ".join(structure.dofs.names[i] for i in indices)
    ranges = structure.model.mesh.element_ranges()
    members = [name for name, part in ranges.items() if ((elements >= part.start) & (elements < part.stop)).any()]
    distinct: list[int] = np.unique(components).tolist()
    motion = _motion(structure.beams.triads[elements, 0], distinct)
    return f"{' and '.join(members)}: {motion} ({', '.join(COMPONENTS[c] for c in distinct)})"


def _motion(axes: FloatArray, components: list[int]) -> str:
    """Return the kind of components for members along axes, shape (e, 3): axial, torsion or bending."""
    axis = _global_axis(axes)
    return "motion" if axis is None else " and ".join(dict.fromkeys(_kind(axis, c) for c in components))


def _kind(axis: int, component: int) -> str:
    """Return the kind of a component, ux to rz, for a member along axis x, y or z, by number."""
    rotation, direction = divmod(component, 3)
    if direction == axis:
        return "torsion" if rotation else "axial motion"
    return _bending(axis, 3 - axis - direction if rotation else direction)


_MAX_RESPONSE_UNKNOWNS = 3000  # number of unknowns up to which a dense solution per harmonic is reasonable


def lift_transfer(model: Model, contact: str, row: FloatArray, speed: float) -> Callable[[FloatArray], ComplexArray]:
    """Return a scalar of the motion, shape (n,), per lift of a cam, as a function of the circular frequency."""
    system = build_system(model, speed)
    if contact not in model.cam_contacts:
        raise refuse("contact", repr(contact), f"one of {', '.join(model.cam_contacts)}")
    if system.size > _MAX_RESPONSE_UNKNOWNS:
        allowed = f"up to {_MAX_RESPONSE_UNKNOWNS} for a polydyne cam"
        raise refuse("model", f"{system.size} unknowns", allowed, "", "use fewer elements")
    structure, pair = build_structure(model), model.cam_contacts[contact]
    push, stiffness, free = structure.push(contact), system.stiffness, system.free
    if isinstance(pair, PublishedLoad):
        force = series_stiffness(structure, pair, f"contacts.{contact}.follower") * push
    else:
        if pair.stiffness is None:
            allowed, why = "a constant such as '50 MN/m'", "a polydyne cam needs a linear train"
            raise refuse(f"contacts.{contact}.stiffness", "hertz", allowed, why)
        force = pair.stiffness * push
        stiffness, free = stiffness + scalar_matrix(push, pair.stiffness), None
    for name, lash in model.contacts.items():  # lash is closed while the train is under compression
        if isinstance(lash, Lash | Adjuster):
            closed = scalar_matrix(stop_row(structure, name, lash), lash.stiffness)
            stiffness, free = stiffness + closed, None
    M, C, K = (np.asarray(matrix.dense()) for matrix in (system.mass, system.damping, stiffness))
    static = float(row @ static_displacement(stiffness, force, system.names, free))

    def response(omega: FloatArray) -> ComplexArray:
        values: ComplexArray = np.full(omega.shape, static, dtype=np.complex128)
        for i in np.flatnonzero(omega > 0.0).tolist():
            w = float(omega[i])
            values[i] = row @ np.linalg.solve(K + 1j * w * C - w**2 * M, force)
        return values

    return response
