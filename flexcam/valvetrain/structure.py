"""Structure of a model: matrices, and rows that extract motions of points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from flexcam.core import FloatArray, IntArray, Triplets, component_members, connected_components
from flexcam.core.errors import refuse, suggest_name
from flexcam.dynamics import Probe
from flexcam.fem.assembly import build_beams, distributed_load, element_weight, thermal_load
from flexcam.fem.assembly import mass as fem_mass
from flexcam.fem.assembly import stiffness as fem_stiffness
from flexcam.fem.dofs import COMPONENTS, DofMap, dof_map, rigid_ties
from flexcam.fem.elements.beam import Beams
from flexcam.fem.rigid_bodies import free_motions, mass_at, place_matrix, scalar_matrix
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Adjuster, Lash, Lever, LoadTable, Rocker, Seat, Spring, path_name, tip_name

_ACROSS = 1e-6  # cosine below which directions are orthogonal


@dataclass(frozen=True, eq=False)
class Structure:
    """The passive part of a model as matrices."""

    model: Model
    #: `beams`, `dofs`: elements and unknowns
    beams: Beams
    dofs: DofMap
    #: `mass`, `stiffness`, `dampers`: n x n, SI; `dampers` holds the discrete dampers only
    mass: Triplets
    stiffness: Triplets
    dampers: Triplets
    free: FloatArray  #: motions without strain energy, shape (n, k)

    def row(self, point: str, direction: FloatArray, where: str = "point") -> FloatArray:
        """Return the row that extracts the motion of a named point, shape (n,)."""
        rocker = self.model.rocker_points.get(point)
        if rocker is not None:
            factor = float(direction @ rocker.direction) if direction.any() else 1.0
            if abs(factor) < _ACROSS:
                given, axis = _format_direction(direction), _format_direction(rocker.direction)
                why = f"{point!r} moves only along {axis}, because a rocker defines it"
                key = f"{where.rpartition('.')[0]}.direction" if "." in where else where
                raise refuse(key, f"a direction along {given}", f"a direction along {axis}", why)
            if point in self.model.loose_points:
                return factor * self.dofs.unit(point)
            return factor * self.reach(rocker)
        return self.dofs.vector(find_node(self.model, point, where), direction)

    def push(self, contact: str) -> FloatArray:
        """Return the row of the motion of a follower away from its cam along the lift, shape (n,)."""
        pair = self.model.cam_contacts[contact]
        return self.row(pair.follower, pair.direction) - self.row(self.model.cams[pair.cam].at, pair.direction)

    def is_node(self, point: str) -> bool:
        """Return whether a point is a node of the mesh."""
        return point not in self.model.rocker_points

    def path(self, rocker: Rocker) -> FloatArray:
        """Return the row of the motion of a rocker's driven end, shape (n,): for a lever its path."""
        if isinstance(rocker, Lever) and not rocker.finger:
            return self.dofs.unit(path_name(self.name_of(rocker)))
        return self.row(rocker.start, rocker.direction)

    def reach(self, rocker: Rocker) -> FloatArray:
        """Return the row of a rocker's end at its point, shape (n,): ratio times its driven end, or a lever's tip."""
        if not isinstance(rocker, Lever):
            return rocker.ratio * self.path(rocker)
        tip = tip_name(self.name_of(rocker))
        return self.dofs.unit(tip if tip in self.dofs.names else rocker.point)

    def name_of(self, rocker: Rocker) -> str:
        """Return the name of a rocker of the model."""
        return next(name for name, candidate in self.model.rockers.items() if candidate is rocker)


def _format_direction(direction: FloatArray) -> str:
    """Return the component that a direction has, such as ``uy``, or the vector of an oblique one."""
    moving = np.flatnonzero(direction)
    return COMPONENTS[int(moving[0])] if len(moving) == 1 else str(direction[:3].round(6).tolist())


