"""Tables of materials, sections, members, masses, bearings, friction, loads and rockers."""

from __future__ import annotations

from dataclasses import replace
from math import tau
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from flexcam import valvetrain
from flexcam.case.curves import LoadValue, MatrixValue
from flexcam.case.schema.base import (
    DIRECTION,
    AxisDamping,
    Component,
    DampingValue,
    DirectionValue,
    Flag,
    Inertia,
    Length,
    LineValue,
    MassValue,
    Name,
    PartRecord,
    Point,
    Position,
    PositiveNumber,
    PositiveStiffness,
    Record,
    SecondMoment,
    SignedAngle,
    SignedNumber,
    Stiffness,
    Stress,
    Unit,
    Vector,
    Viscosity,
    value_error,
)
from flexcam.core import FloatArray
from flexcam.core.errors import refuse
from flexcam.fem.dofs import COMPONENTS, direction
from flexcam.fem.rigid_bodies import PointMass
from flexcam.fem.sections import Material, Section, Taper


def _check_poisson_ratio(nu: float) -> float:
    if not -1.0 < nu <= 0.5:
        raise value_error("a value above -1 and up to 0.5", "the shear modulus E/(2(1+nu)) must be positive")
    return nu


class MaterialRecord(PartRecord[Material]):
    """Isotropic material."""

    E: Stress = Field(description="Young's modulus")
    nu: Annotated[SignedNumber, AfterValidator(_check_poisson_ratio)] = Field(
        description="Poisson's ratio, above -1 and up to 0.5"
    )
    density: Annotated[float, Unit("density")] = Field(description="mass per volume")
    ultimate_strength: Stress | None = Field(None, description="for the margin against fatigue")
    endurance_limit: Stress | None = Field(
        None, description="stress amplitude for unlimited life, for the margin against fatigue"
    )
    expansion: Annotated[float, Unit("thermal expansion")] = Field(
        0.0, description="coefficient of linear thermal expansion"
    )
    kind = Material


_Thickness = Annotated[float, Unit("length")]
_EndLengths = Annotated[
    Length | tuple[Length, Length],
    Field(description="one value, or two in brackets for a tapered member (first and last node)"),
]


class _SectionRecord(PartRecord[Section | Taper]):
    J: SecondMoment | None = Field(None, description="torsion constant")
    kappa_y: PositiveNumber | None = Field(None, description="shear factor along local y")
    kappa_z: PositiveNumber | None = Field(None, description="shear factor along local z")

    def build(self) -> Section | Taper:
        """Build the section, with the given torsion constant and shear factors."""
        keys = (key for key in type(self).model_fields if key not in ("J", "kappa_y", "kappa_z", "shape"))
        sizes: list[float | tuple[float, float]] = [getattr(self, key) for key in keys]
        start, end = (tuple(size[i] if isinstance(size, tuple) else size for size in sizes) for i in (0, 1))
        properties = {key: value for key in ("J", "kappa_y", "kappa_z") if (value := getattr(self, key)) is not None}
        if start == end:
            return replace(self.kind(*start), **properties)
        if self.J is not None:
            raise refuse("J", f"{self.J:g} m^4", "no J of a tapered section", "it varies over the length")
        return Taper(self.kind, start, end, properties)


class CircleRecord(_SectionRecord):
    """Solid round section."""

    shape: Literal["circle"]
    diameter: _EndLengths
    kind = Section.circle


class TubeRecord(_SectionRecord):
    """Round tube."""

    shape: Literal["tube"]
    outer_diameter: _EndLengths
    inner_diameter: Annotated[
        _Thickness | tuple[_Thickness, _Thickness],
        Field(description="one value, or two in brackets for a tapered member"),
    ]
    kind = Section.tube


class RectangleRecord(_SectionRecord):
    """Rectangle with sides along local y and z."""

    shape: Literal["rectangle"]
    width_y: _EndLengths
    width_z: _EndLengths
    kind = Section.rectangle


