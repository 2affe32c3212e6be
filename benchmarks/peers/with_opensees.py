"""OpenSeesPy with its own beams, made as fast as it goes: linear algorithm factored once, banded matrices."""

from __future__ import annotations

import math
import time

import numpy as np
import openseespy.opensees as ops

from benchmarks.peers.work import FloatArray, Result, Work

FOREVER = 1e6
"""End of a load history, s."""


def run(work: Work) -> Result:
    """Integrate at all speeds, a new model for each: its analysis keeps what it factored for one step length."""
    started, loop, moved = time.perf_counter(), 0.0, []
    for frequency in work.frequencies:
        _model(work)
        _loads(work, frequency)
        _analysis()
        begun = time.perf_counter()
        moved.append(_integrated(work, work.step(frequency)))
        loop += time.perf_counter() - begun
    return Result(np.array(moved), loop, time.perf_counter() - started)


def _model(work: Work) -> None:
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for i in range(work.last + 1):
        ops.node(i, work.length * i / work.elements, 0.0, 0.0)
    for node, held in work.held.items():
        ops.fix(node, *(int(i in held) for i in range(6)))
    ops.geomTransf("Linear", 1, 0.0, 0.0, 1.0)
    section = work.area, work.E, work.G, 2.0 * work.inertia, work.inertia, work.inertia
    for i in range(work.last):
        per_length = work.density * work.area
        ops.element("elasticBeamColumn", i, i, i + 1, *section, 1, "-mass", per_length, "-cMass")
    ops.mass(work.middle, *[work.mass] * 3, 0.0, 0.0, 0.0)


def _loads(work: Work, frequency: float) -> None:
    """Set 500 - 500 cos w t as a constant and a shifted sine."""
    for tag, (history, arguments, component, size) in enumerate(
        (
            ("Constant", (), 1, work.force),
            ("Trig", (0.0, FOREVER, 1.0 / frequency, "-shift", 0.5 * math.pi), 1, -work.force),
            ("Trig", (0.0, FOREVER, 1.0 / frequency), 3, work.torque),
        ),
        start=1,
    ):
        ops.timeSeries(history, tag, *arguments)
        ops.pattern("Plain", tag, tag)
        ops.load(work.middle, *(size * (i == component) for i in range(6)))


def _analysis() -> None:
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandSPD")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.algorithm("Linear", False, False, True)
    ops.analysis("Transient")


def _integrated(work: Work, step: float) -> FloatArray:
    moved = np.zeros((work.steps + 1, 2))
    for i in range(1, work.steps + 1):
        ops.analyze(1, step)
        moved[i] = ops.nodeDisp(work.middle, 2), ops.nodeDisp(work.middle, 4)
    return moved
