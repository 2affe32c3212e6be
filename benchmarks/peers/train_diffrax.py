"""C1 by two explicit methods of diffrax on the processor, compiled by XLA."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.train import FloatArray, Setting, Train, equations

jax.config.update("jax_enable_x64", True)

METHODS = {
    "diffrax, Tsit5": (diffrax.Tsit5(), (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)),
    "diffrax, Dopri8": (diffrax.Dopri8(), (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)),
}
FIRST_STEP, MAX_STEPS = 1e-6, 1_000_000
"""First step, s, and maximum number of steps."""


def settings(train: Train) -> Iterator[Setting]:
    """Yield the methods; one compilation serves all tolerances of a method."""
    for title, (solver, tolerances) in METHODS.items():
        compiled = jax.jit(partial(_integrate, train, solver))
        for tolerance in tolerances:
            yield Setting(title, f"tolerance {tolerance:.0e}", partial(_prepare, train, compiled, tolerance))


def _integrate(train: Train, solver: diffrax.AbstractSolver, start: jax.Array, tolerance: float) -> jax.Array:
    forces = equations(train, jnp.maximum, jnp.abs, jnp.sign).forces
    inverse = 1.0 / np.array(train.masses)

    def rates(t: jax.Array, y: jax.Array, _: None) -> jax.Array:
        return jnp.concatenate([y[3:], jnp.stack(forces(t, *y)) * inverse])

    control = diffrax.PIDController(rtol=tolerance, atol=1e-3 * tolerance, dtmax=train.max_step)
    save = diffrax.SaveAt(ts=jnp.array(train.times))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates), solver, 0.0, train.period, FIRST_STEP, start, saveat=save, stepsize_controller=control,
        max_steps=MAX_STEPS,
    )  # fmt: skip
    assert solution.ys is not None
    return solution.ys


def _prepare(train: Train, compiled: Callable[..., jax.Array], tolerance: float) -> Callable[[], FloatArray]:
    start = jnp.array(train.start)
    return lambda: np.asarray(compiled(start, tolerance).block_until_ready())
