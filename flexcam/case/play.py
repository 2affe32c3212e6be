"""How stiff a play is where its case does not say."""

from __future__ import annotations

import numpy as np

from flexcam.case.records import CaseRecord
from flexcam.case.tables.contacts import LashRecord
from flexcam.checks import refuse
from flexcam.fem import Mesh

STIFFER = 10.0
"""Touching faces by the member behind them: with it they add a tenth to what the train yields."""


def play_stiffness(play: LashRecord, case: CaseRecord, mesh: Mesh) -> float:
    """Return the stiffness of both sides of a play when they touch."""
    if play.stiffness is not None:
        return play.stiffness
    ends, ratio = _sides(play, case)
    nodes = [mesh.node(name) for name in ends if name in mesh.points]
    found = [_axial(name, case, mesh) for name, line in mesh.lines.items() if np.isin(nodes, line[[0, -1]]).any()]
    if not found:
        why = "no member ends at the play whose own could be taken"
        raise refuse("stiffness", "nothing", "a value", why, 'add stiffness = "20 MN/m" or what is meant')
    return STIFFER * min(found) / ratio**2


def _sides(play: LashRecord, case: CaseRecord) -> tuple[tuple[str, ...], float]:
    """Return the nodes at both sides, and the way of the play by that of these."""
    if play.ends is not None:
        return play.ends, 1.0
    rocker = case.rockers[str(play.at)]
    return (rocker.start,), rocker.arms[1] / rocker.arms[0]


def _axial(name: str, case: CaseRecord, mesh: Mesh) -> float:
    member = case.members[name]
    length = np.linalg.norm(np.diff(mesh.nodes[mesh.lines[name]], axis=0), axis=1).sum()
    return case.materials[member.material].made().E * case.sections[member.section].made().A / float(length)
