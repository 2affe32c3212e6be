"""The shaft in Exudyn: one body with the given matrices, and loads as compiled expressions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import exudyn as exu
import numpy as np
from exudyn.itemInterface import LoadCoordinate, MarkerNodeCoordinate, NodeGenericODE2, ObjectGenericODE2, SensorNode
from exudyn.utilities import CreateSymbolicUserFunction

from benchmarks.peers.shaft import FloatArray, Shaft, ShaftResult, matrices


def run_speeds(shaft: Shaft, variant: str) -> ShaftResult:
    """Integrate at all speeds with a new system for each: `default`, `tuned` or `full` (Newton)."""
    start, loop, displacements = time.perf_counter(), 0.0, []
    store = _sparse if variant == "tuned" else np.asarray
    M, K, observed = matrices(shaft)
    for frequency in shaft.frequencies:
        container = exu.SystemContainer()
        system = container.AddSystem()
        node = _body(system, store(M), store(K), len(M))
        loads = zip(observed, _loads(shaft, frequency), strict=True)
        compiled = [_load(system, node, int(at), *load) for at, load in loads]
        sensor = system.AddSensor(_sensor(node))
        system.Assemble()
        settings = _settings(shaft, shaft.step(frequency))
        _select_solver(settings, variant)
        loop_start = time.perf_counter()
        system.SolveDynamic(settings)
        loop += time.perf_counter() - loop_start
        displacements.append(system.GetSensorStoredData(sensor)[:, 1 + observed])
        del compiled  # Exudyn does not keep the expressions alive during the run
    return ShaftResult(np.array(displacements), loop, time.perf_counter() - start)


def _select_solver(settings: exu.SimulationSettings, variant: str) -> None:
    if variant != "default":
        settings.timeIntegration.newton.useModifiedNewton = variant == "tuned"
    if variant == "tuned":
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse


def _sparse(matrix: FloatArray) -> exu.MatrixContainer:
    rows, cols = np.nonzero(matrix)
    stored = exu.MatrixContainer()
    stored.SetWithSparseMatrix(np.column_stack([rows, cols, matrix[rows, cols]]), *matrix.shape)
    return stored


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


def _loads(shaft: Shaft, frequency: float) -> tuple[tuple[float, Callable[..., object]], ...]:
    """Return amplitude and history of force and torque."""
    speed, symbolic = 2.0 * math.pi * frequency, exu.symbolic
    return (
        (shaft.force, lambda mbs, t, load: load * (1.0 - symbolic.cos(speed * t))),
        (shaft.torque, lambda mbs, t, load: load * symbolic.sin(speed * t)),
    )


def _load(system: exu.MainSystem, node: object, at: int, size: float, history: Callable[..., object]) -> object:
    marker = system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=at))
    load = system.AddLoad(LoadCoordinate(markerNumber=marker, load=size))
    compiled = CreateSymbolicUserFunction(system, history, "loadUserFunction", load)
    system.SetLoadParameter(load, "loadUserFunction", compiled)
    return compiled


def _settings(shaft: Shaft, step: float) -> exu.SimulationSettings:
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = shaft.steps
    settings.timeIntegration.endTime = shaft.steps * step
    settings.timeIntegration.generalizedAlpha.useNewmark = True  # 1/4 and 1/2 are its defaults
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = step
    return settings
