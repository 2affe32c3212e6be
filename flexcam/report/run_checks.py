"""Checks during and after a run: extremes, resolution, energy balance and cam profiles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from flexcam.analysis.model_checks import idle_loads, loose, overshot, pressed_shut, shared, struck, unheld
from flexcam.analysis.preparation import Prepared
from flexcam.cams import Follower, profile_at, undercut
from flexcam.case.input_checks import unusual
from flexcam.core import FloatArray, share_lost
from flexcam.core.errors import InputError
from flexcam.dynamics import Block, Response, Sink, Stats, newmark, outline
from flexcam.dynamics.memory import Extremes
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
class Watched:
    """Sinks that collect the data for checks of a run.

    Parameters
    ----------
    extremes
        Minimum and maximum of all quantities.
    fineness
        Resolution of the motion by steps and elements.
    """

    extremes: Extremes
    fineness: ResolutionSink

    @classmethod
    def of(cls, ready: Prepared) -> Self:
        """Return the sinks for a future run."""
        names = outline(ready.problem.system, channels=ready.save.channels)
        watching = ResolutionSink(build_structure(ready.model), ready.problem.system, names, ready.problem.step)
        return cls(Extremes(names), watching)

    @classmethod
    def again(cls, ready: Prepared, response: Response) -> Self:
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


def mishaps(figures: Iterable[Metric]) -> list[str]:
    """Return warnings about events of the last revolution that a train must not have."""
    known = list(figures)
    return [*_left(known), *_bounced(known), *_clashed(known), *_buckled(known)]


def left_words(figures: Iterable[Metric]) -> str:
    """Describe which followers lost contact with their cams, and for how long."""
    told = _found(figures, ".open_on_the_lift")
    return ", ".join(f"{name!r} left it for {math.degrees(open_):.2g} deg" for name, open_ in told if open_ > OPEN)


def _left(figures: Iterable[Metric]) -> list[str]:
    return [
        f"Warning: the follower of {name!r} leaves its cam for {math.degrees(angle):.3g} deg on the lift: "
        f"what follows is no valve event to design by"
        for name, angle in _found(figures, ".open_on_the_lift")
        if angle > OPEN
    ]


def _bounced(figures: list[Metric]) -> list[str]:
    times = dict(_found(figures, ".bounces"))
    return [
        f"Warning: the valve bounces {_often(times[name])} at {name!r}, to {1e3 * height:.3g} mm above its seat"
        for name, height in _found(figures, ".bounce_height")
        if height > BOUNCE_HEIGHT
    ]


def _often(times: float) -> str:
    return "once" if times == 1.0 else f"{times:.0f} times"


def _clashed(figures: Iterable[Metric]) -> list[str]:
    return [
        f"Warning: coils of {name!r} touch: {-1e3 * clearance:.3g} mm beyond closed"
        for name, clearance in _found(figures, ".clearance.least")
        if clearance < 0.0
    ]


def _buckled(figures: Iterable[Metric]) -> list[str]:
    return [
        f"Warning: member {name!r} bears more than its buckling load, margin {margin:.4g}: "
        f"a straight member bends without end"
        for name, margin in _found(figures, ".buckling_margin")
        if margin < 1.0
    ]


def _found(figures: Iterable[Metric], end: str) -> Iterator[tuple[str, float]]:
    """Yield name of the part and value of the metrics with a given suffix."""
    for figure in figures:
        if figure.name.endswith(end):
            yield figure.name.removesuffix(end).partition(".")[2], figure.value


_ANGLES = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
"""Cam angles at which a profile is evaluated."""

_BESIDE = 1.0
"""Angle between two lifts, deg, up to which they may be the same lobe."""

_THICKER = 1.0 + 1e-9
"""Ratio of shaft radius to base radius from which the shaft is thicker; equal radii are valid."""


def lobe_doubts(model: Model) -> list[str]:
    """Return warnings about impossible lobes, and about rotating bodies modelled without rotation."""
    known = [(name, cam, cam.follower) for name, cam in model.cams.items() if cam.follower is not None]
    lobes = [one for name, cam, follower in known for one in _told(model, name, cam, follower)]
    return [*lobes, *_shared(model), *dict.fromkeys(_uneven_bodies(model))]


_FELT = 0.01
"""Energy share in the shaft's bending from which an unsymmetric inertia is reported: flexcam's choice."""


def _uneven_bodies(model: Model) -> Iterator[str]:
    """Yield the bodies that rotate with a shaft and have different moments of inertia about its transverse axes.

    In a half wave of bending over a shaft of length L and mass m, the difference of both has ``2 (pi/L)^2 dJ/m`` of the
    kinetic energy: slopes are pi/L times the deflection, and the mean of the squared half wave is 1/2.
    """
    own = member_masses(model)
    for contact in model.driven.values():
        nodes = model.mesh.connected(model.mesh.node(model.cams[contact.cam].at))
        length = float(np.ptp(model.mesh.nodes[nodes] @ contact.shaft_axis))
        mass = sum(own[name] for name, line in model.mesh.lines.items() if np.isin(line, nodes).any())
        for name, part in model.masses.items():
            at = model.mesh.points.get(part.at, np.empty(0, dtype=int))
            apart = _across(part.body.matrix()[3:, 3:], contact.shaft_axis) if np.isin(at, nodes).any() else 0.0
            if 2.0 * math.pi**2 * apart > _FELT * mass * length**2:
                given = f"its inertias across the shaft are {apart:.3g} kg m^2 apart and turn with it"
                yield f"Warning: masses.{name}: {given}; they are taken as still: give the mean of both"


def _across(inertia: FloatArray, axis: FloatArray) -> float:
    """Return the difference of the maximum and minimum moment of inertia about axes perpendicular to a given one."""
    square = np.eye(3) - np.outer(axis, axis)
    values = np.linalg.eigvalsh(square @ inertia @ square + 2.0 * np.trace(inertia) * np.outer(axis, axis))
    return float(values[1] - values[0])


def _shared(model: Model) -> Iterator[str]:
    """Yield the cams with followers on different sides of the shaft that lift at the same cam angle."""
    first: dict[str, PublishedLoad | CamContact] = {}
    for one in model.driven.values():
        other = first.setdefault(one.cam, one)
        later = _turn(other, one)
        if min(later, 360.0 - later) > _BESIDE:
            why = f"it lifts {other.follower} and {one.follower} at one cam angle, and a lobe reaches the second"
            remedy = f"give {one.follower} a cam of its own with a phase greater by that"
            yield f"Warning: cams.{one.cam}: {why} {later:.4g} deg later; {remedy}"


def _turn(one: PublishedLoad | CamContact, other: PublishedLoad | CamContact) -> float:
    """Return the angle from one lift direction to another in the direction of rotation, deg, from 0 to 360."""
    a, b = one.direction[:3], other.direction[:3]
    return math.degrees(math.atan2(float(np.cross(a, b) @ one.shaft_axis), float(a @ b))) % 360.0


def _told(model: Model, name: str, cam: Cam, follower: Follower) -> Iterator[str]:
    if _undercut(cam, follower):
        why = "its profile would cross itself (undercut), so that no cam makes the lift of this run"
        yield f"Warning: cams.{name}: {why}; flexcam cam says which base circle is enough"
    shaft = _shaft_radius(model, cam)
    if shaft > _THICKER * follower.base_radius:
        sizes = f"its base circle has a radius of {1e3 * follower.base_radius:.4g} mm, its shaft one of"
        yield f"Warning: cams.{name}: {sizes} {1e3 * shaft:.4g} mm: the follower would run on the shaft"


def _undercut(cam: Cam, follower: Follower) -> bool:
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


_WORTH_TELLING = 1e-4
"""Relative size of a deflection from which it is reported: tables show four digits."""

_LEAST_STEPS = 20
"""Minimum steps per period: with fewer, common integrators have a period error of more than a percent."""

_LEAST_ELEMENTS = 4
"""Minimum elements per bending wave: with fewer, cubic elements have a frequency error of more than half a percent."""

_LEAST_IMPACT = 5
"""Minimum steps per impact: with fewer, the true maximum force may exceed the computed one by a twentieth."""

_UNBALANCED = 0.01
"""Allowed residual relative to the largest force: some integrators satisfy equilibrium between the instants."""

_UNACCOUNTED = 0.01
"""Allowed residual of the energy balance and numerical dissipation, relative to the work."""


def doubts(modes: ModelModes) -> list[str]:
    """Return warnings about modes."""
    return [sentence for sentence in (modes.modes.doubt(),) if sentence]


def coarse_steps(ready: Prepared) -> list[str]:
    """Return warnings about cams that the steps of a run do not resolve."""
    turn = ready.case.speed * ready.problem.step
    return [
        f"Warning: too few steps per revolution, {2.0 * math.pi / turn:.4g}: between two of them the lift of cam "
        f"{one.cam} departs from a straight line by up to {100.0 * one.missed:.3g} % of it; take {one.enough} or more"
        for one in coarse_cams(ready.model, turn)
    ]


def input_doubts(ready: Prepared) -> list[str]:
    """Return warnings about a case: implausible numbers, impossible lobes, parts without effect, open contacts."""
    standing = [*unheld(ready.model, ready.problem, ready.scheme), *struck(ready.case, ready.model, ready.problem)]
    standing += overshot(ready.problem, ready.scheme)
    idle = [*loose(ready.model), *idle_loads(ready.model, ready.problem)]
    rigid = [] if ready.problem.system.size else [one(ready.model, ready.case.speed) for one in (shared, pressed_shut)]
    untold = [sentence for told in rigid for sentence in told]
    coarse = [*coarse_steps(ready), *_stiff(ready)]
    return [*unusual(ready.case), *lobe_doubts(ready.model), *idle, *standing, *untold, *coarse]


def _stiff(ready: Prepared) -> list[str]:
    """Return the members with too few elements for their geometric stiffness."""
    return [
        f"Warning: too few elements in member {one.member} for its geometric stiffness: {_borne(one.excess)}; "
        f"take {one.elements}"
        for one in (stiff_struts(ready.model) if _bodies(ready) else [])
    ]


def _borne(excess: float) -> str:
    if math.isinf(excess):
        return "its supports leave no node that could bend it"
    return f"before it bends away it bears {100.0 * excess:.2g} % more than its buckling load"


def run_doubts(ready: Prepared, watched: Watched, figures: list[Metric], stats: Stats) -> list[str]:
    """Return warnings about a run."""
    found = [*input_doubts(ready), *unseen(ready), *mishaps(figures), *_unaccounted(watched.extremes)]
    found += [*_integrated_away(ready, watched.extremes), *_unbalanced(stats), *_rounded(ready, watched.extremes)]
    return found + _coarse(watched.fineness.found()) if _bodies(ready) else found


def unseen(ready: Prepared) -> list[str]:
    """Return sentences about the limits of a rigid or lumped model."""
    if ready.case.record.fidelity.model == "rigid":
        return ["Warning: rigid members know nothing of what they bear: do not read stresses and section forces off"]
    if ready.case.record.fidelity.model == "beams":
        return []
    left = "the camshaft but what its contacts feel, of surging springs and of bending"
    return [
        f"Warning: masses in the place of members know nothing of {left}: do not read twist, torque and stresses off",
        *_unfelt(ready),
    ]


def _unfelt(ready: Prepared) -> list[str]:
    """Return the members whose compression a lumped model does not compute."""
    told = {channel.name for channel in ready.problem.system.channels}
    missing = [name for name in compressed_members(ready.model) if f"members.{name}.compression" not in told]
    if not missing:
        return []
    why = "no mass stands behind, so that springs would be all that is borne, and nothing of the inertia there"
    remedy = 'take fidelity.model = "chain" with two masses or more'
    return [f"Warning: compression and buckling of {', '.join(missing)} are not told: {why}; {remedy}"]


def _rounded(ready: Prepared, extremes: Extremes) -> list[str]:
    if not extremes.most_bent.any() or not ready.problem.system.size:
        return []
    share = share_lost(ready.problem.system.stiffness, extremes.most_bent)
    if share <= _WORTH_TELLING:
        return []
    return [f"Warning: rounding in the stiffness may have taken up to {100.0 * share:.1g} % of the deflection"]


def lost_energy(extremes: Extremes) -> float:
    """Return the residual of the energy balance, relative to its terms."""
    return abs(_largest_share(extremes, "residual"))


def numerical_energy(extremes: Extremes) -> float:
    """Return the relative numerical dissipation of the time integration; negative if it adds energy."""
    return _largest_share(extremes, "numerical")


def _largest_share(extremes: Extremes, part: str) -> float:
    """Return the maximum of a term of the energy balance relative to the largest range of work and stored energies."""
    bounds = (extremes.channel(f"energy.{name}") for name in ("work", "kinetic", "strain"))
    turned_over = max(largest - least for least, largest in bounds)
    return max(extremes.channel(f"energy.{part}"), key=abs) / turned_over if turned_over > 0.0 else 0.0


def balances(extremes: Extremes, stats: Stats) -> str:
    """Return a sentence about the energy balance and the equilibrium residual of a run."""
    if not extremes.energies:
        return ""
    forces = f"forces within {stats.imbalance:.1e} of the largest" if stats.imbalance >= 0.0 else "forces not looked at"
    residual, numerical = lost_energy(extremes), numerical_energy(extremes)
    return f"residual {residual:.1e}, numerical dissipation {numerical:.2g} of the external work; {forces}"


def _bodies(ready: Prepared) -> bool:
    """Return whether a run has the degrees of freedom of its members."""
    return ready.case.record.fidelity.model == "beams" and ready.problem.system.size > 0


def _coarse(found: Resolution) -> list[str]:
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


def _unbalanced(stats: Stats) -> list[str]:
    if stats.imbalance <= _UNBALANCED:
        return []
    why = "the steps are too long for the motion; take more steps per revolution"
    return [f"Warning: forces are out of balance by up to {100.0 * stats.imbalance:.2g} % of the largest: {why}"]


def _unaccounted(extremes: Extremes) -> list[str]:
    """Return a warning if the energy balance of a run has a large residual."""
    share = lost_energy(extremes)
    if share <= _UNACCOUNTED:
        return []
    why = "the steps are too long for what happens within them, or a contact is too stiff for them"
    return [f"Warning: {100.0 * share:.2g} % of the energy does not add up: {why}; take more steps per revolution"]


def _integrated_away(ready: Prepared, extremes: Extremes) -> list[str]:
    """Return a warning if the time integration dissipates or adds significant energy."""
    share = numerical_energy(extremes)
    if abs(share) <= _UNACCOUNTED:
        return []
    does = "dissipates" if share > 0.0 else "adds"
    other = "" if ready.scheme == newmark() else ', or integrator = { method = "newmark" }'
    told = f"{100.0 * abs(share):.2g} % of the external work: the steps are too long for what happens within them"
    return [f"Warning: the time integration {does} {told}; take more steps per revolution{other}"]