def lever_ends(structure: Structure, lever: Lever) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return the rows of the path and of the driven motion per elastic lever end, shape (n,) each."""
    path = structure.path(lever)
    ends = {1: (path, structure.reach(lever))}
    if not lever.finger:
        ends[0] = path, structure.row(lever.start, lever.direction)
    return ends


def find_node(model: Model, point: str, where: str) -> int:
    """Return the node of a named point."""
    if point not in model.mesh.points:
        names = [*model.mesh.points, *(r.point for r in model.rockers.values())]
        raise refuse(where, repr(point), f"a point: {', '.join(names)}", remedy=suggest_name(point, names))
    return model.mesh.node(point, where)


def stop_row(structure: Structure, name: str, part: Seat | Lash | Adjuster) -> FloatArray:
    """Return the row of the approach of both sides of a seat or lash, shape (n,)."""
    where = f"contacts.{name}"
    if isinstance(part, Seat):
        return -structure.row(part.at, part.direction, f"{where}.at")
    if part.ends is not None and part.direction is not None:
        first, second = (structure.row(end, part.direction, where) for end in part.ends)
        return first - second
    rocker = structure.model.rockers[str(part.rocker)]
    return structure.reach(rocker) - structure.dofs.unit(rocker.point)


def spring_ends(structure: Structure, name: str, spring: Spring) -> tuple[FloatArray, FloatArray]:
    """Return the rows of a spring's moving end and of its other end (zeros for ground), shape (n,) each."""
    moving = structure.row(spring.at, spring.direction, f"springs.{name}.at")
    if spring.to is None:
        return moving, np.zeros(structure.dofs.size)
    return moving, structure.row(spring.to, spring.direction, f"springs.{name}.to")


def spring_row(structure: Structure, name: str, spring: Spring) -> FloatArray:
    """Return the row of a spring's elongation: motion at its point minus that at its other end, shape (n,)."""
    moving, other = spring_ends(structure, name, spring)
    return moving - other


def spring_parts(structure: Structure, name: str, spring: Spring) -> list[tuple[FloatArray, FloatArray]]:
    """Return the rows of the ends of each part of a spring, from its fixed to its moving end."""
    moving, other = spring_ends(structure, name, spring)
    inner = [structure.dofs.unit(unknown) for unknown in structure.model.inner_unknowns[f"springs.{name}"]]
    return list(pairwise([other, *inner, moving]))


def nest_rows(structure: Structure, names: tuple[str, str]) -> FloatArray:
    """Return the rows of the sliding of a spring's coils on those of another, at equal distances, shape (m, n)."""
    inner, outer = (structure.model.springs[name] for name in names)
    count = max(inner.elements, outer.elements)
    height = (np.arange(count) + 0.5) / count

    def coil_rows(name: str, spring: Spring) -> FloatArray:
        parts = spring_parts(structure, name, spring)
        ends = np.array([parts[0][0], *(high for _, high in parts)])
        return np.array([np.interp(height, spring.heights, unit) for unit in np.eye(len(ends))]).T @ ends

    return coil_rows(names[0], inner) - coil_rows(names[1], outer)


@lru_cache(maxsize=4)
def build_structure(model: Model) -> Structure:
    """Assemble the passive part of a model."""
    dofs = dof_map(model.mesh, model.supports.items(), _single(model), rigid_ties(model.mesh, model.rigid_links))
    inner = [name for names in model.inner_unknowns.values() for name in names]
    bare = build_structure_in(model, dofs.extend([*model.further_unknowns, *inner]))
    return replace(
        bare, free=strain_free_motions(bare, (part for part in elastic_stretches(bare) if part.stiffness > 0.0))
    )


def strain_free_motions(structure: Structure, stretches: Iterable[Stretch]) -> FloatArray:
    """Return the motions, shape (n, k), that strain neither members and superelements nor some springs."""
    model = structure.model
    bodies = (model.inner_unknowns[f"superelements.{name}"] for name in model.superelements)
    modes = [structure.dofs.unit(name) for names in bodies for name in names]
    return free_motions(model.mesh, structure.dofs, [*(stretch.row for stretch in stretches), *modes])


