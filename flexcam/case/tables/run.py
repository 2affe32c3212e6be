"""Tables of the run: damping, integrator, start, output."""

from __future__ import annotations

from typing import Annotated, Literal, cast

from pydantic import Field, ValidationInfo, field_validator

from flexcam import integrate
from flexcam.case import quantity as q
from flexcam.case.tables.base import Gravity, Name, PartRecord, Record
from flexcam.fem import Damping


class DampingRecord(PartRecord[Damping]):
    """Damping of the whole structure."""

    alpha: Annotated[float, q.Unit("rate")] = Field(0.0, description="Rayleigh factor of the mass")
    beta: Annotated[float, q.Unit("time")] = Field(0.0, description="Rayleigh factor of the stiffness")
    modal: q.Ratio = Field(0.0, description="damping ratio of every mode")

    def made(self) -> Damping:
        """Return the damping."""
        return Damping(self.alpha, self.beta, self.modal)


class NewmarkRecord(PartRecord[integrate.Scheme]):
    """Newmark's scheme; the default is the average acceleration."""

    method: Literal["newmark"] = "newmark"
    beta: q.PositiveNumber = 0.25
    gamma: q.PositiveNumber = 0.5

    def made(self) -> integrate.Scheme:
        """Return the scheme."""
        return integrate.newmark(beta=self.beta, gamma=self.gamma)


class HhtRecord(PartRecord[integrate.Scheme]):
    """Scheme of Hilber, Hughes and Taylor."""

    method: Literal["hht"]
    alpha: q.SignedNumber = -0.05

    def made(self) -> integrate.Scheme:
        """Return the scheme."""
        return integrate.hht(alpha=self.alpha)


class GeneralizedAlphaRecord(PartRecord[integrate.Scheme]):
    """Generalized-alpha scheme."""

    method: Literal["generalized-alpha"]
    rho_inf: q.Ratio = 0.9

    def made(self) -> integrate.Scheme:
        """Return the scheme."""
        return integrate.generalized_alpha(rho_inf=self.rho_inf)


IntegratorRecord = Annotated[NewmarkRecord | HhtRecord | GeneralizedAlphaRecord, Field(discriminator="method")]


class ResultStartRecord(Record):
    """Start from the last state of an earlier run of the same model."""

    result: str = Field(description="result file, relative to the case file")


class GivenStartRecord(Record):
    """Start from given displacements and velocities; what is not named is zero."""

    displacement: dict[str, float] = Field(default={}, description='"point.component" to length or angle')
    velocity: dict[str, float] = Field(default={}, description='"point.component" to velocity or angular speed')

    @field_validator("displacement", "velocity", mode="before")
    @classmethod
    def _in_their_units(cls, value: object, info: ValidationInfo) -> object:
        """Return SI by component; what is no table is left to pydantic."""
        if not isinstance(value, dict):
            return value
        table = cast("dict[str, object]", value)
        units = {"displacement": ("length", "angle"), "velocity": ("velocity", "speed")}[info.field_name or ""]
        return {
            name: q.Unit(units[name.rpartition(".")[2].startswith("r")], signed=True).validate(one)
            for name, one in table.items()
        }


class RunRecord(Record):
    """How the mechanism is run."""

    speed: q.Speed | None = Field(None, description="camshaft speed")
    crank_speed: q.Speed | None = Field(None, description="crankshaft speed, twice the camshaft's")
    revolutions: q.PositiveNumber = Field(2.0, description="of the camshaft")
    steps_per_revolution: int | None = Field(
        None, ge=1, le=100_000_000, strict=True, description="3600 where no step is given"
    )
    step: q.Time | None = Field(None, description="instead of steps_per_revolution")
    start: Literal["rest", "equilibrium"] | ResultStartRecord | GivenStartRecord = Field(
        "rest",
        description="at rest as installed, in static equilibrium, or from a given state",
        union_mode="left_to_right",
    )
    gravity: Gravity = Field(
        (0.0, 0.0, 0.0), description="acceleration, global axes; masses at a rocker's point are left out"
    )
    integrator: IntegratorRecord = Field(default_factory=NewmarkRecord)
    damping: DampingRecord = Field(default_factory=lambda: DampingRecord.model_validate({}))


def _without_doubles(names: list[str]) -> list[str]:
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise q.refused("every point once", f"{twice[0]!r} is listed {names.count(twice[0])} times", "remove it")
    return names


class OutputRecord(Record):
    """What is saved."""

    probes: list[Name] = Field(default=[], description="points kept at every step")
    _listed_once = field_validator("probes")(_without_doubles)
    field_every: int = Field(20, ge=1, le=1_000_000_000, strict=True, description="steps between saved fields")
