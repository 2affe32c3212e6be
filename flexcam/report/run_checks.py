"""Checks during and after a run: extremes, resolution, energy balance and cam profiles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from flexcam.analysis.model_checks import (
    check_coil_bind,
    check_connectivity,
    check_loads,
    check_open_contacts,
    check_overshoot,
    check_shared_seat_load,
    check_start_impact,
)
from flexcam.analysis.preparation import PreparedRun
from flexcam.cams import Follower, profile_at, undercut
from flexcam.case.input_checks import check_values
from flexcam.core import FloatArray, rounding_fraction
from flexcam.core.errors import InputError
from flexcam.dynamics import Block, Response, Sink, Stats, newmark, outline
from flexcam.dynamics.memory import ExtremesSink
from flexcam.valvetrain import (
    BOUNCE_HEIGHT,
    OPEN,
    Cam,
    CamContact,
    Metric,
    Model,
    ModelModes,
    PublishedLoad,
    Resolution,
    ResolutionSink,
    build_structure,
    coarse_cams,
    compressed_members,
    member_masses,
    stiff_struts,
)


@dataclass(frozen=True, eq=False)
class RunMonitor:
    """Sinks that collect the data for checks of a run."""

    extremes: ExtremesSink  # minimum and maximum of all quantities
    fineness: ResolutionSink  # resolution of the motion by steps and elements

    @classmethod
    def of(cls, ready: PreparedRun) -> Self:
        """Return the sinks for a future run."""
        names = outline(ready.problem.system, channels=ready.save.channels)
        watching = ResolutionSink(build_structure(ready.model), ready.problem.system, names, ready.problem.step)
        return cls(ExtremesSink(names), watching)

    @classmethod
    def from_response(cls, ready: PreparedRun, response: Response) -> Self:
        """Return the sinks for a finished run, from its histories."""
        made = cls.of(ready)
        rows = [response.channels[name] for name, _ in response.outline.channels]
        channels = np.column_stack(rows) if rows else np.zeros((len(response.time), 0))
        saved = response.field_time, response.field_angle, response.fields
        block = Block(response.time, response.angle, response.probes, channels, *saved)
        for sink in made.sinks:
            sink.write(block)
        return made

    @property
    def sinks(self) -> tuple[Sink, Sink]:
        """Sinks for `flexcam.solve`."""
        return self.extremes, self.fineness


def check_events(figures: Iterable[Metric]) -> list[str]:
    """Return warnings about events of the last revolution that a train must not have."""
    known = list(figures)
    return [
        *_contact_loss_warnings(known),
        *_bounce_warnings(known),
        *_coil_clash_warnings(known),
        *_buckling_warnings(known),
    ]


def describe_contact_loss(figures: Iterable[Metric]) -> str:
    """Describe which followers lost contact with their cams, and for how long."""
    told = _metrics_with_suffix(figures, ".open_on_the_lift")
    return ", ".join(f"{name!r} left it for {math.degrees(open_):.2g} deg" for name, open_ in told if open_ > OPEN)


def _contact_loss_warnings(figures: Iterable[Metric]) -> list[str]:
    return [
        f"Warning: the follower of {name!r} leaves its cam for {math.degrees(angle):.3g} deg on the lift: "
        f"what follows is no valve event to design by"
        for name, angle in _metrics_with_suffix(figures, ".open_on_the_lift")
        if angle > OPEN
    ]


def _bounce_warnings(figures: list[Metric]) -> list[str]:
    times = dict(_metrics_with_suffix(figures, ".bounces"))
    return [
        f"Warning: the valve bounces {_format_count(times[name])} at {name!r}, to {1e3 * height:.3g} mm above its seat"
        for name, height in _metrics_with_suffix(figures, ".bounce_height")
        if height > BOUNCE_HEIGHT
    ]


def _format_count(times: float) -> str:
    return "once" if times == 1.0 else f"{times:.0f} times"


def _coil_clash_warnings(figures: Iterable[Metric]) -> list[str]:
    return [
        f"Warning: coils of {name!r} touch: {-1e3 * clearance:.3g} mm beyond closed"
        for name, clearance in _metrics_with_suffix(figures, ".clearance.least")
        if clearance < 0.0
    ]


def _buckling_warnings(figures: Iterable[Metric]) -> list[str]:
    return [
        f"Warning: member {name!r} bears more than its buckling load, margin {margin:.4g}: "
        f"a straight member bends without end"
        for name, margin in _metrics_with_suffix(figures, ".buckling_margin")
        if margin < 1.0
    ]


def _metrics_with_suffix(figures: Iterable[Metric], end: str) -> Iterator[tuple[str, float]]:
    """Yield name of the part and value of the metrics with a given suffix."""
    for figure in figures:
        if figure.name.endswith(end):
            yield figure.name.removesuffix(end).partition(".")[2], figure.value


_ANGLES = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
"""Cam angles at which a profile is evaluated."""

_SAME_LOBE_ANGLE = 1.0
"""Angle between two lifts, deg, up to which they may be the same lobe."""

_SHAFT_RADIUS_RATIO = 1.0 + 1e-9
"""Ratio of shaft radius to base radius from which the shaft is thicker; equal radii are valid."""


def check_lobes(model: Model) -> list[str]:
    """Return warnings about impossible lobes, and about rotating bodies modelled without rotation."""
    known = [(name, cam, cam.follower) for name, cam in model.cams.items() if cam.follower is not None]
    lobes = [one for name, cam, follower in known for one in _lobe_warnings(model, name, cam, follower)]
    return [*lobes, *_check_shared_lobes(model), *dict.fromkeys(_check_body_inertia(model))]


_MIN_ENERGY_SHARE = 0.01
"""Energy share in the shaft's bending from which an unsymmetric inertia is reported: flexcam's choice."""


def _check_body_inertia(model: Model) -> Iterator[str]:
    """Yield the bodies that rotate with a shaft and have different moments of inertia about its transverse axes.

    In a half wave of bending over a shaft of length L and mass m, the difference of both has ``2 (pi/L)^2 dJ/m`` of the
    kinetic energy: slopes are pi/L times the deflection, and the mean of the squared half wave is 1/2.
    """
    own = member_masses(model)
    for contact in model.cam_contacts.values():
        nodes = model.mesh.connected_nodes(model.mesh.node(model.cams[contact.cam].at))
        length = float(np.ptp(model.mesh.nodes[nodes] @ contact.shaft_axis))
        mass = sum(own[name] for name, line in model.mesh.lines.items() if np.isin(line, nodes).any())
        for name, part in model.masses.items():
            at = model.mesh.points.get(part.at, np.empty(0, dtype=int))
            apart = (
                _transverse_inertia_difference(part.body.matrix()[3:, 3:], contact.shaft_axis)
                if np.isin(at, nodes).any()
                else 0.0
            )
            if 2.0 * math.pi**2 * apart > _MIN_ENERGY_SHARE * mass * length**2:
                given = f"its inertias across the shaft are {apart:.3g} kg m^2 apart and turn with it"
                yield f"Warning: masses.{name}: {given}; they are taken as still: give the mean of both"


def _transverse_inertia_difference(inertia: FloatArray, axis: FloatArray) -> float:
    """Return the difference of the maximum and minimum moment of inertia about axes perpendicular to a given one."""
    square = np.eye(3) - np.outer(axis, axis)
    values = np.linalg.eigvalsh(square @ inertia @ square + 2.0 * np.trace(inertia) * np.outer(axis, axis))
    return float(values[1] - values[0])


def _check_shared_lobes(model: Model) -> Iterator[str]:
    """Yield the cams with followers on different sides of the shaft that lift at the same cam angle."""
    first: dict[str, PublishedLoad | CamContact] = {}
    for one in model.cam_contacts.values():
        other = first.setdefault(one.cam, one)
        later = _lift_angle(other, one)
        if min(later, 360.0 - later) > _SAME_LOBE_ANGLE:
            why = f"it lifts {other.follower} and {one.follower} at one cam angle, and a lobe reaches the second"
            remedy = f"give {one.follower} a cam of its own with a phase greater by that"
            yield f"Warning: cams.{one.cam}: {why} {later:.4g} deg later; {remedy}"


def _lift_angle(one: PublishedLoad | CamContact, other: PublishedLoad | CamContact) -> float:
    """Return the angle from one lift direction to another in the direction of rotation, deg, from 0 to 360."""
    a, b = one.direction[:3], other.direction[:3]
    return math.degrees(math.atan2(float(np.cross(a, b) @ one.shaft_axis), float(a @ b))) % 360.0


def _lobe_warnings(model: Model, name: str, cam: Cam, follower: Follower) -> Iterator[str]:
    if _check_undercut(cam, follower):
        why = "its profile would cross itself (undercut), so that no cam makes the lift of this run"
        yield f"Warning: cams.{name}: {why}; flexcam cam says which base circle is enough"
    shaft = _shaft_radius(model, cam)
    if shaft > _SHAFT_RADIUS_RATIO * follower.base_radius:
        sizes = f"its base circle has a radius of {1e3 * follower.base_radius:.4g} mm, its shaft one of"
        yield f"Warning: cams.{name}: {sizes} {1e3 * shaft:.4g} mm: the follower would run on the shaft"


def _check_undercut(cam: Cam, follower: Follower) -> bool:
    try:
        radius = profile_at(cam.event, follower, _ANGLES, cam.turn).radius
    except InputError:  # no profile exists: code that needs it raises the error
        return False
    return bool(undercut(radius, follower).any())


def _shaft_radius(model: Model, cam: Cam) -> float:
    """Return the radius of the round shaft of a cam, m; zero if there is none."""
    node = model.mesh.points.get(cam.at, np.empty(0, dtype=int))
    lines, members = model.mesh.lines, model.members
    sections = [one.section for name, one in members.items() if np.isin(node, lines[name]).any()]
    return max((one.radius for one in sections if one.round), default=0.0)


_MIN_DEFLECTION_ERROR = 1e-4
"""Relative size of a deflection from which it is reported: tables show four digits."""

_LEAST_STEPS = 20
"""Minimum steps per period: with fewer, common integrators have a period error of more than a percent."""

_LEAST_ELEMENTS = 4
"""Minimum elements per bending wave: with fewer, cubic elements have a frequency error of more than half a percent."""

_LEAST_IMPACT = 5
"""Minimum steps per impact: with fewer, the true maximum force may exceed the computed one by a twentieth."""

_MAX_RESIDUAL = 0.01
"""Allowed residual relative to the largest force: some integrators satisfy equilibrium between the instants."""

_MAX_ENERGY_RESIDUAL = 0.01
"""Allowed residual of the energy balance and numerical dissipation, relative to the work."""


def check_modes(modes: ModelModes) -> list[str]:
    """Return warnings about modes."""
    return [sentence for sentence in (modes.modes.describe_rounding(),) if sentence]


def check_cam_steps(ready: PreparedRun) -> list[str]:
    """Return warnings about cams that the steps of a run do not resolve."""
    turn = ready.case.speed * ready.problem.step
    return [
        f"Warning: too few steps per revolution, {2.0 * math.pi / turn:.4g}: between two of them the lift of cam "
        f"{one.cam} departs from a straight line by up to {100.0 * one.missed:.3g} % of it; take {one.enough} or more"
        for one in coarse_cams(ready.model, turn)
    ]


def check_input(ready: PreparedRun) -> list[str]:
    """Return warnings about a case: implausible numbers, impossible lobes, parts without effect, open contacts."""
    standing = [
        *check_open_contacts(ready.model, ready.problem, ready.scheme),
        *check_start_impact(ready.case, ready.model, ready.problem),
    ]
    standing += check_overshoot(ready.problem, ready.scheme)
    idle = [*check_connectivity(ready.model), *check_loads(ready.model, ready.problem)]
    rigid = (
        []
        if ready.problem.system.size
        else [one(ready.model, ready.case.speed) for one in (check_shared_seat_load, check_coil_bind)]
    )
    untold = [sentence for told in rigid for sentence in told]
    coarse = [*check_cam_steps(ready), *_check_geometric_stiffness(ready)]
    return [*check_values(ready.case), *check_lobes(ready.model), *idle, *standing, *untold, *coarse]


def _check_geometric_stiffness(ready: PreparedRun) -> list[str]:
    """Return the members with too few elements for their geometric stiffness."""
    return [
        f"Warning: too few elements in member {one.member} for its geometric stiffness: "
        f"{_describe_buckling_margin(one.excess)}; take {one.elements}"
        for one in (stiff_struts(ready.model) if _has_member_dofs(ready) else [])
    ]


def _describe_buckling_margin(excess: float) -> str:
    if math.isinf(excess):
        return "its supports leave no node that could bend it"
    return f"before it bends away it bears {100.0 * excess:.2g} % more than its buckling load"


def check_run(ready: PreparedRun, watched: RunMonitor, figures: list[Metric], stats: Stats) -> list[str]:
    """Return warnings about a run."""
    found = [
        *check_input(ready),
        *describe_model_limits(ready),
        *check_events(figures),
        *_check_energy_balance(watched.extremes),
    ]
    found += [
        *_check_numerical_dissipation(ready, watched.extremes),
        *_check_equilibrium(stats),
        *_check_rounding(ready, watched.extremes),
    ]
    return found + _check_resolution(watched.fineness.found()) if _has_member_dofs(ready) else found


def describe_model_limits(ready: PreparedRun) -> list[str]:
    """Return sentences about the limits of a rigid or lumped model."""
    if ready.case.record.fidelity.model == "rigid":
        return ["Warning: rigid members know nothing of what they bear: do not read stresses and section forces off"]
    if ready.case.record.fidelity.model == "beams":
        return []
    left = "the camshaft but what its contacts feel, of surging springs and of bending"
    return [
        f"Warning: masses in the place of members know nothing of {left}: do not read twist, torque and stresses off",
        *_check_compression(ready),
    ]


def _check_compression(ready: PreparedRun) -> list[str]:
    """Return the members whose compression a lumped model does not compute."""
    told = {channel.name for channel in ready.problem.system.channels}
    missing = [name for name in compressed_members(ready.model) if f"members.{name}.compression" not in told]
    if not missing:
        return []
    why = "no mass stands behind, so that springs would be all that is borne, and nothing of the inertia there"
    remedy = 'take fidelity.model = "chain" with two masses or more'
    return [f"Warning: compression and buckling of {', '.join(missing)} are not told: {why}; {remedy}"]


def _check_rounding(ready: PreparedRun, extremes: ExtremesSink) -> list[str]:
    if not extremes.most_bent.any() or not ready.problem.system.size:
        return []
    share = rounding_fraction(ready.problem.system.stiffness, extremes.most_bent)
    if share <= _MIN_DEFLECTION_ERROR:
        return []
    return [f"Warning: rounding in the stiffness may have taken up to {100.0 * share:.1g} % of the deflection"]


def energy_residual(extremes: ExtremesSink) -> float:
    """Return the residual of the energy balance, relative to its terms."""
    return abs(_largest_share(extremes, "residual"))


def numerical_dissipation(extremes: ExtremesSink) -> float:
    """Return the relative numerical dissipation of the time integration; negative if it adds energy."""
    return _largest_share(extremes, "numerical")


def _largest_share(extremes: ExtremesSink, part: str) -> float:
    """Return the maximum of a term of the energy balance relative to the largest range of work and stored energies."""
    bounds = (extremes.channel(f"energy.{name}") for name in ("work", "kinetic", "strain"))
    turned_over = max(largest - least for least, largest in bounds)
    return max(extremes.channel(f"energy.{part}"), key=abs) / turned_over if turned_over > 0.0 else 0.0


def describe_balance(extremes: ExtremesSink, stats: Stats) -> str:
    """Return a sentence about the energy balance and the equilibrium residual of a run."""
    if not extremes.energies:
        return ""
    forces = f"forces within {stats.imbalance:.1e} of the largest" if stats.imbalance >= 0.0 else "forces not looked at"
    residual, numerical = energy_residual(extremes), numerical_dissipation(extremes)
    return f"residual {residual:.1e}, numerical dissipation {numerical:.2g} of the external work; {forces}"


def _has_member_dofs(ready: PreparedRun) -> bool:
    """Return whether a run has the degrees of freedom of its members."""
    return ready.case.record.fidelity.model == "beams" and ready.problem.system.size > 0


def _check_resolution(found: Resolution) -> list[str]:
    """Return warnings about insufficient resolution by steps and elements."""
    at = f"at the {found.frequency:.4g} Hz of the accelerations"
    more = math.ceil(10.0 * _LEAST_STEPS / found.steps) / 10.0
    steps = f"Warning: a period has {found.steps:.3g} steps {at}; take {more:.2g} times as many"
    elements = [
        f"Warning: a wave of bending of member {name} has {count:.2g} of its elements {at}; "
        f"take {math.ceil(_LEAST_ELEMENTS / count)} times as many"
        for name, count in found.elements.items()
        if count < _LEAST_ELEMENTS
    ]
    impacts = [
        f"Warning: the largest force of contact {name} is that of an impact of {count} step{'s' if count > 1 else ''}: "
        f"take more steps per revolution, or a softer contact"
        for name, count in found.impacts.items()
        if count < _LEAST_IMPACT
    ]
    return [*([steps] if found.steps < _LEAST_STEPS else []), *elements, *impacts]


def _check_equilibrium(stats: Stats) -> list[str]:
    if stats.imbalance <= _MAX_RESIDUAL:
        return []
    why = "the steps are too long for the motion; take more steps per revolution"
    return [f"Warning: forces are out of balance by up to {100.0 * stats.imbalance:.2g} % of the largest: {why}"]


def _check_energy_balance(extremes: ExtremesSink) -> list[str]:
    """Return a warning if the energy balance of a run has a large residual."""
    share = energy_residual(extremes)
    if share <= _MAX_ENERGY_RESIDUAL:
        return []
    why = "the steps are too long for what happens within them, or a contact is too stiff for them"
    return [f"Warning: {100.0 * share:.2g} % of the energy does not add up: {why}; take more steps per revolution"]


def _check_numerical_dissipation(ready: PreparedRun, extremes: ExtremesSink) -> list[str]:
    """Return a warning if the time integration dissipates or adds significant energy."""
    share = numerical_dissipation(extremes)
    if abs(share) <= _MAX_ENERGY_RESIDUAL:
        return []
    does = "dissipates" if share > 0.0 else "adds"
    other = "" if ready.scheme == newmark() else ', or integrator = { method = "newmark" }'
    told = f"{100.0 * abs(share):.2g} % of the external work: the steps are too long for what happens within them"
    return [f"Warning: the time integration {does} {told}; take more steps per revolution{other}"]
