"""Tables of materials, sections and members."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from flexcam.case import quantities as q
from flexcam.case.schema.base import Name, PartRecord, Record, Vector
from flexcam.fem.sections import Material, Section


def _check_poisson_ratio(nu: float) -> float:
    if not -1.0 < nu <= 0.5:
        raise q.value_error("above -1 and up to 0.5", "the shear modulus E/(2(1+nu)) must be positive")
    return nu


class MaterialRecord(PartRecord[Material]):
    """Isotropic material."""

    E: q.Stress = Field(description="Young's modulus")
    nu: Annotated[q.SignedNumber, AfterValidator(_check_poisson_ratio)] = Field(description="Poisson's ratio")
    density: Annotated[float, q.Unit("density")] = Field(description="mass per volume")
    ultimate_strength: q.Stress | None = Field(None, description="for the margin against fatigue")
    endurance_limit: q.Stress | None = Field(
        None, description="amplitude borne for ever, for the margin against fatigue"
    )

    def build(self) -> Material:
        """Build the material."""
        return Material(self.E, self.nu, self.density, self.ultimate_strength, self.endurance_limit)


class _SectionRecord(PartRecord[Section]):
    J: Annotated[float, q.Unit("second moment", above=True)] | None = Field(None, description="torsion constant")
    kappa_y: q.PositiveNumber | None = Field(None, description="shear factor along local y")
    kappa_z: q.PositiveNumber | None = Field(None, description="shear factor along local z")

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        raise NotImplementedError

    def build(self) -> Section:
        """Build the section, with the given torsion constant and shear factors."""
        return self.default_section().given(J=self.J, kappa_y=self.kappa_y, kappa_z=self.kappa_z)


class CircleRecord(_SectionRecord):
    """Solid round section."""

    shape: Literal["circle"]
    diameter: q.Length

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.circle(self.diameter)


class TubeRecord(_SectionRecord):
    """Round tube."""

    shape: Literal["tube"]
    outer_diameter: q.Length
    inner_diameter: Annotated[float, q.Unit("length")]

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.tube(self.outer_diameter, self.inner_diameter)


class RectangleRecord(_SectionRecord):
    """Rectangle with sides along local y and z."""

    shape: Literal["rectangle"]
    width_y: q.Length
    width_z: q.Length

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        return Section.rectangle(self.width_y, self.width_z)


class CustomRecord(_SectionRecord):
    """Section given by its properties."""

    shape: Literal["custom"]
    A: Annotated[float, q.Unit("area", above=True)]
    Iy: Annotated[float, q.Unit("second moment", above=True)]
    Iz: Annotated[float, q.Unit("second moment", above=True)]
    J: Annotated[float, q.Unit("second moment", above=True)]  # pyright: ignore[reportIncompatibleVariableOverride, reportGeneralTypeIssues]
    fibre_y: q.Length | None = Field(
        None,
        description="extreme fibre along local y; twice the radius of gyration by default, too small for open profiles",
    )
    fibre_z: q.Length | None = Field(None, description="extreme fibre along local z; as fibre_y")
    torsion_arm: q.Length | None = Field(
        None, description="c of the torsional shear stress T c/J; twice the smaller fibre distance by default"
    )

    def default_section(self) -> Section:
        """Return the section with the defaults of its shape."""
        fibres = (self.fibre_y or 0.0, self.fibre_z or 0.0, self.torsion_arm or 0.0)
        return Section(self.A, self.Iy, self.Iz, self.J, 1.0, 1.0, *fibres)


SectionRecord = Annotated[CircleRecord | TubeRecord | RectangleRecord | CustomRecord, Field(discriminator="shape")]


class MemberRecord(Record):
    """Material, section and elements of a line group of the mesh or of a chain of named nodes."""

    material: Name
    section: Name
    nodes: list[Name] | None = Field(
        None, min_length=2, description="named nodes along the member (without a mesh file)"
    )
    elements: int = Field(1, ge=1, le=1_000_000, strict=True, description="equal parts of each of its segments")
    orientation: Vector | None = Field(None, description="vector in the local x-y plane, global axes")
    shear: bool = Field(False, strict=True, description="shear deformation (Timoshenko)")
    rotary_inertia: bool = Field(True, strict=True, description="rotary inertia of the sections in bending")
    mass: Literal["consistent", "lumped"] = "consistent"
    geometric_stiffness: bool = Field(
        False, strict=True, description="axial force and bending act on each other within a run"
    )
    bow: q.Position = Field(0.0, description="initial half wave in the local x-y plane, at mid-length")

    @model_validator(mode="after")
    def _check_bow(self) -> Self:
        if self.bow and not self.geometric_stiffness:
            raise q.value_error("bow with geometric_stiffness = true", "without it a bow acts on nothing")
        return self