def build_structure_in(model: Model, dofs: DofMap) -> Structure:
    """Assemble the passive part of a model with given unknowns."""
    beams, zero = build_beams(model.mesh, model.members), Triplets.zeros(dofs.size)
    bare = Structure(model, beams, dofs, zero, zero, zero, np.zeros((dofs.size, 0)))
    mass, stiffness, dampers = [fem_mass(beams, dofs), *_masses(bare)], [fem_stiffness(beams, dofs)], [zero]
    for stretch in elastic_stretches(bare):
        stiffness.append(scalar_matrix(stretch.row, stretch.stiffness))
        dampers.append(scalar_matrix(stretch.row, stretch.damping))
    for name, body in model.superelements.items():
        numbers = superelement_dofs(bare, name)
        parts = (mass, body.mass), (stiffness, body.stiffness), (dampers, body.damping)
        for matrices, matrix in parts:
            matrices.append(place_matrix(matrix, numbers, dofs.size))
    mass, stiffness, dampers = (Triplets.sum(parts) for parts in (mass, stiffness, dampers))
    return replace(bare, mass=mass, stiffness=stiffness, dampers=dampers)


def superelement_dofs(structure: Structure, name: str) -> IntArray:
    """Return the numbers of the unknowns of a superelement, -1 where a support holds a component."""
    nodal = [structure.dofs.numbers[node] for node in structure.model.mesh.bodies[name]]
    modes = structure.model.inner_unknowns[f"superelements.{name}"]
    return np.concatenate([*nodal, np.array([structure.dofs.names.index(mode) for mode in modes], np.intp)])


def _masses(bare: Structure) -> Iterator[Triplets]:
    for name, part in bare.model.masses.items():
        if bare.is_node(part.at):
            yield mass_at(find_node(bare.model, part.at, f"masses.{name}.at"), part.body, bare.dofs)
        elif any((*part.body.inertia, *part.body.products, *part.body.offset)):
            given, why = "inertia or offset at a rocker's point", "a lumped rocker moves its point along one line"
            raise refuse(f"masses.{name}", given, "a mass alone", why, "leave them out")
    yield from (scalar_matrix(scalar.row, scalar.mass) for parts in scalar_inertias(bare).values() for scalar in parts)


@dataclass(frozen=True, eq=False)
class ScalarInertia:
    """Mass on one scalar motion: at a rocker's point, of a rocker, or of a part of a spring."""

    row: FloatArray  #: shape (n,)
    mass: float  #: kg
    direction: FloatArray  #: translation in space per motion of the scalar, shape (3,); zeros if nothing translates


def scalar_inertias(structure: Structure) -> dict[str, list[ScalarInertia]]:
    """Return the masses on scalar motions by part, such as ``rocker intake``."""
    model, zero = structure.model, np.zeros(3)
    inertias: dict[str, list[ScalarInertia]] = {}
    for name, part in model.masses.items():
        if not structure.is_node(part.at):
            direction = model.rocker_points[part.at].direction[:3]
            inertias[f"mass {name}"] = [ScalarInertia(structure.row(part.at, np.zeros(6)), part.body.mass, direction)]
    for name, rocker in model.rockers.items():
        inertias[f"rocker {name}"] = [ScalarInertia(structure.path(rocker), rocker.inertia / rocker.arms[0] ** 2, zero)]
    for name, spring in model.springs.items():
        if spring.mass > 0.0:
            parts = zip(spring.parts, spring_parts(structure, name, spring), strict=True)
            inertias[f"spring {name}"] = own = list[ScalarInertia]()
            for part, (low, high) in parts:  # consistent: m/6 [2 1; 1 2]
                own.append(ScalarInertia(0.5 * (low + high), part.mass, spring.direction[:3]))
                own.append(ScalarInertia(high - low, part.mass / 12.0, zero))
    return inertias


