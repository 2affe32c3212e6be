"""From checked records to the `Model`: geometry, parts and their places."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np

from flexcam import fem, train
from flexcam.case import records as r
from flexcam.case.read import Case
from flexcam.checks import Fault, InputError, refuse
from flexcam.fem import Damping, Material, Member, Mesh, PointMass, Section
from flexcam.linalg import FloatArray
from flexcam.motion import LAWS, LiftEvent

In = TypeVar("In")
Out = TypeVar("Out")


def build_model(case: Case) -> train.Model:
    """Return the model a case describes.

    Parameters
    ----------
    case
        A checked case.

    Returns
    -------
    Model
        A value; no matrices yet.

    Raises
    ------
    InputError
        With all faults of geometry and parts at once.
    """
    record = case.record
    faults: list[Fault] = []

    def each(kind: str, table: Mapping[str, In], make: Callable[[In], Out]) -> dict[str, Out]:
        made: dict[str, Out] = {}
        for name, part in table.items():
            try:
                made[name] = make(part)
            except InputError as refusal:
                faults.extend(_inside(f"{kind}.{name}", fault) for fault in refusal.faults)
        return made

    materials = each("materials", record.materials, lambda m: Material(m.E, m.nu, m.density))
    sections = each("sections", record.sections, section)
    if faults:
        raise InputError(faults)
    mesh = _mesh(case)
    rockers = each("rockers", record.rockers, lambda one: _rocker(one, mesh))
    contacts = each("contacts", record.contacts, lambda one: _contact(one, record, mesh))
    model = train.Model(
        mesh=mesh,
        members=each("members", record.members, lambda m: _member(m, materials, sections)),
        supports={point: tuple(held) for point, held in record.supports.items()},
        masses=each("masses", record.masses, _mass),
        springs=each("springs", record.springs, _spring),
        rockers=rockers,
        cams=each("cams", record.cams, _cam),
        contacts=contacts,
        damping=Damping(**record.run.damping.model_dump()),
        probes=tuple(record.output.probes),
    )
    if faults:
        raise InputError(faults)
    return model


def _inside(where: str, fault: Fault) -> Fault:
    return Fault(f"{where}: {fault.where}", fault.given, fault.allowed, fault.why, fault.remedy)


def section(record: r.CircleRecord | r.TubeRecord | r.RectangleRecord | r.CustomRecord) -> Section:
    """Return the section of a record.

    Parameters
    ----------
    record
        Any of the shapes.

    Returns
    -------
    Section
        With the record's own torsion constant and shear factors where it gives them.
    """
    match record:
        case r.CircleRecord():
            bare = Section.circle(record.diameter)
        case r.TubeRecord():
            bare = Section.tube(record.outer_diameter, record.inner_diameter)
        case r.RectangleRecord():
            bare = Section.rectangle(record.width_y, record.width_z)
        case r.CustomRecord():
            bare = Section(record.A, record.Iy, record.Iz, record.J)
    return bare.given(J=record.J, kappa_y=record.kappa_y, kappa_z=record.kappa_z)


def _mesh(case: Case) -> Mesh:
    members = case.record.members
    if case.mesh is None:
        names = list(case.record.nodes)
        lines = {name: [names.index(node) for node in m.nodes or []] for name, m in members.items()}
        lacking = [name for name, line in lines.items() if not line]
        if lacking:
            raise refuse(f"members.{lacking[0]}", "no nodes", "the named nodes along it", "the case has no mesh file")
        index = {name: np.array([i]) for i, name in enumerate(names)}
        mesh = Mesh(np.array(list(case.record.nodes.values())), {k: np.array(v) for k, v in lines.items()}, index)
    else:
        _check_groups(case.mesh, members)
        mesh = case.mesh
    return fem.refined(mesh, {name: member.elements for name, member in members.items()})


def _check_groups(mesh: Mesh, members: Mapping[str, r.MemberRecord]) -> None:
    faults = [
        Fault(f"members.{name}", "a member without a line group", f"line groups: {', '.join(mesh.lines)}", "", "")
        for name in members
        if name not in mesh.lines
    ]
    faults += [
        Fault(f"mesh group {name!r}", "lines without a member", "a table under [members]", "", f"add [members.{name}]")
        for name in mesh.lines
        if name not in members
    ]
    faults += [
        Fault(f"members.{name}.nodes", "nodes", "nothing", "the mesh file says where it runs", "remove the key")
        for name, member in members.items()
        if member.nodes is not None
    ]
    if faults:
        raise InputError(faults)


def _member(record: r.MemberRecord, materials: Mapping[str, Material], sections: Mapping[str, Section]) -> Member:
    return Member(
        materials[record.material], sections[record.section], record.orientation,
        record.shear, record.rotary_inertia, record.mass,
    )  # fmt: skip


def _mass(record: r.MassRecord) -> train.MassAt:
    return train.MassAt(record.at, PointMass(record.mass, record.inertia, record.offset))


def _spring(record: r.SpringRecord) -> train.Spring:
    return train.Spring(
        record.at, fem.direction(record.direction), record.stiffness, record.damping, record.to, record.installed_force
    )


def _cam(record: r.CamRecord) -> train.Cam:
    event = LiftEvent(LAWS[record.law], record.lift, record.rise, record.fall, record.dwell, record.phase)
    return train.Cam(record.at, event)


def _rocker(record: r.RockerRecord, mesh: Mesh) -> train.Rocker:
    if record.direction is not None:
        along = fem.direction(record.direction)
    else:
        along = _six(_tangent(mesh, mesh.node(record.start, "from")))
    return train.Rocker(record.start, record.to, record.arms, record.inertia, along)


def _contact(record: r.ContactRecord, case: r.CaseRecord, mesh: Mesh) -> train.PublishedLoad:
    cam, follower = mesh.node(case.cams[record.cam].at, "cam"), mesh.node(record.follower, "follower")
    axis = _tangent(mesh, cam)
    if record.direction is not None:
        lift = fem.direction(record.direction)
    else:
        lift = _six(_across(mesh.nodes[follower] - mesh.nodes[cam], axis))
    return train.PublishedLoad(
        record.cam, record.follower, lift, axis, record.preload_factor, record.cam_deflection, record.cam_torque
    )


def _tangent(mesh: Mesh, node: int) -> FloatArray:
    """Return the unit vector along the member at a node, from the member's first node to its last."""
    for line in mesh.lines.values():
        at = np.flatnonzero(line == node)
        if at.size:
            before, after = max(int(at[0]) - 1, 0), min(int(at[0]) + 1, len(line) - 1)
            span = mesh.nodes[line[after]] - mesh.nodes[line[before]]
            return span / np.linalg.norm(span)
    raise refuse(mesh.node_name(node), "a node without a member", "a node of a member")


def _across(span: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the unit vector from cam to follower, square to the shaft."""
    across = span - (span @ axis) * axis
    length = float(np.linalg.norm(across))
    if length < 1e-9 * max(float(np.linalg.norm(span)), np.finfo(float).tiny):
        raise refuse(
            "direction", "a follower on the shaft's axis", "a direction of the lift", "", 'add direction = "uy"'
        )
    return across / length


def _six(translation: FloatArray) -> FloatArray:
    return np.concatenate([translation, np.zeros(3)])