class CustomRecord(_SectionRecord):
    """Section given by its properties."""

    shape: Literal["custom"]
    A: Annotated[float, Unit("area", above=True)]
    Iy: SecondMoment
    Iz: SecondMoment
    J: SecondMoment  # pyright: ignore[reportIncompatibleVariableOverride, reportGeneralTypeIssues]
    fibre_y: Length | None = Field(
        None,
        description="distance of the extreme fibre along local y; by default twice the radius of gyration, too small "
        "for open profiles",
    )
    fibre_z: Length | None = Field(None, description="as fibre_y, along local z")
    torsion_arm: Length | None = Field(
        None, description="c of the torsional shear stress T c/J; by default twice the smaller fibre distance"
    )

    def build(self) -> Section:
        """Build the section."""
        fibres = (self.fibre_y or 0.0, self.fibre_z or 0.0, self.torsion_arm or 0.0)
        kappas = self.kappa_y or 1.0, self.kappa_z or 1.0
        return Section(self.A, self.Iy, self.Iz, self.J, *kappas, *fibres)


SectionRecord = Annotated[CircleRecord | TubeRecord | RectangleRecord | CustomRecord, Field(discriminator="shape")]


class MemberRecord(Record):
    """Beam along a line group of the mesh or a chain of named nodes."""

    material: Name = Field(description="name of a material")
    section: Name = Field(description="name of a section")
    nodes: list[Name] | None = Field(
        None, min_length=2, description="named nodes along the member (without a mesh file)"
    )
    elements: int = Field(
        1, ge=1, le=1_000_000, strict=True, description="number of equal elements in each span between two nodes"
    )
    orientation: Vector | None = Field(None, description="vector in the local x-y plane, global axes")
    shear: Flag = Field(False, description="shear deformation (Timoshenko)")
    rotary_inertia: Flag = Field(True, description="rotary inertia of the sections in bending")
    mass: Literal["consistent", "lumped"] = "consistent"
    geometric_stiffness: Flag = Field(False, description="couple axial force and bending during a run")
    bow: Position = Field(0.0, description="height of an initial half-wave bow in the local x-y plane")
    temperature: Annotated[float, Unit("temperature", signed=True)] = Field(
        0.0, description="temperature rise since assembly; needs `expansion` of the material"
    )

    def _check(self) -> None:
        if self.bow and not self.geometric_stiffness:
            raise value_error("geometric_stiffness = true", "a bow has no effect without it", inside="bow")


_Product = Annotated[float, Unit("inertia", signed=True)]


class MassRecord(PartRecord[valvetrain.MassAt]):
    """Rigid body at a point."""

    at: Name = Field(description="name of a point")
    mass: MassValue
    inertia: tuple[Inertia, Inertia, Inertia] = Field(
        (0.0, 0.0, 0.0), description="moments of inertia about the centre of mass, global axes"
    )
    offset: Point = Field((0.0, 0.0, 0.0), description="offset from the node to the centre of mass, global axes")
    products: tuple[_Product, _Product, _Product] = Field(
        (0.0, 0.0, 0.0),
        description="products of inertia about the centre of mass (integrals of xy, xz and yz over the mass), global "
        "axes",
    )

    def build(self) -> valvetrain.MassAt:
        """Build the body and its position."""
        return valvetrain.MassAt(self.at, PointMass(self.mass, self.inertia, self.offset, self.products))


_MatrixFile = Annotated[
    MatrixValue,
    Field(description="a matrix file, or { file = ..., matrix = ... } for one matrix of a Nastran punch file"),
]


