"""Natural modes of cases, their similarity, and the Campbell diagram: frequencies over speed and orders of a cam.

The model has no gyroscopic effects, so that the speed changes the modes only through preloads: a Hertz contact is
softer with less force at the cam nose, an open contact has no stiffness, and a compressed pushrod loses stiffness.
The modes over speed are those about the equilibrium at full lift with the inertia forces of the rigid train.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from flexcam.analysis.orders import run_over_speeds
from flexcam.analysis.preparation import prepare
from flexcam.analysis.stability import Resonance, force_harmonics, lift_harmonics
from flexcam.case.builder import build_model
from flexcam.case.case import Case, require_case
from flexcam.case.schema.contacts import CamContactRecord
from flexcam.core import FloatArray, Triplets
from flexcam.core.errors import InputError, refuse, suggest_name
from flexcam.core.units import RPM
from flexcam.dynamics import CamMotion, ProgressCallback, RunFailedError, State, Status, mac
from flexcam.valvetrain import (
    CamContact,
    ContactModes,
    Model,
    ModelModes,
    build_structure,
    model_modes,
    modes_on_the_lift,
    rigid_motion,
)


def modes(
    case: Case, count: int | None = None, *, prestress: Literal["rest", "equilibrium"] | None = None
) -> ModelModes:
    """Compute the natural modes of a case's structure.

    Parameters
    ----------
    case
        Case from `flexcam.read_case`.
    count
        Number of modes; None for all computable ones.
    prestress
        Static state whose axial forces are included: installed, or in equilibrium under all loads; None for the
        unloaded structure.

    Returns
    -------
    ModelModes
        Frequencies, shapes, effective masses and descriptions.

    Raises
    ------
    InputError
        If parts are inconsistent.
    RunFailedError
        If a rigid-body motion has no mass, or a member buckles under the prestress; the message names it.

    Examples
    --------
    ``flexcam.modes(case).words(1)`` describes the second mode.
    """
    require_case(case)
    if count is not None and count < 1:
        raise refuse("count", count, "a whole number, at least 1")
    if prestress is None:
        return model_modes(build_structure(build_model(case)), count)
    flexible = case.with_fidelity({"model": "beams", "modes": None, "reduction": "modes"})
    ready = prepare(flexible.with_run({"start": prestress}))
    state = ready.problem.start or State.rest(ready.problem.system.size)
    return model_modes(build_structure(ready.model), count, loaded=state.displacement)


@dataclass(frozen=True, eq=False)
class ClosedModes:
    """Modes of a train with its contacts as in static equilibrium."""

    contact: str  #: contact of the cam that stands at its base circle or at its full lift
    #: `base_circle`, `full_lift`: modes
    base_circle: ModelModes
    full_lift: ModelModes


_MAX_UNKNOWNS = 1000  # number of unknowns up to which the modes of every cam take seconds


def closed_modes(case: Case) -> tuple[list[ClosedModes], list[str]]:
    """Return the modes with contacts closed for every cam, and remarks: open lashes, and why there are no modes."""
    model = build_model(case)
    if (size := build_structure(model).dofs.size) > _MAX_UNKNOWNS:
        return [], [f"No modes with contacts closed: {size} unknowns, computed up to {_MAX_UNKNOWNS}"]
    contacts = [name for name, contact in model.cam_contacts.items() if isinstance(contact, CamContact)]
    results, lashes, remarks = list[ClosedModes](), dict[str, None](), list[str]()
    try:
        for name in contacts:
            base = modes_on_the_lift(model, name, case.speed, base_circle=True)
            lashes |= dict.fromkeys(base.open_lashes)
            lifted = modes_on_the_lift(model, name, case.speed)
            results.append(ClosedModes(name, base.model_modes, lifted.model_modes))
    except (InputError, RunFailedError) as failure:
        results, remarks = [], [f"No modes with contacts closed: {failure}"]
    if lashes:
        remarks.append(f"Lashes that are open on the base circle, and have no stiffness there: {', '.join(lashes)}")
    return results, remarks


def modal_assurance(case: Case, found: ModelModes, other: Case, others: ModelModes) -> tuple[FloatArray, int]:
    """Compare the modes of two cases by the modal assurance criterion."""
    shapes: list[dict[tuple[float, ...], FloatArray]] = []
    for variant, solution in ((case, found), (other, others)):
        structure = build_structure(build_model(variant))
        nodal = structure.dofs.nodal(solution.modes.shapes.T)
        places = np.round(structure.model.mesh.nodes, 9).tolist()
        shapes.append({tuple(place): nodal[:, i, :3] for i, place in enumerate(places)})
    common = [place for place in shapes[0] if place in shapes[1]]
    if not common:
        raise refuse("--mac", str(other.path), "a model with the same nodes", "mode shapes are compared at the nodes")
    moving = sum(bool(shapes[0][place].any()) for place in common)
    columns = [np.concatenate([case_shapes[place] for place in common], axis=1).T for case_shapes in shapes]
    return mac(columns[0], columns[1]), moving


_EXTRA_MODES = 8  # additional modes, among which a mode is found again after others have crossed it
_MIN_MAC = 0.5  # minimum modal assurance criterion, weighted by mass, for modes at two speeds to count as the same
# maximum relative change of a frequency between adjacent speeds; a larger one indicates a change of contact
_MAX_FREQUENCY_CHANGE = 0.2


@dataclass(frozen=True, eq=False)
class Campbell:
    """Natural frequencies over speed."""

    contact: str  #: contact whose cam defines the orders
    rpm: FloatArray  #: camshaft speeds, shape (m,)
    #: natural frequencies, Hz, shape (m, k), a column per mode in ascending order; NaN if a run failed or its state is
    #: unstable, or if the mode does not exist because a contact has opened or closed
    frequencies: FloatArray
    #: whether the contact excites each mode at some speed: the mode contributes to the compliance at the contact
    reached: tuple[bool, ...]
    words: tuple[str, ...]  #: description of each mode, at its lowest speed
    lifts: Mapping[int, float]  #: amplitude in the lift by evaluated order, m
    #: amplitudes of these orders in the contact force, N, shape (m, orders); NaN if a run failed, is shorter than a
    #: revolution, or has too few steps for the order
    loads: FloatArray
    #: crossings of orders with modes excited at the contact, in ascending order of speed
    crossings: tuple[Resonance, ...]
    #: status at every speed: of the run, or of the mode computation, which fails in an unstable state
    statuses: tuple[Status, ...]


@dataclass(eq=False)
class _ModeLine:
    frequencies: FloatArray
    shape: FloatArray
    words: str
    reached: bool = False


def campbell(
    case: Case, speeds: Sequence[float], *, orders: Sequence[int], modes: int = 8, contact: str | None = None,
    advance: ProgressCallback | None = None,
) -> Campbell:  # fmt: skip
    """Return natural frequencies over speed and their crossings with the orders of a cam; the speeds rise."""
    if len(speeds) < 2 or not (np.diff(speeds) > 0.0).all() or speeds[0] <= 0.0:
        raise refuse("speeds", f"{len(speeds)} speeds", "two or more, rising, above zero")
    if not orders or min(orders) < 1:
        raise refuse("orders", str(list(orders)), "whole numbers, each at least 1")
    if modes < 1:
        raise refuse("modes", modes, "a whole number, at least 1")
    name, cam = _select_contact(case, contact)
    rpm = np.array(speeds) / RPM
    sizes = lift_harmonics(build_model(case).cams[cam].event, max(orders))
    lifts = {n: size for n, size in sizes.items() if n in orders}
    numbers = np.array(list(lifts), dtype=int)
    loads, statuses = np.full((len(rpm), len(lifts)), math.nan), list[Status]()
    lines: list[_ModeLine] = []
    for i, run in enumerate(run_over_speeds(case, speeds, advance)):
        statuses.append(run if isinstance(run, Status) else run[1].status)
        if isinstance(run, Status) or not run[1].status.ok:
            continue
        ready, response = run
        loads[i] = force_harmonics(response, name, max(orders))[numbers - 1]
        acceleration = partial(_rigid_acceleration, ready.model)
        try:
            current = modes_on_the_lift(ready.model, name, speeds[i], acceleration=acceleration)
        except RunFailedError as failure:
            statuses[-1] = failure.status
        else:
            _extend_lines(lines, i, len(rpm), current, build_structure(ready.model).mass, modes)
    lines.sort(key=lambda line: float(np.nanmin(line.frequencies)))
    crossings = _with_loads(case, name, _find_crossings(name, rpm, lines, lifts), advance)
    frequencies = np.array([line.frequencies for line in lines]).reshape(len(lines), len(rpm)).T
    reached, words = tuple(line.reached for line in lines), tuple(line.words for line in lines)
    return Campbell(name, rpm, frequencies, reached, words, lifts, loads, crossings, tuple(statuses))


def _rigid_acceleration(model: Model, motion: CamMotion) -> FloatArray:
    """Return the accelerations of all unknowns in the rigid train at an instant; zero if there is none."""
    try:
        return rigid_motion(model).at(motion)[2][0]
    except InputError:
        return np.zeros(build_structure(model).dofs.size)


def _extend_lines(lines: list[_ModeLine], i: int, count: int, now: ContactModes, mass: Triplets, modes: int) -> None:
    """Extend the lines by the modes at the next speed; a mode that matches no line starts a new one."""
    from scipy.optimize import linear_sum_assignment

    first = now.model_modes.modes.rigid
    last = min(first + modes + _EXTRA_MODES, len(now.model_modes.modes.omegas))
    shapes, relevant = now.model_modes.modes.shapes[:, first:last], set(now.relevant_modes)
    previous = np.array([line.shape for line in lines]).reshape(len(lines), mass.size)
    likeness = (previous @ mass.multiply(shapes)) ** 2
    frequencies = now.model_modes.modes.frequencies[first:last]
    latest = np.array([line.frequencies[~np.isnan(line.frequencies)][-1] for line in lines])
    leaps = np.abs(frequencies / latest[:, None] - 1.0) > _MAX_FREQUENCY_CHANGE
    alike = np.where(leaps, 0.0, likeness)
    best: list[list[int]] = np.column_stack(linear_sum_assignment(-alike)).tolist()
    pairs = [(k, j) for k, j in best if alike[k, j] >= _MIN_MAC]
    new = set(range(min(modes, last - first))) - {j for _, j in pairs}
    for j in sorted(new):
        lines.append(_ModeLine(np.full(count, math.nan), shapes[:, j], now.model_modes.words(first + j)))
        pairs.append((len(lines) - 1, j))
    for k, j in pairs:
        lines[k].frequencies[i] = frequencies[j]
        lines[k].shape = shapes[:, j]
        lines[k].reached |= first + j in relevant


def _with_loads(
    case: Case, contact: str, crossings: Sequence[Resonance], advance: ProgressCallback | None
) -> tuple[Resonance, ...]:
    """Return crossings with the amplitudes in the force of a run at the speed of each; a resonance may be narrow."""
    speeds = sorted({crossing.rpm for crossing in crossings})
    highest, forces = max((crossing.harmonic for crossing in crossings), default=0), dict[float, FloatArray]()
    for rpm, run in zip(speeds, run_over_speeds(case, [rpm * RPM for rpm in speeds], advance), strict=True):
        if not isinstance(run, Status) and run[1].status.ok:
            forces[rpm] = force_harmonics(run[1], contact, highest)
    unknown = np.full(highest, math.nan)
    return tuple(replace(c, load=float(forces.get(c.rpm, unknown)[c.harmonic - 1])) for c in crossings)


def _find_crossings(
    contact: str, rpm: FloatArray, lines: Sequence[_ModeLine], lifts: Mapping[int, float]
) -> tuple[Resonance, ...]:
    """Return the crossings of order lines with mode lines, linear between speeds, without the load."""
    crossings: list[Resonance] = []
    for mode, line in enumerate(lines):
        for n, size in lifts.items() if line.reached else ():
            above = line.frequencies - n * rpm / 60.0
            for i in np.flatnonzero(above[:-1] * above[1:] <= 0.0).tolist():
                if above[i + 1] == 0.0 and i + 2 < len(rpm):  # the next segment starts with the same crossing
                    continue
                part = above[i] / (above[i] - above[i + 1]) if above[i] != above[i + 1] else 0.0
                speed = float(rpm[i] + part * (rpm[i + 1] - rpm[i]))
                crossings.append(Resonance(contact, speed, n, size, math.nan, mode, n * speed / 60.0, line.words))
    return tuple(sorted(crossings, key=lambda crossing: crossing.rpm))


def _select_contact(case: Case, contact: str | None) -> tuple[str, str]:
    """Return the contact whose cam excites the modes, and this cam."""
    cams = {name: part.cam for name, part in case.record.contacts.items() if isinstance(part, CamContactRecord)}
    if not cams:
        why = "the orders of the cam excite the modes"
        raise refuse("contacts", "none with a cam", "a contact of a cam and its follower", why)
    if contact is not None and contact not in cams:
        raise refuse("contact", repr(contact), f"one of {', '.join(cams)}", "", suggest_name(contact, cams))
    name = contact or next(iter(cams))
    return name, cams[name]
