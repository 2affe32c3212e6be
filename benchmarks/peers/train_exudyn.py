"""C1 by Exudyn: one body with the given matrices, and connectors with contact laws as compiled expressions."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from benchmarks.peers.train import FloatArray, Setting, Train, equations

sys.exudynFast = True  # has to be set before the import

import exudyn as exu  # noqa: E402
from exudyn.itemInterface import (  # noqa: E402
    CoordinateSpringDamper,
    MarkerNodeCoordinate,
    NodeGenericODE2,
    NodePointGround,
    ObjectGenericODE2,
    SensorNode,
)
from exudyn.utilities import CreateSymbolicUserFunction  # noqa: E402

STEPS = (1800, 3600, 7200, 14400, 28800, 57600)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
_KINDS = exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t
_SOLVER = exu.DynamicSolverType


def settings(train: Train) -> Iterator[Setting]:
    """Yield Newmark's method (modified Newton) and DOPRI5."""
    for steps in STEPS:
        prepare = partial(_prepare, train, _SOLVER.GeneralizedAlpha, steps, 0.0)
        yield Setting("Exudyn, Newmark", f"{steps} steps", prepare)
    for tolerance in TOLERANCES:
        prepare = partial(_prepare, train, _SOLVER.DOPRI5, train.instants, tolerance)
        yield Setting("Exudyn, DOPRI5", f"tolerance {tolerance:.0e}", prepare)


def _prepare(train: Train, solver: exu.DynamicSolverType, steps: int, tolerance: float) -> Callable[[], FloatArray]:
    container = exu.SystemContainer()
    system = container.AddSystem()
    node = _body(system, train)
    compiled = _contacts(system, train, node)
    sensors = [
        system.AddSensor(SensorNode(nodeNumber=node, storeInternal=True, writeToFile=False, outputVariableType=kind))
        for kind in _KINDS
    ]
    system.Assemble()
    settings = exu.SimulationSettings()
    stepping = settings.timeIntegration
    stepping.numberOfSteps, stepping.endTime, stepping.verboseMode = steps, train.period, 0
    stepping.generalizedAlpha.useNewmark = True
    stepping.newton.useModifiedNewton = True
    stepping.automaticStepSize = tolerance > 0.0
    if tolerance:
        stepping.relativeTolerance, stepping.absoluteTolerance = tolerance, 1e-3 * tolerance
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = train.period / train.instants

    def run() -> FloatArray:
        assert compiled  # Exudyn does not keep them alive during the run
        assert container
        system.SolveDynamic(settings, solverType=solver)
        displacements, velocities = (system.GetSensorStoredData(sensor) for sensor in sensors)
        return np.column_stack([displacements, velocities[:, 1:]])  # DOPRI5 does not stop at the output instants

    return run


def _body(system: exu.MainSystem, train: Train) -> object:
    M, C, K = train.matrices()
    start = train.start.tolist()
    node = system.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=3, referenceCoordinates=[0.0] * 3, initialCoordinates=start[:3],
            initialCoordinates_t=start[3:],
        )
    )  # fmt: skip
    system.AddObject(
        ObjectGenericODE2(
            nodeNumbers=[node], massMatrix=M, dampingMatrix=C, stiffnessMatrix=K, forceVector=train.preload.tolist()
        )
    )
    return node


def _contacts(system: exu.MainSystem, train: Train, node: object) -> list[object]:
    """Add springs between coordinates; a law gets their difference u (second minus first) and its rate v."""
    symbolic = exu.symbolic
    laws = equations(train, symbolic.max, symbolic.abs, symbolic.sign)
    ground = MarkerNodeCoordinate(nodeNumber=system.AddNode(NodePointGround()), coordinate=0)
    fixed = system.AddMarker(ground)
    follower, rocker, valve = (system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=i)) for i in range(3))

    def cam(mbs: object, t: float, itemNumber: int, u: float, v: float, k: float, d: float, f: float) -> object:
        s, rate = laws.cam_motion(t)
        return -laws.contact(s - u, rate - v, *train.cam)

    def tip(mbs: object, t: float, itemNumber: int, u: float, v: float, k: float, d: float, f: float) -> object:
        return laws.contact(u - train.lash, v, *train.tip)

    def seat(mbs: object, t: float, itemNumber: int, u: float, v: float, k: float, d: float, f: float) -> object:
        return -laws.contact(-u, -v, *train.seat)

    compiled = []
    for first, second, law in ((fixed, follower, cam), (valve, rocker, tip), (fixed, valve, seat)):
        spring = system.AddObject(CoordinateSpringDamper(markerNumbers=[first, second], stiffness=0.0, damping=0.0))
        compiled.append(CreateSymbolicUserFunction(system, law, "springForceUserFunction", spring))
        system.SetObjectParameter(spring, "springForceUserFunction", compiled[-1])
    return compiled
