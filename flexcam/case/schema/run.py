"""Tables of a run: model fidelity, damping, integrators, initial state, speed fluctuation and output."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, cast

from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator

from flexcam import dynamics
from flexcam.case.schema.base import (
    CamshaftSpeed,
    Count,
    CrankshaftSpeed,
    Flag,
    Gravity,
    MassValue,
    Name,
    PartRecord,
    PositiveNumber,
    Ratio,
    Record,
    SignedAngle,
    SignedNumber,
    Time,
    Tolerance,
    Unit,
    value_error,
)
from flexcam.fem.assembly import Damping


class ToleranceRecord(Record):
    """Allowed error of each quantity in `fidelity.norm`, relative to its maximum; no limit for absent quantities."""

    lift: Tolerance | None = None
    velocity: Tolerance | None = None
    acceleration: Tolerance | None = None
    force: Tolerance | None = Field(None, description="force of every contact")

    def _check(self) -> None:
        if not self.by_quantity():
            raise value_error("at least one of lift, velocity, acceleration, force", "an empty table limits nothing")

    def by_quantity(self) -> dict[str, float]:
        """Return the given tolerances by quantity."""
        every = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: float(value) for name, value in every.items() if value is not None}


class FidelityRecord(Record):
    """Model of the case and the degrees of freedom to integrate."""

    model: Literal["beams", "rigid", "sdof", "chain"] = Field(
        "beams", description="flexible members, rigid members, one mass for the train, or a chain of masses"
    )
    masses: int = Field(
        3, ge=1, le=1000, strict=True, description="number of masses of a chain, at nodes along its train"
    )
    tolerance: Tolerance | ToleranceRecord | None = Field(
        None,
        description='maximum error of the lift, such as "1 %", or a table by quantity; flexcam then runs the cheapest '
        "model within it",
        union_mode="left_to_right",
    )
    norm: Literal["max", "rms"] | None = Field(
        None,
        description="norm of the errors of `tolerance` and `trade`: maximum or root mean square (rms); by default "
        "max for forces and rms for motions",
    )
    estimate: Flag = Field(False, description="estimate the errors by runs with other steps and elements")
    prune: Flag = Field(True, description="omit inactive degrees of freedom, for the same results in less time")
    modes: Count | None = Field(
        None, description="number of modes to integrate, with static correction; by default all degrees of freedom"
    )
    reduction: Literal["modes", "craig-bampton"] = Field(
        "modes",
        description="modes of the whole train, or Craig-Bampton modes of each part between loads, probes and contacts",
    )

    def _check(self) -> None:
        if self.tolerance is not None and self.model != "beams":
            raise value_error("either model or tolerance", "a tolerance chooses the model")
        if self.reduction != "modes" and self.modes is None:
            raise value_error("modes with a reduction", "the reduction needs their number")
        if self.modes is not None and self.model != "beams":
            raise value_error("model = beams with modes", "the other models have no modes")

    @property
    def tolerances(self) -> dict[str, float]:
        """Tolerance by quantity; empty if none is given."""
        if self.tolerance is None:
            return {}
        return self.tolerance.by_quantity() if isinstance(self.tolerance, ToleranceRecord) else {"lift": self.tolerance}


class DampingRecord(PartRecord[Damping]):
    """Damping of the whole structure."""

    alpha: Annotated[float, Unit("rate")] = Field(0.0, description="Rayleigh factor of the mass")
    beta: Annotated[float, Unit("time")] = Field(0.0, description="Rayleigh factor of the stiffness")
    modal: Ratio = Field(0.0, description="damping ratio of every mode")
    kind = Damping


class NewmarkRecord(PartRecord[dynamics.Scheme]):
    """Newmark method; the default is the average acceleration."""

    method: Literal["newmark"] = "newmark"
    beta: PositiveNumber = 0.25
    gamma: PositiveNumber = 0.5
    kind = dynamics.newmark


class HhtRecord(PartRecord[dynamics.Scheme]):
    """Hilber-Hughes-Taylor method."""

    method: Literal["hht"]
    alpha: SignedNumber = -0.05
    kind = dynamics.hht


class GeneralizedAlphaRecord(PartRecord[dynamics.Scheme]):
    """Generalized-alpha method."""

    method: Literal["generalized-alpha"]
    rho_inf: Ratio = 0.9
    kind = dynamics.generalized_alpha


class BatheRecord(PartRecord[dynamics.Method]):
    """Composite method of Bathe with two stages and no parameter; high frequencies vanish within a step."""

    method: Literal["bathe"]
    kind = dynamics.bathe


class CollocationRecord(PartRecord[dynamics.Method]):
    """Exponential collocation: exact for the linear structure, fourth order in contact forces."""

    method: Literal["collocation"]
    kind = dynamics.collocation


class CentralDifferenceRecord(PartRecord[dynamics.Method]):
    """Explicit central difference method, for members with mass = "lumped"; the highest frequency limits the step."""

    method: Literal["central-difference"]
    kind = dynamics.central_difference


class ScipyReferenceRecord(PartRecord[dynamics.Method]):
    """Integrators of scipy, to check small models; slow, with an accuracy set by the tolerance."""

    method: Literal["radau", "dop853"]
    tolerance: Annotated[float, Field(ge=1e-13, le=1e-2)] = Field(1e-9, description="relative local error")

    def build(self) -> dynamics.Method:
        """Build the method."""
        make = dynamics.radau if self.method == "radau" else dynamics.dop853
        return make(tolerance=self.tolerance)


IntegratorRecord = Annotated[
    NewmarkRecord
    | HhtRecord
    | GeneralizedAlphaRecord
    | CollocationRecord
    | BatheRecord
    | CentralDifferenceRecord
    | ScipyReferenceRecord,
    Field(discriminator="method"),
]


class ResultStartRecord(Record):
    """Start from the last state of an earlier run of the same model."""

    result: str = Field(description="result file, relative to the case file")


class GivenStartRecord(Record):
    """Start from given displacements and velocities; all others are zero."""

    displacement: dict[str, float] = Field(default={}, description='"point.component" = length or angle')
    velocity: dict[str, float] = Field(default={}, description='"point.component" = velocity or angular velocity')

    @field_validator("displacement", "velocity", mode="before")
    @classmethod
    def _convert_units(cls, value: object, info: ValidationInfo) -> object:
        """Return SI by component; values other than tables are left to pydantic."""
        if not isinstance(value, dict):
            return value
        table = cast("dict[str, object]", value)
        units = {"displacement": ("length", "angle"), "velocity": ("velocity", "speed")}[info.field_name or ""]
        return {
            name: Unit(units[name.rpartition(".")[2] in ("rx", "ry", "rz")], signed=True).validate(item)
            for name, item in table.items()
        }


def _start_tag(value: object) -> str:
    """Return the kind of initial state of a value or record, so that an invalid value gives one fault."""
    if not isinstance(value, dict | Record):
        return "named"
    of_result = "result" in value if isinstance(value, dict) else isinstance(value, ResultStartRecord)
    return "result" if of_result else "given"


StartRecord = Annotated[
    Annotated[Literal["rest", "equilibrium", "periodic"], Tag("named")]
    | Annotated[ResultStartRecord, Tag("result")]
    | Annotated[GivenStartRecord, Tag("given")],
    Discriminator(_start_tag),
]


class FluctuationRecord(Record):
    """Fluctuation of the camshaft speed about its mean, in orders of the camshaft."""

    orders: list[PositiveNumber] = Field(min_length=1, description="periods per camshaft revolution")
    amplitudes: list[Ratio] = Field(description='fractions of the mean speed, such as "2 %"; their sum is below 1')
    phases: list[SignedAngle] = Field(default=[], description="phases of the orders; zero by default")

    def _check(self) -> None:
        if len(self.amplitudes) != len(self.orders) or len(self.phases) not in (0, len(self.orders)):
            raise value_error("as many amplitudes as orders, and as many phases or none", "they belong together")
        if sum(self.amplitudes) >= 1.0:
            raise value_error("amplitudes with a sum below 1", "the shaft must keep turning")


class FreeRunningRecord(Record):
    """Speed of a freely rotating cam by the model of Petrescu, in which its moment of inertia changes with the lift."""

    cam: Name = Field(description="name of a cam")
    cam_mass: Annotated[float, Unit("mass", above=True)] = Field(description="mass of the cam, as a disc")
    follower_mass: MassValue = Field(description="mass of the follower")


class PhaserRecord(PartRecord[dynamics.Phaser]):
    """Phaser that turns the cams of a shaft relative to their drive."""

    cams: list[Name] = Field(min_length=1, description="names of all cams of the shaft")
    shift: list[tuple[Annotated[float, Unit("angle")], SignedAngle]] = Field(
        min_length=2,
        description="rows of two angles: rotation of the drive since the start, and rotation of the cams ahead of "
        "the drive (positive: advance)",
    )

    def _check(self) -> None:
        if any(later <= angle for (angle, _), (later, _) in pairwise(self.shift)):
            raise value_error("rows of increasing angle", inside="shift")
        super()._check()

    def build(self) -> dynamics.Phaser:
        """Build the phaser."""
        angles, shifts = zip(*self.shift, strict=True)
        return dynamics.Phaser(angles, shifts)


class AdaptiveRecord(PartRecord[dynamics.Adaptive]):
    """Adaptive steps with an error below a tolerance; flexcam saves results at the given steps."""

    tolerance: PositiveNumber = Field(1e-6, description="maximum relative error of a step, in the energy norm")
    smallest: Time | None = Field(None, description="minimum step; by default 2^-16 of the given step")
    kind = dynamics.Adaptive


class RunRecord(Record):
    """Speed, duration, steps, initial state and integrator of a run."""

    speed: CamshaftSpeed = None
    crank_speed: CrankshaftSpeed = None
    revolutions: PositiveNumber = Field(2.0, description="number of camshaft revolutions")
    steps_per_revolution: int | None = Field(
        None, ge=1, le=100_000_000, strict=True, description="number of steps; 3600 by default, unless `step` is given"
    )
    step: Time | None = Field(None, description="time step, instead of steps_per_revolution")
    engine: dynamics.EngineName = Field(
        "auto",
        description="solver engine; auto selects the fastest suitable one; with the same integrator all give the same "
        "numbers, except in chatter",
    )
    adaptive: AdaptiveRecord | None = Field(None, description="step size control; fixed steps by default")
    fluctuation: FluctuationRecord | None = None
    free_running: FreeRunningRecord | None = None
    start: StartRecord = Field(
        "rest", description="at rest as installed, in static equilibrium, in the periodic state, or from a given state"
    )
    gravity: Gravity = Field(
        (0.0, 0.0, 0.0),
        description="components in global axes; masses and springs at output points of rockers have no weight",
    )
    integrator: IntegratorRecord | None = Field(
        None,
        description="by default collocation if forces depend on the motion and steps are fine enough, else newmark",
    )
    damping: DampingRecord = Field(default_factory=lambda: DampingRecord.model_validate({}))

    def _check(self) -> None:
        if self.fluctuation is not None and self.free_running is not None:
            given = "fluctuation and free_running"
            raise value_error("one of fluctuation, free_running", "each defines the speed", given=given)
        orders = self.fluctuation.orders if self.fluctuation else []
        if self.start == "periodic" and any(order != round(order) for order in orders):
            raise value_error("whole orders with start = periodic", "the state repeats with the camshaft")

        if isinstance(self.integrator, CollocationRecord):
            if self.adaptive is not None:
                allowed = "fixed steps with method = collocation"
                raise value_error(allowed, "it has no adaptive steps", "remove adaptive")
            if self.engine not in ("auto", "kernel"):
                raise value_error("the kernel solver engine with method = collocation", "", "remove engine")


class OutputRecord(Record):
    """Saved quantities and instants."""

    probes: list[Name] = Field(default=[], description="points saved at every step")
    reactions: list[Name] = Field(default=[], description="points whose support reactions are saved at every step")
    field_every: int = Field(
        20, ge=1, le=1_000_000_000, strict=True, description="number of steps between saved fields"
    )

    @field_validator("probes", "reactions")
    @classmethod
    def _check_duplicates(cls, names: list[str]) -> list[str]:
        if twice := [name for name in names if names.count(name) > 1]:
            raise value_error("every point once", f"{twice[0]!r} is listed {names.count(twice[0])} times", "remove it")
        return names
