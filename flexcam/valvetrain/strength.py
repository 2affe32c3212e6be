"""Strength of members: compression and geometric stiffness, buckling, stresses and fatigue safety."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from flexcam.core import DENSE_LIMIT, FloatArray, IntArray, Triplets, null_space, select_constraints
from flexcam.dynamics import Block, Channel, ForceLaw, LocalForce, Observable, Observation, Stats, Status, constant
from flexcam.dynamics.force_laws import ARCH
from flexcam.fem.assembly import build_beams, geometric, sections_at_nodes, stiffness
from flexcam.fem.dofs import DofMap, dof_map
from flexcam.fem.elements.arch import SCALARS, Arch, deformation_matrix
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import Mesh, refine
from flexcam.fem.recovery import fibres, section_forces
from flexcam.valvetrain.camshaft import PARALLEL, shaft_axes
from flexcam.valvetrain.coupling import Coupling, opposed_force
from flexcam.valvetrain.model import Model
from flexcam.valvetrain.parts import Spring
from flexcam.valvetrain.structure import Structure, element_loads


@lru_cache(maxsize=16)
def buckling_load(model: Model, member: str) -> float:
    """Return the buckling load of a member, with the members that continue it, in its supports.

    The lowest P of ``K + P Kg(-1)`` over their elements, with the supports of the nodes and the springs and bearings
    from them to ground. Other members are neglected, so that a pushrod between guides has Euler's load. Ends that the
    supports leave free are hinged. Elements are divided if fewer than four lie between supports, as a single one is up
    to 50 % too stiff. The load of too many elements is infinite.
    """
    names, line = _find_strut(model, member)
    load = _lowest_load(model, names, line, 1) if 6 * (len(line) - 1) <= DENSE_LIMIT else math.inf
    return load if math.isinf(load) or (parts := _parts(model, line)) == 1 else _lowest_load(model, names, line, parts)


_STRAIGHT = 0.99
"""Cosine between two elements above which the second continues the first."""


def _find_strut(model: Model, member: str) -> tuple[list[str], IntArray]:
    """Return a member and the members that continue it in a line, without others at the joints, and their nodes."""
    mesh, names, line = model.mesh, [member], model.mesh.lines[member]
    elements = np.bincount(mesh.elements().ravel(), minlength=len(mesh.nodes))
    ends = {name: (other, other[::-1]) for name, other in mesh.lines.items()}

    def direction(nodes: IntArray) -> FloatArray:
        vector: FloatArray = np.diff(mesh.nodes[nodes], axis=0)[0]
        return vector / np.linalg.norm(vector)

    for _ in range(2):
        line = line[::-1]
        while elements[line[-1]] == 2:
            others = [(name, other) for name in ends.keys() - {*names} for other in ends[name] if other[0] == line[-1]]
            if not others or direction(line[-2:]) @ direction(others[0][1][:2]) < _STRAIGHT:
                break
            names.append(others[0][0])
            line = np.append(line, others[0][1][1:])
    return names, line


def stiff_struts(model: Model) -> dict[str, tuple[float, int]]:
    """Return the members with too few elements for their geometric stiffness, by name.

    The values are the relative excess of the buckling load, infinite if no node is free to bend, and a sufficient
    number of elements.
    """
    struts: dict[str, tuple[float, int]] = {}
    for name, member in model.members.items():
        if not member.geometric_stiffness:
            continue
        names, line = _find_strut(model, name)
        if 6 * (len(line) - 1) > DENSE_LIMIT or (parts := _parts(model, line)) == 1:
            continue
        coarse, fine = (_lowest_load(model, names, line, n) for n in (1, parts))
        if coarse > (1.0 + _EXCESS_LIMIT) * fine:
            struts[name] = coarse / fine - 1.0, parts * (len(model.mesh.lines[name]) - 1)
    return struts


_EXCESS_LIMIT = 0.05  # relative excess of the buckling load to report: two elements between supports stay below it


def _lowest_load(model: Model, names: list[str], line: IntArray, parts: int) -> float:
    """Return the buckling load of members in a line, of divided elements."""
    nodes = np.unique(line)
    member, dofs, guides = _divide(model, names, nodes, parts)
    K, G = stiffness(member, dofs), geometric(member, np.full(len(member), -1.0), dofs)
    numbers = dofs.numbers[np.unique(member.nodes)]
    used = np.unique(numbers[numbers >= 0])
    K, softening = K.part(used), -G.part(used).dense()
    free = np.linalg.qr(null_space(K))[0]
    remaining = np.setdiff1d(np.arange(len(used)), select_constraints(free) if free.shape[1] else [])
    if not len(remaining):
        return math.inf
    ends = np.isin(used, dofs.numbers[np.searchsorted(nodes, line[[0, -1]]), :3])
    P = _motions_with_hinged_ends(free, ends)[:, remaining]
    hinged, held = P.T @ softening @ P, P.T @ guides.part(used).multiply(P)
    root = np.linalg.cholesky(K.part(remaining).dense() + held)
    scaled = np.linalg.solve(root, np.linalg.solve(root, hinged).T)
    largest = float(np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).max())
    return 1.0 / largest if largest > 1e-12 * float(np.abs(scaled).max(initial=1.0)) else math.inf


_SUFFICIENT_ELEMENTS = 4  # elements between supports for which the buckling load is accurate to 1 % with any supports
_MANY = 100  # number of elements of a member up to which they are divided: their matrices are dense


def _parts(model: Model, line: IntArray) -> int:
    points = model.mesh.points
    guides = {*model.supports, *(at for at, _ in _ground_springs(model))}
    supported = {node for point in guides for node in points[point].tolist()}
    inner = [i for i in range(1, len(line) - 1) if int(line[i]) in supported]
    count = math.ceil(_SUFFICIENT_ELEMENTS / int(np.diff([0, *inner, len(line) - 1]).min()))
    return min(count, max(2, _MANY // len(line)))


def _ground_springs(model: Model) -> list[tuple[str, Spring]]:
    """Return the springs and bearings between a node and ground, with the name of the node."""
    springs = [spring for spring in model.springs.values() if spring.to is None]
    return [(spring.at, spring) for spring in springs if spring.at in model.mesh.points]


def _divide(model: Model, members: list[str], nodes: IntArray, parts: int) -> tuple[Beams, DofMap, Triplets]:
    """Return the divided elements of members, their numbering with supports, and the springs to ground."""
    lines = {name: np.searchsorted(nodes, model.mesh.lines[name]) for name in members}
    springs = _ground_springs(model)
    names = {*model.supports, *(at for at, _ in springs)}
    points = {point: np.flatnonzero(np.isin(nodes, model.mesh.points[point])) for point in names}
    mesh = refine(Mesh(model.mesh.nodes[nodes], lines, points), dict.fromkeys(lines, parts))
    dofs = dof_map(mesh, model.supports.items())
    rows = [
        math.sqrt(spring.stiffness) * dofs.vector(int(node), spring.direction)
        for at, spring in springs
        for node in points[at]
    ]
    guides = np.array(rows).reshape(len(rows), dofs.size)
    return build_beams(mesh, model.members), dofs, Triplets.from_dense(guides.T @ guides)


def _motions_with_hinged_ends(free: FloatArray, ends: NDArray[np.bool_]) -> FloatArray:
    """Return the motions to which free ones are added such that the ends stay in place, shape (n, n).

    A free motion has no strain energy, so it can be chosen to minimize the motion of the ends. Twist does not move the
    ends; the pseudo-inverse omits it.
    """
    tips = free * ends[:, None]
    return np.eye(len(free)) - free @ np.linalg.pinv(free.T @ tips, rcond=_MOTION_TOLERANCE, hermitian=True) @ tips.T


_MOTION_TOLERANCE = 1e-14  # relative square of the ends' motion that counts as zero


def compressed_members(model: Model) -> list[str]:
    """Return the members with a compression channel: all without a cam, and those with geometric stiffness."""
    shafts = set[int]()
    for cam in model.cams.values():
        shafts.update(model.mesh.connected_nodes(model.mesh.node(cam.at), turning=True).tolist())
    return [
        name for name, member in model.members.items()
        if member.geometric_stiffness or shafts.isdisjoint(model.mesh.lines[name].tolist())
    ]  # fmt: skip


def elements_of(structure: Structure, member: str) -> IntArray:
    """Return the positions of a member's elements, shape (e,)."""
    return np.arange(len(structure.beams))[structure.model.mesh.element_ranges()[member]]


