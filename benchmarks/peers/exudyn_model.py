"""The shaft in Exudyn: one body with our matrices, loads as compiled expressions, all that its variants share."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import exudyn as exu
import numpy as np
from exudyn.itemInterface import LoadCoordinate, MarkerNodeCoordinate, NodeGenericODE2, ObjectGenericODE2, SensorNode
from exudyn.utilities import CreateSymbolicUserFunction

from benchmarks.peers.work import FloatArray, Result, Work, matrices


def at_all_speeds(
    work: Work,
    tune: Callable[[exu.SimulationSettings], None],
    stored: Callable[[FloatArray], FloatArray | exu.MatrixContainer] = np.asarray,
) -> Result:
    """Integrate at all speeds, a new system for each, its matrices stored in some way."""
    started, loop, moved = time.perf_counter(), 0.0, []
    M, K, watched = matrices(work)
    for frequency in work.frequencies:
        container = exu.SystemContainer()
        system = container.AddSystem()
        node = _body(system, stored(M), stored(K), len(M))
        loads = zip(watched, _loads(work, frequency), strict=True)
        compiled = [_load(system, node, int(at), *load) for at, load in loads]
        sensor = system.AddSensor(_sensor(node))
        system.Assemble()
        settings = _settings(work, work.step(frequency))
        tune(settings)
        begun = time.perf_counter()
        system.SolveDynamic(settings)
        loop += time.perf_counter() - begun
        moved.append(system.GetSensorStoredData(sensor)[:, 1 + watched])
        del compiled  # the expressions had to live as long as the run
    return Result(np.array(moved), loop, time.perf_counter() - started)


def _sensor(node: object) -> SensorNode:
    kind = exu.OutputVariableType.Coordinates
    return SensorNode(nodeNumber=node, storeInternal=True, writeToFile=False, outputVariableType=kind)


def _body(system: exu.MainSystem, M: object, K: object, size: int) -> object:
    rest = [0.0] * size
    node = system.AddNode(
        NodeGenericODE2(
            numberOfODE2Coordinates=size, referenceCoordinates=rest, initialCoordinates=rest, initialCoordinates_t=rest
        )
    )
    system.AddObject(ObjectGenericODE2(nodeNumbers=[node], massMatrix=M, stiffnessMatrix=K))
    return node


def _loads(work: Work, frequency: float) -> tuple[tuple[float, Callable[..., object]], ...]:
    """Return size and history of force and torque."""
    speed, symbolic = 2.0 * math.pi * frequency, exu.symbolic
    return (
        (work.force, lambda mbs, t, load: load * (1.0 - symbolic.cos(speed * t))),
        (work.torque, lambda mbs, t, load: load * symbolic.sin(speed * t)),
    )


def _load(system: exu.MainSystem, node: object, at: int, size: float, history: Callable[..., object]) -> object:
    marker = system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=at))
    load = system.AddLoad(LoadCoordinate(markerNumber=marker, load=size))
    compiled = CreateSymbolicUserFunction(system, history, "loadUserFunction", load)
    system.SetLoadParameter(load, "loadUserFunction", compiled)
    return compiled


def _settings(work: Work, step: float) -> exu.SimulationSettings:
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = work.steps
    settings.timeIntegration.endTime = work.steps * step
    settings.timeIntegration.generalizedAlpha.useNewmark = True  # 1/4 and 1/2 are its defaults
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = step
    return settings
