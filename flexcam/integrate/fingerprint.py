"""Whether two problems are the same, told by a digest: a run goes on only with the one it began with."""

from __future__ import annotations

from hashlib import sha256

import numpy as np

from flexcam.integrate.local import LocalForces
from flexcam.integrate.method import Method
from flexcam.integrate.problem import Problem
from flexcam.response import SaveAt

_INSTANTS = 64
"""Of the run, at which loads and what the local forces sense are looked at."""

_BEGINNING, _APART = 8192, 13
"""Steps of its beginning, and every which of them is looked at too: those of the whole may stand at one cam angle."""


def fingerprint(problem: Problem, method: Method, save: SaveAt) -> str:
    """Return a digest of a problem: matrices, loads, prescribed motion, steps, method, and what is kept.

    The start is left out: it may come from iterations that another number of threads rounds otherwise, and a run that
    goes on does not begin there.
    """
    system = problem.system
    forces = LocalForces(system)
    spread = np.linspace(0, problem.steps, _INSTANTS).round().astype(np.intp)
    steps = np.union1d(spread, np.arange(0, min(problem.steps, _BEGINNING) + 1, _APART))
    motion = problem.drive.at(problem.times(steps))
    schedule = forces.schedule(motion)
    parts = [motion.angle, motion.speed, system.load_vectors(), system.load_histories(motion), forces.act.vectors]
    parts += [forces.sense.vectors, schedule.rows, forces.table.laws, forces.table.constants]
    for matrix in (system.mass, system.damping, system.stiffness):
        parts += [matrix.rows, matrix.cols, matrix.values]
    parts += [probe.rows for probe in system.probes]
    told = (method, save, problem.step, problem.steps, problem.adaptive, problem.prune, problem.engine, system.names)
    digest = sha256(repr((*told, forces.names)).encode())
    for part in parts:
        digest.update(repr(part.shape).encode() + np.ascontiguousarray(part).tobytes())
    return digest.hexdigest()