@dataclass(frozen=True, eq=False)
class Bars:
    """Some elements as straight bars."""

    structure: Structure
    elements: IntArray  #: indices of the elements, shape (e,)

    @property
    def stiffness(self) -> FloatArray:
        """EA/L, N/m, shape (e,)."""
        beams = self.structure.beams.part(self.elements)
        return beams.EA / beams.length

    def tension(self, moved: FloatArray) -> FloatArray:
        """Return the axial force, N, tension positive, shape (m, e), of displacements of all unknowns, shape (m, n)."""
        ends = (moved[:, numbers] * force for numbers, force in self._ends)
        return sum(ends, np.zeros((len(moved), len(self.elements))))

    @cached_property
    def _ends(self) -> list[tuple[IntArray, FloatArray]]:
        """Unknowns with an effect on the tension, shape (e,), and the tension per unit of each, shape (e,)."""
        beams, dofs = self.structure.beams.part(self.elements), self.structure.dofs
        weights = np.zeros((len(beams), 2, 6))
        weights[..., :3] = self.stiffness[:, None, None] * np.stack([-beams.triads[:, 0], beams.triads[:, 0]], axis=1)
        terms: list[tuple[IntArray, FloatArray]] = []
        for nodes, forces in dofs.lead(beams.nodes, weights):
            numbers = dofs.numbers[nodes]
            active = np.where(numbers >= 0, forces, 0.0)
            terms += [(numbers[:, i, j], active[:, i, j]) for i, j in np.argwhere(active.any(axis=0)).tolist()]
        return terms


