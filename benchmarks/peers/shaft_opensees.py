"""B1 and B5 by OpenSeesPy with its own beams and fastest options: linear algorithm, one banded factorization."""

from __future__ import annotations

import math
import time

import numpy as np
import openseespy.opensees as ops

from benchmarks.peers.shaft import FloatArray, Shaft, ShaftResult

END = 1e6
"""End of a load history, s."""


def run(shaft: Shaft) -> ShaftResult:
    """Integrate at all speeds with a new model for each: the factorization is valid for one time step only."""
    start, loop, displacements = time.perf_counter(), 0.0, []
    for frequency in shaft.frequencies:
        _model(shaft)
        _loads(shaft, frequency)
        _analysis()
        loop_start = time.perf_counter()
        displacements.append(_integrate(shaft, shaft.step(frequency)))
        loop += time.perf_counter() - loop_start
    return ShaftResult(np.array(displacements), loop, time.perf_counter() - start)


def _model(shaft: Shaft) -> None:
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for i in range(shaft.last + 1):
        ops.node(i, shaft.length * i / shaft.elements, 0.0, 0.0)
    for node, fixed in shaft.fixed.items():
        ops.fix(node, *(int(i in fixed) for i in range(6)))
    ops.geomTransf("Linear", 1, 0.0, 0.0, 1.0)
    section = shaft.area, shaft.E, shaft.G, 2.0 * shaft.inertia, shaft.inertia, shaft.inertia
    for i in range(shaft.last):
        per_length = shaft.density * shaft.area
        ops.element("elasticBeamColumn", i, i, i + 1, *section, 1, "-mass", per_length, "-cMass")
    ops.mass(shaft.middle, *[shaft.mass] * 3, 0.0, 0.0, 0.0)


def _loads(shaft: Shaft, frequency: float) -> None:
    """Set 500 - 500 cos w t as a constant and a shifted sine."""
    for tag, (history, arguments, component, size) in enumerate(
        (
            ("Constant", (), 1, shaft.force),
            ("Trig", (0.0, END, 1.0 / frequency, "-shift", 0.5 * math.pi), 1, -shaft.force),
            ("Trig", (0.0, END, 1.0 / frequency), 3, shaft.torque),
        ),
        start=1,
    ):
        ops.timeSeries(history, tag, *arguments)
        ops.pattern("Plain", tag, tag)
        ops.load(shaft.middle, *(size * (i == component) for i in range(6)))


def _analysis() -> None:
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandSPD")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.algorithm("Linear", False, False, True)
    ops.analysis("Transient")


def _integrate(shaft: Shaft, step: float) -> FloatArray:
    displacements = np.zeros((shaft.steps + 1, 2))
    for i in range(1, shaft.steps + 1):
        ops.analyze(1, step)
        displacements[i] = ops.nodeDisp(shaft.middle, 2), ops.nodeDisp(shaft.middle, 4)
    return displacements
