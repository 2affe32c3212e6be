"""What the equations take for granted of camshafts: they bend alike all round, and all cams of one turn one way.

The unknowns of a shaft are seen from the housing, where a round section has the same stiffness at any cam angle.
Another shows ``(Iy + Iz)/2 + (Iy - Iz)/2 cos 2 theta`` across a fixed direction, as tensors of second order turn
(Mohr's circle): a stiffness that swings twice per turn, which constant matrices cannot hold.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexcam.case.case import Case
from flexcam.checks import Fault
from flexcam.fem import Member
from flexcam.linalg import FloatArray
from flexcam.train import Model

_ROUND = 0.01
"""Part by which stiffnesses in two directions may differ: flexcam's choice, as published properties are rounded."""


def shaft_faults(case: Case, model: Model) -> list[Fault]:
    """Return the members that turn and are not round, and the cams that turn against another of their shaft."""
    return [*_uneven(case, model), *_against(case, model)]


def _uneven(case: Case, model: Model) -> Iterator[Fault]:
    for name, cam in _turning(model).items():
        member = model.members[name]
        if apart := _apart(member):
            why = f"it turns with cam {cam!r}, so that its stiffness would swing twice per turn, which is not computed"
            allowed = f"a section that is as stiff along y as along z, within {100.0 * _ROUND:g} %"
            remedy = "take a circle, a tube, or a custom section with the mean of both"
            yield Fault(case.place(("members", name, "section")), apart, allowed, why, remedy)


def _turning(model: Model) -> dict[str, str]:
    """Return the members that turn, each with the cam they turn with."""
    found: dict[str, str] = {}
    for name, cam in model.cams.items():
        nodes = model.mesh.connected(model.mesh.node(cam.at))
        for member, line in model.mesh.lines.items():
            if np.isin(line, nodes).any():
                found.setdefault(member, name)
    return found


def _apart(member: Member) -> str:
    """Return in words how the stiffnesses of a member across its two axes differ; empty where they do not."""
    one = member.section
    pairs = [(one.Iy, one.Iz, "Iy = {:.4g} m^4 and Iz = {:.4g} m^4")]
    if member.shear:
        pairs.append((one.kappa_y, one.kappa_z, "kappa_y = {:.4g} and kappa_z = {:.4g}"))
    return "; ".join(words.format(a, b) for a, b, words in pairs if abs(a - b) > _ROUND * max(a, b))


def _against(case: Case, model: Model) -> Iterator[Fault]:
    first: dict[int, str] = {}
    axes = {contact.cam: contact.shaft_axis for contact in model.driven.values()}
    for name, axis in axes.items():
        shaft = int(model.mesh.connected(model.mesh.node(model.cams[name].at))[0])
        other = first.setdefault(shaft, name)
        if float(axis @ axes[other]) < 0.0:
            given, allowed = f"{_told(axis)}, against cam {other!r} about {_told(axes[other])}", "one sense of rotation"
            why, remedy = f"{name!r} and {other!r} sit on one shaft", "turn the sign of one axis"
            yield Fault(case.place(("cams", name, "axis")), given, allowed, why, remedy)


def _told(axis: FloatArray) -> str:
    return f"[{', '.join(f'{x:g}' for x in (axis + 0.0).tolist())}]"