def linear_compression(bars: Bars) -> Observable:
    """Return the largest compression of some elements, N, from the motion of their ends along them."""
    thermal = bars.structure.beams.thermal[bars.elements]
    return lambda obs: (thermal - bars.tension(obs.displacement)).max(axis=1)


def arch_laws(arch: Arch) -> list[ForceLaw]:
    """Return the laws of some shallow arches beyond their straight bars and beams, element by element."""
    pulls = np.einsum("eij,ej->ei", arch.shortening, arch.bow)
    parts = zip(arch.axial, arch.shortening, arch.bow, pulls, strict=True)
    return [ForceLaw(ARCH, (float(axial), *g.ravel().tolist(), *bow.tolist(), *pull.tolist()))
            for axial, g, bow, pull in parts]  # fmt: skip


def geometric_stiffness_forces(structure: Structure) -> Coupling:
    """Return the geometric stiffness forces and the compression channels of members."""
    forces: list[LocalForce] = []
    channels: list[Channel] = []
    model = structure.model
    start = 0
    for name in compressed_members(model):
        elements = elements_of(structure, name)
        where = f"members.{name}"
        if model.members[name].geometric_stiffness:
            arch = Arch.of(structure.beams, elements)
            shapes = zip(deformation_matrix(structure.beams, elements), elements.tolist(), strict=True)
            pairs = zip([D @ _local_rows(structure, e) for D, e in shapes], arch_laws(arch), strict=True)
            expansion = structure.beams.thermal[elements] / arch.axial  # a free elongation causes no force
            forces += [
                opposed_force(f"{where}.bending", rows, law, (constant(-free), *_NO_OFFSET))
                for (rows, law), free in zip(pairs, expansion.tolist(), strict=True)
            ]
            compression = _compression(arch, slice(start, start + SCALARS * len(elements)))
            start += SCALARS * len(elements)
        else:
            compression = linear_compression(Bars(structure, elements))
        channels.append(Channel(f"{where}.compression", "N", compression))
        if math.isfinite(limit := buckling_load(model, name)):
            channels.append(Channel(f"{where}.buckling_use", "1", _quotient(compression, limit)))
    return Coupling((), tuple(forces), tuple(channels))


_NO_OFFSET = (constant(0.0),) * (SCALARS - 1)


def _quotient(value: Observable, divisor: float) -> Observable:
    return lambda obs: value(obs) / divisor


def _compression(arch: Arch, scalars: slice) -> Observable:
    stretches = slice(scalars.start, scalars.stop, SCALARS)

    def largest(obs: Observation) -> FloatArray:
        # The force on the elongation is the axial force beyond that of the linear bar.
        return -(arch.axial * obs.penetrations[:, stretches] + obs.forces[:, stretches]).min(axis=-1)

    return largest


