"""Tables of springs: wire, coils, force tables and pulsation."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from flexcam import valvetrain
from flexcam.case.curves import read_force_table
from flexcam.case.schema.base import (
    DIRECTION,
    AxisDamping,
    Density,
    DirectionValue,
    Flag,
    Force,
    Length,
    MassValue,
    Name,
    PartRecord,
    PositiveNumber,
    PositiveStiffness,
    Ratio,
    Record,
    SignedAngle,
    Stress,
    Unit,
    value_error,
)
from flexcam.fem.dofs import direction
from flexcam.valvetrain.springs import Coils, coil_spring, install_spring

# Default ratio of the stiffness of touching coils to that of the spring part between them: flexcam's choice.
_COIL_CONTACT_RATIO = 50.0
_WAHL = "Wahl's factor is not valid below that"


def _without_default(schema: dict[str, Any]) -> None:
    """Remove the default from the JSON schema of a key whose default depends on other keys."""
    del schema["default"]


class WireRecord(Record):
    """Wire of a coil spring, for its stress and its default stiffness."""

    diameter: Length
    coil_diameter: Length | None = Field(
        None, description="mean diameter of the coil; required unless the spring has `coils`"
    )
    active_coils: PositiveNumber | None = Field(
        None, description="number of active coils; gives the stiffness of the spring with shear_modulus"
    )
    shear_modulus: Stress | None = Field(None, description="needed with active_coils and with `coils` of the spring")
    density: Density | None = Field(None, description="gives the mass of a spring with `coils`")

    def _check(self) -> None:
        if self.coil_diameter is not None and self.coil_diameter < 2.0 * self.diameter:
            raise value_error("at least twice the wire diameter", _WAHL, inside="coil_diameter")
        if self.active_coils is not None and self.shear_modulus is None:
            raise value_error("active_coils and shear_modulus together, or neither", "the stiffness follows from both")

    @property
    def coil(self) -> valvetrain.Wire | None:
        """Wire with the diameter of its coil; None if the spring has its coils."""
        return None if self.coil_diameter is None else valvetrain.Wire(self.diameter, self.coil_diameter)

    @property
    def rate(self) -> float | None:
        """Stiffness of the spring, N/m; None without a number of coils."""
        if self.coil is None or self.active_coils is None or self.shear_modulus is None:
            return None
        return self.coil.rate(self.shear_modulus, self.active_coils)


class CoilsRecord(PartRecord[Coils]):
    """Adjacent active coils of a spring with equal pitch."""

    turns: PositiveNumber = Field(description="number of coils")
    diameter: Length | tuple[Length, Length] = Field(description="mean diameter of the coils; two values for a taper")
    pitch: Length = Field(description="rise per coil in the free spring")

    def build(self) -> Coils:
        """Build the coils."""
        ends = self.diameter if isinstance(self.diameter, tuple) else (self.diameter, self.diameter)
        return Coils(self.turns, ends, self.pitch)


_Rows = Annotated[list[tuple[Annotated[float, Unit("length")], Force]], Field(min_length=2)]
_ForceTable = Annotated[_Rows, BeforeValidator(read_force_table, json_schema_input_type=str | _Rows)]


class PulsationRecord(PartRecord[valvetrain.Pulsation]):
    """Variation of a stiffness with the cam angle."""

    order: PositiveNumber = Field(description="periods per camshaft revolution")
    amplitude: Ratio = Field(description='fraction of the mean stiffness, such as "10 %"; below 1')
    phase: SignedAngle = 0.0
    kind = valvetrain.Pulsation

    def _check(self) -> None:
        super()._check()
        if self.amplitude >= 1.0:
            raise value_error("an amplitude below 1", "the stiffness must not change its sign")


class SpringRecord(PartRecord[valvetrain.Spring]):
    """Spring and damper along one direction, to ground or to another point."""

    at: Name = Field(description="name of a point")
    to: Name | None = Field(None, description="point at the other end; ground by default")
    direction: DirectionValue = Field(description=DIRECTION)
    stiffness: Annotated[float, Unit("stiffness", axis="rotational stiffness")] = Field(
        0.0, description="N/m, or N m/rad about an axis"
    )
    damping: AxisDamping = Field(0.0, description="N s/m, or N m s/rad about an axis")
    link: Flag = Field(
        False, description="the spring represents a part of the train; the rigid model treats it as rigid"
    )
    installed_force: Force | None = Field(None, description="preload, which pushes the point opposite to `direction`")
    installed_compression: Length | None = Field(
        None, description="compression from the free to the installed length, instead of installed_force"
    )
    force_table: _ForceTable | None = Field(
        None,
        description="rows of travel (from the free length) and force, or a file with the columns travel and force, "
        "instead of stiffness",
    )
    coils: list[CoilsRecord] | None = Field(
        None,
        min_length=1,
        description="tables { turns, diameter, pitch }, from the fixed to the moving end; they replace stiffness and "
        "require wire",
    )
    mass: MassValue = Field(0.0, description="mass, distributed over the length")
    elements: int = Field(
        1, ge=1, le=1000, strict=True,
        description="number of equal elements of the spring, or of each entry of `coils`; by default 1, or 4 to 16 in "
        "all for a spring with mass",
        json_schema_extra=_without_default,
    )  # fmt: skip
    clash_travel: Length | None = Field(
        None, description="travel along `direction` from the installed length to coil bind"
    )
    clash_stiffness: PositiveStiffness | None = Field(
        None, description="contact stiffness between adjacent elements; by default 50 times the stiffness of an element"
    )
    pulsation: PulsationRecord | None = None
    wire: WireRecord | None = None

    @property
    def active_coils(self) -> float | None:
        """Number of active coils of one diameter; None if it is not given or their diameters differ."""
        if self.coils is None:
            return self.wire and self.wire.active_coils
        diameters = {end for entry in self.coils for end in entry.part.ends}
        return sum(entry.turns for entry in self.coils) if len(diameters) == 1 else None

    def _check(self) -> None:
        """Check the keys that define the force, then that the spring can be built, then keys that exclude others."""
        if self.force_table is not None or self.coils is not None:
            self._check_force("coils" if self.force_table is None else "force_table")
        if self.force_table is not None:
            self._check_table(self.force_table)
        if self.coils is not None:
            self._check_coils(self.coils)
        elif self.wire is not None:
            self._check_wire(self.wire)
        super()._check()
        if self.coils is not None and (self.part.clash_travel or 0.0) <= 0.0:
            key = "installed_force" if self.installed_compression is None else "installed_compression"
            why = "a solid spring has no travel left"
            raise value_error("an installed position before all coils touch", why, inside=key)
        if self.wire is not None and not direction(self.direction)[:3].any():
            why = "its stress and stiffness are those of a coil in compression"
            raise value_error("a direction along a line with wire", why)
        if self.wire is not None and self.wire.active_coils is not None and self.stiffness:
            allowed = "either stiffness, or active_coils and shear_modulus of the wire"
            raise value_error(allowed, "both define the stiffness")
        if self.installed_force is not None and self.installed_compression is not None:
            allowed = "either installed_force or installed_compression"
            raise value_error(allowed, "one determines the other", given="both")
        if self.link and (self.to is None or self.installed_force or self.installed_compression):
            why = "it joins two points as a part of the train does"
            raise value_error("a link with an end `to` and no preload", why)
        if self.clash_travel is not None and not self.part.stiffness:
            allowed, why = "a stiffness above zero", "clash_travel needs the stiffness of the spring"
            raise value_error(allowed, why, inside="stiffness", given="nothing")

    @staticmethod
    def _check_wire(wire: WireRecord) -> None:
        if wire.coil_diameter is None:
            why, remedy = "the key is required unless the spring has the key coils", "add 'coil_diameter'"
            raise value_error("a length", why, remedy, inside="wire.coil_diameter", given="nothing")
        if wire.active_coils is None and wire.shear_modulus is not None:
            why = "the stiffness follows from both"
            raise value_error("no shear_modulus without active_coils or coils", why, inside="wire")
        if wire.density is not None:
            allowed, why = "a density of the wire only with coils", "the mass follows from their length"
            raise value_error(allowed, why, "give the mass")

    def _check_coils(self, entries: list[CoilsRecord]) -> None:
        wire = self.wire
        if wire is None or wire.shear_modulus is None:
            raise value_error("a wire with diameter and shear_modulus with coils", "the stiffness follows from both")
        if wire.coil_diameter is not None or self.clash_travel is not None:
            why = "the diameter and pitch of each entry of coils define both"
            raise value_error("coils without clash_travel and wire.coil_diameter", why)
        if wire.density is not None and self.mass:
            raise value_error("either a mass or a density of the wire", "both define the mass")
        for i, coils in enumerate(entry.part for entry in entries):
            if min(coils.ends) < 2.0 * wire.diameter:
                given, allowed = f"{1e3 * min(coils.ends):g} mm", "twice the diameter of the wire or more"
                raise value_error(allowed, _WAHL, inside=f"coils.{i}.diameter", given=given)
            if coils.gap(wire.diameter) <= 0.0:
                allowed = f"a pitch above {1e3 * (coils.pitch - coils.gap(wire.diameter)):g} mm"
                why = "these coils touch each other in the free spring"
                raise value_error(allowed, why, inside=f"coils.{i}.pitch", given=f"{1e3 * coils.pitch:g} mm")

    def _check_table(self, rows: list[tuple[float, float]]) -> None:
        if any(x1 <= x0 or f1 <= f0 for (x0, f0), (x1, f1) in pairwise(rows)):
            allowed, why = "rows of increasing travel and force", "a spring pushes back more the more it is compressed"
            raise value_error(allowed, why, "sort them, and smooth their noise", inside="force_table")
        start, force = self.installed_compression or 0.0, self.installed_force
        (minimum, weakest), (maximum, strongest) = rows[0], rows[-1]
        if not (minimum <= start <= maximum if force is None else weakest <= force <= strongest):
            place, why = f"the installed_force, {force:g} N", f"its forces reach from {weakest:g} to {strongest:g} N"
            if force is None:
                place = f"the installed position, {1e3 * start:g} mm"
                why = f"its travels reach from {1e3 * minimum:g} to {1e3 * maximum:g} mm"
            raise value_error(f"a table that covers {place}", why, inside="force_table")

    def _check_force(self, key: str) -> None:
        """Check the keys that a force table or coils exclude."""
        if self.force_table is not None and self.coils is not None:
            raise value_error("either force_table or coils", "both define the force")
        if not direction(self.direction)[:3].any():
            raise value_error(f"a direction along a line with {key}", "it has travels and forces")
        if self.stiffness or (self.wire is not None and self.wire.active_coils is not None):
            raise value_error(f"either {key} or a stiffness", f"the stiffness follows from {key}")
        if self.pulsation is not None or self.link:
            raise value_error(f"{key} without pulsation and link", "these need a constant stiffness")

    def build(self) -> valvetrain.Spring:
        """Build the spring."""
        vector = direction(self.direction)
        wire, stiffness = self.wire and self.wire.coil, self.stiffness or (self.wire and self.wire.rate) or 0.0
        clash = self.clash_stiffness or _COIL_CONTACT_RATIO * self.elements * stiffness
        force = self.installed_force
        if self.installed_compression is not None:
            force = stiffness * self.installed_compression
        spring = valvetrain.Spring(
            self.at, vector, stiffness, self.damping, self.to, force, self.mass, self.elements,
            self.clash_travel, clash, wire, self.pulsation and self.pulsation.part, self.link,
        )  # fmt: skip
        place = self.installed_force, self.installed_compression
        if self.force_table is not None:
            spring = install_spring(replace(spring, table=tuple(self.force_table)), *place)
            clash = self.clash_stiffness or _COIL_CONTACT_RATIO * self.elements * spring.stiffness
            return replace(spring, clash_stiffness=clash)
        if self.coils is not None and self.wire is not None:
            coils, modulus = [entry.part for entry in self.coils], self.wire.shear_modulus or 0.0
            spring = coil_spring(spring, coils, self.wire.diameter, modulus, self.wire.density)
            clash = self.clash_stiffness or _COIL_CONTACT_RATIO * max(part.stiffness for part in spring.parts)
            return install_spring(replace(spring, clash_stiffness=clash), *place)
        return spring
