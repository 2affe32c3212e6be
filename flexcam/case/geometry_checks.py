"""Checks of geometry and supports: coincident nodes, rotating members and cams, immovable rockers and lashes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, cast

import numpy as np

from flexcam.case.case import Case
from flexcam.case.toml_lines import KeyLocations
from flexcam.core import FloatArray
from flexcam.core.errors import Fault, InputError
from flexcam.core.units import parse
from flexcam.fem.frames import component
from flexcam.fem.members import Member
from flexcam.valvetrain import Adjuster, Lash, Model

Table = Mapping[str, Any]


def coincident_node_faults(raw: Table, places: KeyLocations) -> list[Fault]:
    """Return the faults of coincident nodes and of members that contain a node twice."""
    return [*_coincident_nodes(raw, places), *_repeated_nodes(raw, places)]


def _coincident_nodes(raw: Table, places: KeyLocations) -> Iterator[Fault]:
    first: dict[tuple[float, ...], str] = {}
    for name, place in _table(raw, "nodes").items():
        at = _node_coordinates(place)
        if at is not None and (other := first.setdefault(at, name)) != name:
            where, why = places.place(("nodes", name)), "members meet only at a shared node"
            remedy = f"name {other!r} wherever {name!r} is meant"
            yield Fault(where, f"the place of {other!r}", "a place of its own", why, remedy)


def _node_coordinates(place: object) -> tuple[float, ...] | None:
    """Return the coordinates of a node, m; None if they are invalid."""
    if not isinstance(place, list | tuple):
        return None
    try:
        return tuple(parse(one, "length", noise=True) for one in cast("list[Any]", place))
    except InputError:
        return None


def _repeated_nodes(raw: Table, places: KeyLocations) -> Iterator[Fault]:
    for name, table in _table(raw, "members").items():
        nodes = cast("Table", table).get("nodes") if isinstance(table, Mapping) else None
        met = [one for one in cast("list[object]", nodes) if isinstance(one, str)] if isinstance(nodes, list) else []
        for node in dict.fromkeys(one for one in met if met.count(one) > 1):
            where, allowed = places.place(("members", name, "nodes")), "a chain that meets each node once"
            why, remedy = "a closed member has no end to start from", "make two members of it"
            yield Fault(where, repr(node), allowed, why, remedy)


def _table(raw: Table, kind: str) -> Table:
    table = raw.get(kind)
    return cast("Table", table) if isinstance(table, Mapping) else {}


_ROUNDNESS_TOLERANCE = 0.01
"""Allowed relative difference of the stiffnesses in two directions; chosen, as published properties are rounded."""


def shaft_faults(case: Case, model: Model) -> list[Fault]:
    """Return the faults of rotating members that are not round and of cams with opposite rotation on one shaft."""
    return [*_unsymmetric_member_faults(case, model), *_rotation_faults(case, model)]


def _unsymmetric_member_faults(case: Case, model: Model) -> Iterator[Fault]:
    for name, cam in _rotating_members(model).items():
        member = model.members[name]
        if apart := _describe_difference(member):
            why = f"it turns with cam {cam!r}, so that its stiffness would swing twice per turn, which is not computed"
            allowed = f"a section that is as stiff along y as along z, within {100.0 * _ROUNDNESS_TOLERANCE:g} %"
            remedy = "take a circle, a tube, or a custom section with the mean of both"
            yield Fault(case.place(("members", name, "section")), apart, allowed, why, remedy)


def _rotating_members(model: Model) -> dict[str, str]:
    """Return the rotating members, each with the cam that rotates it."""
    found: dict[str, str] = {}
    for name, cam in model.cams.items():
        nodes = model.mesh.connected_nodes(model.mesh.node(cam.at))
        for member, line in model.mesh.lines.items():
            if np.isin(line, nodes).any():
                found.setdefault(member, name)
    return found


def _describe_difference(member: Member) -> str:
    """Describe the difference of a member's stiffnesses about its two axes; empty if they are equal."""
    one = member.section
    pairs = [(one.Iy, one.Iz, "Iy = {:.4g} m^4 and Iz = {:.4g} m^4")]
    if member.shear:
        pairs.append((one.kappa_y, one.kappa_z, "kappa_y = {:.4g} and kappa_z = {:.4g}"))
    return "; ".join(words.format(a, b) for a, b, words in pairs if abs(a - b) > _ROUNDNESS_TOLERANCE * max(a, b))


def _rotation_faults(case: Case, model: Model) -> Iterator[Fault]:
    first: dict[int, str] = {}
    axes = {contact.cam: contact.shaft_axis for contact in model.cam_contacts.values()}
    for name, axis in axes.items():
        shaft = int(model.mesh.connected_nodes(model.mesh.node(model.cams[name].at))[0])
        other = first.setdefault(shaft, name)
        if float(axis @ axes[other]) < 0.0:
            given, allowed = (
                f"{_format_axis(axis)}, against cam {other!r} about {_format_axis(axes[other])}",
                "one sense of rotation",
            )
            why, remedy = f"{name!r} and {other!r} sit on one shaft", "turn the sign of one axis"
            yield Fault(case.place(("cams", name, "axis")), given, allowed, why, remedy)


def _format_axis(axis: FloatArray) -> str:
    return f"[{', '.join(f'{x:g}' for x in (axis + 0.0).tolist())}]"


def support_faults(case: Case, model: Model) -> list[Fault]:
    """Return the faults of rockers that cannot be driven and of lashes without a movable end."""
    return [*_undriven_rocker_faults(case, model), *_fixed_lash_faults(case, model)]


def _undriven_rocker_faults(case: Case, model: Model) -> Iterator[Fault]:
    for name, rocker in model.rockers.items():
        if not rocker.finger and _is_fixed(model, rocker.start, rocker.direction):
            given, why = f"{rocker.start!r}, held along the rocker's direction", "nothing could drive the rocker"
            remedy = "give the direction in which the node moves, or free it"
            yield Fault(case.place(("rockers", name, "from")), given, "a node that can move along it", why, remedy)


def _fixed_lash_faults(case: Case, model: Model) -> Iterator[Fault]:
    """Yield the faults of lashes between two fixed nodes; with one fixed node a lash is a valid stop."""
    for name, one in model.contacts.items():
        if not isinstance(one, Lash | Adjuster) or one.ends is None or one.direction is None:
            continue
        if all(_is_fixed(model, end, one.direction) for end in one.ends):
            given = f"{one.ends[0]!r} and {one.ends[1]!r}, both held along it"
            allowed, why = "a direction in which one of them can move", "the play would never act"
            yield Fault(case.place(("contacts", name, "direction")), given, allowed, why, "turn it, or free a node")


def _is_fixed(model: Model, point: str, direction: FloatArray) -> bool:
    """Return whether supports fix a node along a direction."""
    node = model.mesh.node(point)
    kept = [held for name, held in model.supports.items() if node in model.mesh.points[name]]
    numbers = [component(one) for held in kept for one in held]
    return not np.delete(direction, numbers).any()