def _local_rows(structure: Structure, e: int) -> FloatArray:
    """Return the rows of an element's twelve local components, shape (12, n)."""
    beams, dofs = structure.beams, structure.dofs
    local = np.zeros((12, dofs.size))
    for end, node in zip((0, 6), beams.nodes[e].tolist(), strict=True):
        for k, axis in enumerate(beams.triads[e]):
            local[end + k] = dofs.vector(node, np.concatenate([axis, np.zeros(3)]))
            local[end + 3 + k] = dofs.vector(node, np.concatenate([np.zeros(3), axis]))
    return local


@dataclass(frozen=True)
class MemberStrength:
    """Maximum stress and fatigue safety of a member over a run."""

    von_mises: float  #: largest equivalent stress, Pa
    #: `mean`, `alternating`: at the point of minimum safety, Pa, including torsion as in the equivalent stress
    mean: float
    alternating: float
    #: Goodman's factor; None without material strengths, and without tensile or alternating stress
    safety: float | None
    place: str  #: name of the node
    rated: bool  #: whether the material has strength values


class StrengthSink:
    """Sink that tracks the stresses of every member at the saved instants.

    It stores minimum and maximum normal stress per outline point and torsional stress per section. The outline points
    of a camshaft, which is round, rotate with it: in a whole revolution a constant load bends them back and forth. Mean
    and amplitude are combined as ``sqrt(sigma^2 + 3 tau^2)``, and safety is Goodman's line, with no credit for
    compressive means (torsion has no sign): J. E. Shigley, Mechanical Engineering Design, 9th ed., eqs. 6-46, 6-55 and
    6-56.

    Stresses follow compressions of members and deflections of cams, which are known at every step: `shares` compares
    their maxima at the saved instants with those at all steps.
    """

    def __init__(self, structure: Structure, channels: Sequence[str] = ()) -> None:
        self._structure, self.instants = structure, 0
        self._loads = {name: i for i, name in enumerate(channels) if name.endswith((".compression", ".deflection"))}
        self._peaks = np.zeros((2, len(self._loads)))  # at all steps, and at the saved instants
        mesh, members = structure.model.mesh, structure.model.members
        self._fibres = fibres(list(sections_at_nodes(mesh, members).values()))
        self._spread = element_loads(structure)
        self._normal = self._shear = np.array(np.inf), np.array(-np.inf)  # smallest and largest stress
        self._von_mises = np.zeros((len(structure.beams), 2))
        # cam angles of the last two revolutions, rad, and the maximum von Mises stresses of the members there, Pa
        self._recent = np.zeros(0), np.zeros((0, len(mesh.lines)))
        axes = np.zeros_like(structure.model.mesh.nodes)
        for node, axis in shaft_axes(structure.model).items():
            axes[node] = axis
        #: rotation of each element about its axis per cam angle: 1 or -1 of a camshaft, otherwise 0
        cosine = (structure.beams.triads[:, 0] * axes[structure.beams.nodes[:, 0]]).sum(axis=1)
        self._turns: FloatArray = np.where(np.abs(cosine) > PARALLEL, np.sign(cosine), 0.0)

    def write(self, block: Block) -> None:
        """Update with a block."""
        if self._loads and len(block.channels):
            loads = np.abs(block.channels[:, [*self._loads.values()]])
            saved = loads[np.isin(block.time, block.field_time)]
            self._peaks = np.maximum(self._peaks, [loads.max(axis=0), saved.max(axis=0, initial=0.0)])
        if not len(block.field_time):
            return
        self.instants += len(block.field_time)
        nodal, fields = self._structure.dofs.nodal, block.fields
        forces = section_forces(
            self._structure.beams, nodal(fields.displacement), velocity=nodal(fields.velocity),
            acceleration=nodal(fields.acceleration), damping=self._structure.model.damping, spread=self._spread,
        )  # fmt: skip
        rotated = _rotate_moments(forces, block.field_angle[:, None, None] * self._turns[:, None])
        self._normal = _extend_range(self._normal, self._fibres.normal(rotated))
        self._shear = _extend_range(self._shear, self._fibres.shear(forces))
        stress = self._fibres.von_mises(forces)
        self._von_mises = np.maximum(self._von_mises, stress.max(axis=0))
        ranges = self._structure.model.mesh.element_ranges().values()
        largest = np.column_stack([stress[:, :0, 0], *(stress[:, part].max(axis=(1, 2)) for part in ranges)])
        recent = zip(self._recent, (block.field_angle, largest), strict=True)
        angle, values = (np.concatenate(pair) for pair in recent)
        mask = angle >= angle[-1] - 4.0 * np.pi - _SAME_ANGLE
        self._recent = angle[mask], values[mask]

    def close(self, status: Status, stats: Stats) -> None:
        """Do nothing."""

    def shares(self) -> dict[str, float]:
        """Return the maxima of compressions and deflections at the saved instants over those at all steps."""
        peaks = zip(self._loads, *self._peaks.tolist(), strict=True)
        return {name: saved / largest for name, largest, saved in peaks if largest > 0.0}

    def change(self) -> tuple[str, float, float] | None:
        """Return the member whose maximum von Mises stress changes most from the last but one to the last revolution.

        The two stresses follow, Pa. Members with less than a tenth of the largest stress are left out. None if the
        saved instants of two revolutions are not at the same cam angles.
        """
        angle, stress = self._recent
        passed = angle - angle[-1:] + 2.0 * np.pi
        last = passed > _SAME_ANGLE
        prior = (passed > _SAME_ANGLE - 2.0 * np.pi) & ~last
        if last.sum() != prior.sum() or (np.abs(passed[last] - passed[prior] - 2.0 * np.pi) > _SAME_ANGLE).any():
            return None
        pairs = np.array([stress[prior].max(axis=0, initial=0.0), stress[last].max(axis=0, initial=0.0)])
        larger = pairs.max(axis=0)
        counts = larger > 0.1 * larger.max(initial=0.0)
        if not counts.any():
            return None
        i = int(np.argmax(np.where(counts, np.abs(pairs[1] - pairs[0]) / np.where(counts, larger, 1.0), -1.0)))
        return [*self._structure.model.mesh.element_ranges()][i], float(pairs[0, i]), float(pairs[1, i])

    def members(self) -> dict[str, MemberStrength]:
        """Return the strength results of every member; empty without saved fields."""
        if not self.instants:
            return {}
        (normal, swing), (shear, twist) = _halves(*self._normal), _halves(*self._shear)
        mean, alternating = _equivalent(normal, shear), _equivalent(swing, twist)
        tensile = _equivalent(np.maximum(normal, 0.0), shear)
        ranges = self._structure.model.mesh.element_ranges()
        return {name: self._member(name, part, mean, alternating, tensile) for name, part in ranges.items()}

    def _member(
        self, name: str, part: slice, mean: FloatArray, alternating: FloatArray, tensile: FloatArray
    ) -> MemberStrength:
        model: Model = self._structure.model
        material = model.members[name].material
        m, a = mean[part], alternating[part]
        rated = bool(material.ultimate_strength and material.endurance_limit)
        use = np.zeros_like(m)
        if material.ultimate_strength and material.endurance_limit:
            use = a / material.endurance_limit + tensile[part] / material.ultimate_strength
        maximum = float(use.max())
        ranked = use if maximum > 0.0 else a + np.abs(m)
        element, end, fibre = np.unravel_index(int(np.argmax(ranked)), ranked.shape)
        return MemberStrength(
            von_mises=float(self._von_mises[part].max()),
            mean=float(m[element, end, fibre]),
            alternating=float(a[element, end, fibre]),
            safety=1.0 / maximum if maximum > 0.0 else None,
            place=model.mesh.node_name(int(model.mesh.lines[name][element + end])),
            rated=rated,
        )


_SAME_ANGLE = 1e-5  # difference of cam angles that is rounding, rad


def _rotate_moments(forces: FloatArray, angle: FloatArray) -> FloatArray:
    """Return section forces whose bending moments are about axes rotated by an angle, rad."""
    rotated, (y, z) = forces.copy(), (forces[..., 4], forces[..., 5])
    rotated[..., 4] = y * np.cos(angle) + z * np.sin(angle)
    rotated[..., 5] = z * np.cos(angle) - y * np.sin(angle)
    return rotated


def _extend_range(bounds: tuple[FloatArray, FloatArray], values: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.minimum(bounds[0], values.min(axis=0)), np.maximum(bounds[1], values.max(axis=0))


def _halves(minimum: FloatArray, maximum: FloatArray) -> tuple[FloatArray, FloatArray]:
    return 0.5 * (maximum + minimum), 0.5 * (maximum - minimum)


def _equivalent(normal: FloatArray, shear: FloatArray) -> FloatArray:
    """Return the equivalent stress with the sign of the normal one, shape (e, 2, f)."""
    size = np.sqrt(normal**2 + 3.0 * shear[..., None] ** 2)
    return np.where(normal < 0.0, -size, size)
