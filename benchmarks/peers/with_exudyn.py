"""Exudyn, tuned: sparse matrices, modified Newton, the build without range checks."""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.peers.work import FloatArray, Result, Work

sys.exudynFast = True  # asked for before the import

import exudyn as exu  # noqa: E402

from benchmarks.peers.exudyn_model import at_all_speeds  # noqa: E402


def run(work: Work) -> Result:
    """Integrate at all speeds."""
    return at_all_speeds(work, _tuned, _sparse)


def _tuned(settings: exu.SimulationSettings) -> None:
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse


def _sparse(matrix: FloatArray) -> exu.MatrixContainer:
    rows, cols = np.nonzero(matrix)
    stored = exu.MatrixContainer()
    stored.SetWithSparseMatrix(np.column_stack([rows, cols, matrix[rows, cols]]), *matrix.shape)
    return stored
