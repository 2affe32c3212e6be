"""C1 by CVODES of SUNDIALS in CasADi, with BDF and Adams methods; CasADi evaluates its own expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import casadi as ca
import numpy as np

from benchmarks.peers.train import FloatArray, Setting, Train, equations

METHODS = {
    "CVODES (CasADi), BDF": {"linear_multistep_method": "bdf", "newton_scheme": "direct"},
    "CVODES (CasADi), Adams": {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"},
}
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


def settings(train: Train) -> Iterator[Setting]:
    """Yield both methods."""
    for title, options in METHODS.items():
        for tolerance in TOLERANCES:
            yield Setting(title, f"tolerance {tolerance:.0e}", partial(_prepare, train, options, tolerance))


def _prepare(train: Train, options: dict[str, str], tolerance: float) -> Callable[[], FloatArray]:
    y, t = ca.SX.sym("y", 6), ca.SX.sym("t")
    forces = equations(train, ca.fmax, ca.fabs, ca.sign).forces(t, *(y[i] for i in range(6)))
    rates = [force / mass for force, mass in zip(forces, train.masses, strict=True)]
    equation = {"x": y, "t": t, "ode": ca.vertcat(y[3:], *rates)}
    tolerances = {
        "reltol": tolerance,
        "abstol": 1e-3 * tolerance,
        "max_step_size": train.max_step,
        "max_num_steps": 1_000_000,
    }
    integrate = ca.integrator("train", "cvodes", equation, 0.0, train.times[1:], tolerances | options)
    start = train.start
    return lambda: np.vstack([start, np.array(integrate(x0=start)["xf"]).T])