@dataclass(frozen=True, eq=False)
class Stretch:
    """Elastic element on one scalar: the end of a lever, or a part of a spring."""

    row: FloatArray  #: shape (n,)
    #: `stiffness`, `damping`: N/m and N s/m
    stiffness: float
    damping: float
    rigid: bool  #: whether it belongs to the train itself, and is rigid in the rigid model


def elastic_stretches(structure: Structure) -> Iterator[Stretch]:
    """Yield the lever ends, as installed, and the parts of springs."""
    for lever in structure.model.levers.values():
        for end, (path, motion) in lever_ends(structure, lever).items():
            row = float(lever.reach(np.zeros(1), end)[1][0]) * path - motion
            yield Stretch(row, lever.stiffness[end], lever.damping[end], rigid=True)
    yield from spring_stretches(structure)


def spring_stretches(structure: Structure) -> Iterator[Stretch]:
    """Yield the parts of springs."""
    for name, spring in structure.model.springs.items():
        for part, (low, high) in zip(spring.parts, spring_parts(structure, name, spring), strict=True):
            yield Stretch(high - low, part.stiffness, part.damping, rigid=spring.link)


def _single(model: Model) -> list[tuple[int, FloatArray]]:
    """Return motions of nodes without members: where a mass has inertia, along springs, and of superelements."""
    points, used = model.mesh.points, model.mesh.on_members()
    motions = [(part.at, np.diag(part.body.matrix())) for part in model.masses.values()]
    for spring in model.springs.values():
        motions += [(end, spring.direction) for end in (spring.at, spring.to) if end is not None]
    nodes = [(int(node), size) for point, size in motions if point in points for node in points[point]]
    nodes += [(node, np.ones(6)) for body in model.mesh.bodies.values() for node in body.tolist()]
    return [(node, size) for node, size in nodes if not used[node]]


def coupled_groups(structure: Structure, rows: Iterable[FloatArray] = ()) -> list[IntArray]:
    """Return the unknowns of each part that is coupled by mass, stiffness or rows."""
    matrix = structure.mass + structure.stiffness
    coupled = matrix.values != 0.0
    pairs = [(matrix.rows[coupled], matrix.cols[coupled])]
    pairs += [(np.full(len(dofs), dofs[0]), dofs) for dofs in map(np.flatnonzero, rows) if len(dofs)]
    first, second = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return component_members(connected_components(matrix.size, first, second))


def member_masses(model: Model) -> dict[str, float]:
    """Return the mass of every member."""
    beams = build_beams(model.mesh, model.members)
    return {n: float((beams.rho_A * beams.length)[part].sum()) for n, part in model.mesh.element_ranges().items()}


def element_loads(structure: Structure) -> FloatArray:
    """Return the element loads: given distributed forces, weight and thermal loads."""
    total = thermal_load(structure.beams)
    for name, load in structure.model.loads.items():
        total += distribute_load(structure, name) if load.member is not None else 0.0
    return total + element_weight(structure.beams, np.array(structure.model.gravity))


def distribute_load(structure: Structure, name: str) -> FloatArray:
    """Return the element loads of a force that is distributed over a member."""
    load = structure.model.loads[name]
    elements = structure.model.mesh.element_ranges()[load.member or ""]
    size = 0.0 if isinstance(load.size, LoadTable) else load.size  # a table acts at a point
    return distributed_load(structure.beams, elements, size * load.direction[:3])


def probe_of(structure: Structure, point: str) -> Probe:
    """Return the probe of a point: its six components, or the motion of a rocker's point."""
    if point in structure.model.rocker_points:
        return Probe(point, (point,), structure.row(point, np.zeros(6))[None, :], (None,))
    node = find_node(structure.model, point, "output.probes")
    rows = np.array([structure.dofs.vector(node, unit) for unit in np.eye(6)])
    return Probe(point, COMPONENTS, rows, (None,) * 6)