class SuperelementRecord(Record):
    """Elastic body given by matrices from another program, in global axes."""

    nodes: dict[Annotated[str, Field(pattern=r"^[1-9][0-9]*$")], Name] = Field(
        min_length=2, description='node numbers in the files and names of the nodes: { 12 = "left", 31 = "right" }'
    )
    units: Literal["m-kg-s", "mm-t-s"] = Field(description="units of the files")
    stiffness: _MatrixFile
    mass: _MatrixFile
    damping: _MatrixFile | None = None
    modes: int | None = Field(
        None, ge=0, strict=True, description="number of fixed-interface modes, at most 200; all by default"
    )

    def matrices(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return mass, stiffness and damping in SI, the rows of the interface nodes first."""
        matrices = [file.matrix for file in (self.mass, self.stiffness, self.damping) if file is not None]
        rows = sorted({label for matrix in matrices for label in matrix.labels})
        known, interface = {node for node, _ in rows}, [int(node) for node in self.nodes]
        if missing := [str(node) for node in interface if node not in known]:
            allowed = f"nodes of the matrices, {min(known)} to {max(known)}"
            raise refuse("nodes", ", ".join(missing), allowed, "the files have no entry of them")
        order = [(node, dof) for node in interface for dof in range(1, 7)]
        order += [row for row in rows if row[0] not in interface]
        # in mm-t-s a displacement has 1000 times its number of metres, and an energy of 1 is a millijoule
        length, energy = (1e3, 1e-3) if self.units == "mm-t-s" else (1.0, 1.0)
        scale = np.array([length if dof <= 3 else 1.0 for _, dof in order])
        mass, stiffness, *damping = (energy * np.outer(scale, scale) * matrix.ordered(order) for matrix in matrices)
        return mass, stiffness, damping[0] if damping else 0.0 * mass


class RigidLinkRecord(Record):
    """Massless rigid connection: dependent nodes follow an independent node in all or some components."""

    start: Name = Field(alias="from", description="name of the independent node")
    to: list[Name] = Field(min_length=1, description="names of the dependent nodes, which may coincide with it")
    components: list[Component] = Field(
        default=[*COMPONENTS],
        min_length=1,
        description="connected components, in global axes; translations alone make a ball joint",
    )


class FilmRecord(Record):
    """Oil film of a journal bearing, by the theory of the short bearing."""

    diameter: Length = Field(description="diameter of the journal")
    length: Length = Field(description="length of the bearing along the shaft")
    radial_clearance: Length
    viscosity: Viscosity = Field(description="dynamic viscosity of the oil in the film")


class BearingRecord(Record):
    """Bearing perpendicular to the shaft: isotropic stiffness and damping, or an oil film."""

    at: Name = Field(description="name of a point")
    stiffness: Stiffness | None = None
    damping: DampingValue = 0.0
    film: FilmRecord | None = None

    def _check(self) -> None:
        if (self.stiffness is None) == (self.film is None):
            raise value_error("either stiffness or film", "a bearing is elastic or has an oil film")
        if self.film is not None and self.damping:
            raise value_error("damping with stiffness", "the film has its own damping", inside="damping")


_FrictionForce = Annotated[float, Unit("force", axis="moment")]
_SlidingSpeed = Annotated[float, Unit("velocity", above=True, axis="speed")]


class FrictionRecord(Record):
    """Friction of a guide, seal or pivot (against ground or between two points) or between nested springs."""

    at: Name | None = Field(None, description="name of the point that slides")
    to: Name | None = Field(None, description="other point; ground by default")
    direction: DirectionValue | None = Field(None, description="direction in which the point slides")
    spring: Name | None = Field(None, description="inner spring or damper of a nest, instead of at and direction")
    inside: Name | None = Field(None, description="outer spring of the nest, with the same ends")
    force: _FrictionForce | None = Field(
        None, description="Coulomb friction force in N, or moment in N m about an axis"
    )
    coefficient: Annotated[float, Unit("number", above=True, most=2.0)] | None = Field(
        None, description="Coulomb coefficient of nested springs with interference, instead of force"
    )
    interference: Length | None = Field(
        None, description="radial interference, with coefficient; by default from the diameters"
    )
    breakaway_force: _FrictionForce | None = Field(
        None, description="force at which sliding begins; equal to `force` by default"
    )
    stribeck_speed: _SlidingSpeed = Field(
        0.1,
        description="speed over which friction falls from the breakaway force to `force`, m/s, or rad/s about an axis",
    )
    friction_speed: _SlidingSpeed = Field(
        0.01, description="velocity v0 of the regularized friction tanh(v/v0), m/s, or rad/s about an axis"
    )
    damping: AxisDamping = Field(0.0, description="viscous friction, N s/m, or N m s/rad about an axis")

    def _check(self) -> None:
        slide, coils = (self.at, self.direction), (self.spring, self.inside)
        required, excluded = (slide, coils) if self.at is not None else (coils, (*slide, self.to))
        if None in required or any(value is not None for value in excluded):
            why = "friction acts at a point or between the coils of two springs"
            raise value_error("either the keys 'at' and 'direction', or 'spring' and 'inside'", why)
        if self.force is None and (self.coefficient is None or self.spring is None):
            allowed, why = "a force, or for a nest with interference a coefficient", "the friction follows from it"
            raise value_error(allowed, why, inside="force", given="nothing")
        if self.force is not None and (self.coefficient is not None or self.interference is not None):
            raise value_error("either force, or coefficient and interference", "both define the friction")
        if self.force is None and self.breakaway_force is not None:
            why = "with a coefficient, sliding begins at the same force"
            raise value_error("no breakaway_force with coefficient", why, inside="breakaway_force")
        if self.force is not None and self.breakaway_force is not None and self.breakaway_force < self.force:
            about = self.direction is not None and not direction(self.direction)[:3].any()
            allowed = f"at least `force`, {self.force:g} {'N m' if about else 'N'}"
            why = "the breakaway force cannot be below the sliding friction"
            raise value_error(allowed, why, inside="breakaway_force")


class LoadRecord(PartRecord[valvetrain.GivenLoad]):
    """Load at a point (constant or from a table), or constant load distributed over a member."""

    at: Name | None = Field(None, description="point of application")
    member: Name | None = Field(None, description="member over which the load is distributed")
    direction: DirectionValue = Field(description=DIRECTION)
    force: Annotated[float, Unit("force", signed=True, axis="moment")] | None = Field(
        None, description="constant force in N, or moment in N m about an axis"
    )
    force_per_length: Annotated[float, Unit("stiffness", signed=True)] | None = Field(
        None, description="constant force per length of the member"
    )
    table: LoadValue | None = Field(
        None, description="file with the force, moment or pressure over cam angle, crank angle or time"
    )
    area: Annotated[float, Unit("area", above=True)] | None = Field(
        None, description="area on which the pressure of a table acts"
    )
    phase: SignedAngle | None = Field(None, description="cam angle at which a table over an angle has its zero")
    repeat: bool | None = Field(
        None,
        strict=True,
        description="whether the table repeats; by default a table over an angle repeats each revolution, a table "
        "over time does not",
    )

    def _check(self) -> None:
        super()._check()
        distributed = self.force_per_length is not None
        sizes = sum(value is not None for value in (self.force, self.table, self.force_per_length))
        if self.at is not None and self.member is None and not sizes:
            raise value_error("'force' or 'table' as well", "one of them gives the size of the load")
        if sizes != 1 or (self.member is not None) != distributed or (self.at is None) != distributed:
            allowed = "either 'at' with one of 'force' and 'table', or 'member' with 'force_per_length'"
            raise value_error(allowed, "a load acts at a point or along a member")
        if distributed and direction(self.direction)[3:].any():
            allowed, why = "a component such as 'uy' or '-uy', or three numbers", "a moment cannot be distributed"
            raise value_error(allowed, why, "give moments at points with 'at' and 'force'", inside="direction")
        for key in ("area", "phase", "repeat") if self.table is None else ():
            if getattr(self, key) is not None:
                allowed, why = "table together with this key", "the key describes a table"
                raise value_error(allowed, why, "add table", inside=key)

    def build(self) -> valvetrain.GivenLoad:
        """Build the load."""
        vector = direction(self.direction)
        if self.table is not None:
            unit = "N" if vector[:3].any() else "N m"
            table = self.table.build(unit, self.area, self.phase, self.repeat)
            return valvetrain.GivenLoad(table, vector, self.at)
        size = self.force if self.force is not None else self.force_per_length
        return valvetrain.GivenLoad(size or 0.0, vector, self.at, self.member)


_DefinedPoint = Annotated[Name, Field(description="name of the point that the rocker moves with `from`, not reversed")]
_Arms = Annotated[tuple[Length, Length], Field(description="lengths of the arms at `from` and at `to`")]
_DrivenDirection = Annotated[
    LineValue | None, Field(description="direction of motion at `from`; by default along the member there")
]


class LumpedRecord(Record):
    """Rocker without bending: the motion at `to` is the motion at `from` times the ratio of the arms."""

    model: Literal["lumped"]
    start: Name = Field(alias="from", description="name of the driving node")
    to: _DefinedPoint
    arms: _Arms
    inertia: Inertia = Field(0.0, description="moment of inertia about the rocker's shaft")
    direction: _DrivenDirection = None


class LeverRecord(Record):
    """Rocker or finger follower with finite rotation: its ratio depends on its angle, and its arms are elastic."""

    model: Literal["lever"]
    start: Name = Field(
        alias="from", description="name of the driving node; for a finger that the cam touches, a new name"
    )
    to: _DefinedPoint
    arms: _Arms
    angles: tuple[SignedAngle, SignedAngle] = Field(
        (0.0, 0.0),
        description="angles of both arms as installed; 0 if an arm is perpendicular to the motion of its end",
    )
    inertia: Annotated[float, Unit("inertia", above=True)] = Field(
        description="moment of inertia about the lever's axis"
    )
    stiffness: PositiveStiffness = Field(description="stiffness of the arm at `to`")
    damping: DampingValue = Field(0.0, description="damping of the arm at `to`")
    drive_stiffness: PositiveStiffness | None = Field(
        None, description="stiffness of the arm at `from`, if a node drives the lever; equal to `stiffness` by default"
    )
    drive_damping: DampingValue = Field(0.0, description="damping of the arm at `from`, if a node drives the lever")
    direction: _DrivenDirection = None


RockerRecord = Annotated[LumpedRecord | LeverRecord, Field(discriminator="model")]


class RepeatRecord(Record):
    """Copies of the parts whose names contain the mark, such as ``{cylinder}`` for the table `[repeat.cylinder]`."""

    names: list[Name] = Field(
        default=[], description="names that replace the mark; by default the numbers of the firing order"
    )
    spacing: Point | None = Field(None, description="offset from each copy to the next, global axes")
    offsets: list[Point] | None = Field(
        None, description="offset of every copy from the given nodes, instead of spacing"
    )
    firing_order: str | None = Field(
        None, description="firing order of the whole engine, with equal intervals over one camshaft revolution",
        examples=["1-3-4-2"],
    )  # fmt: skip
    phases: list[SignedAngle] | None = Field(
        None, description="delay of every copy in cam angle, instead of firing_order"
    )

    def _check(self) -> None:
        names = self.copy_names
        if not names or len(set(names)) < len(names):
            allowed = "names, or a firing_order" if not names else "each name once"
            why = "each copy needs its own name"
            raise value_error(allowed, why, inside="names", given=", ".join(names) or "nothing")
        for key, other in (("offsets", "spacing"), ("phases", "firing_order")):
            values = getattr(self, key)
            if values is not None and getattr(self, other) is not None:
                raise value_error(f"either {key} or {other}", given=f"{key} and {other}")
            if values is not None and len(values) != len(names):
                raise value_error(f"{len(names)}, one for each name", inside=key, given=f"{len(values)} values")
        missing = [name for name in names if self.firing_order is not None and name not in self._order]
        if missing or len(set(self._order)) < len(self._order):
            allowed = f"an order such as '1-3-4-2' that contains {', '.join(names)} once"
            raise value_error(allowed, inside="firing_order", given=repr(self.firing_order))

    @property
    def copy_names(self) -> list[str]:
        """Names of the copies."""
        return self.names or sorted(self._order, key=lambda name: (len(name), name))

    def copies(self) -> list[tuple[str, Point, float]]:
        """Return name, offset, m, and delay, rad of cam angle, of every copy."""
        step, order = self.spacing or (0.0, 0.0, 0.0), self._order
        copies: list[tuple[str, Point, float]] = []
        for i, name in enumerate(self.copy_names):
            offset = self.offsets[i] if self.offsets else (i * step[0], i * step[1], i * step[2])
            phase = self.phases[i] if self.phases else tau * order.index(name) / len(order) if order else 0.0
            copies.append((name, offset, phase))
        return copies

    @property
    def _order(self) -> list[str]:
        return [name.strip() for name in self.firing_order.split("-")] if self.firing_order is not None else []
