"""Blocks of modal steps equal single steps, for slow and stiff modes and all integrators."""

import mpmath
import numpy as np
import pytest

from flexcam.core import Triplets
from flexcam.dynamics import System, newmark
from flexcam.dynamics.modal_engine import ModalStep, StepBlock, drop_vanished
from tests.integrators import SCHEMES

OMEGA = np.array([0.0, 1e-5, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6])
"""Angular frequencies times a step of 1 s: from a free motion to one that follows its load quasi-statically."""


def modal_step(scheme, ratio=0.0, omega=OMEGA):
    rows = np.ones_like(omega), 2.0 * ratio * omega, omega**2
    mass, damping, stiffness = (Triplets.from_dense(np.diag(row)) for row in rows)
    return ModalStep.of(scheme, System(mass, damping, stiffness, ("",) * len(omega)), 1.0)


def single_steps(steps, begin, loads):
    pushed = steps.modal_forces(loads)
    found = np.empty((3, *pushed.shape))
    steps.walk(begin, pushed, found)
    return found


@pytest.mark.parametrize("ratio", [0.0, 0.05])
@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("length", [1, 20, 33])
def test_block_equals_single_steps(name, ratio, length):
    """Loads, states and their responses within and after blocks, to some roundings per step."""
    steps, rng, count = modal_step(SCHEMES[name], ratio), np.random.default_rng(1), 3
    stride, n = StepBlock.of(steps, length), len(OMEGA)
    begin, loads = rng.normal(size=(3, n)), rng.normal(size=(count * length + 1, n))
    push = steps.load_factor * loads
    rising = np.array([push[b * length : (b + 1) * length + 1] - push[b * length] for b in range(count)])
    ends = np.einsum("bmn,smn->bsn", rising[:, :0:-1], stride.answer)
    causes = np.empty((count + 1, 3, n))
    causes[0] = stride.causes(begin, push[0])
    stride.advance(begin, push[::length], causes, ends)
    within = np.einsum("sjcn,bcn->bsjn", stride.by_cause, causes[:-1])
    for step in range(length):  # a change of the load acts from this step on
        change = rising[:, step + 1, None, None]
        within[:, :, step:] += change * stride.answer[:, : length - step]
    within[:, 0] += np.concatenate([begin[None], ends[:-1]])[:, 0, None]
    expected = single_steps(steps, begin, loads)
    size = np.abs(expected).max(axis=1)
    allowed = 1e-13 * count * length * size + 1e-13 * np.abs(begin)
    assert (np.abs(np.concatenate(within, axis=1) - expected).max(axis=1) <= allowed).all()
    assert (np.abs(ends - expected[:, length - 1 :: length].swapaxes(0, 1)) <= allowed).all()


def exact_change(scheme, omega, length):
    """Return ``A^L - 1`` of an undamped mode with fifty digits."""
    with mpmath.workdps(50):
        w, one = mpmath.mpf(omega) ** 2, mpmath.mpf(1)
        beta, gamma, alpha_m, alpha_f = (mpmath.mpf(getattr(scheme, name)) for name in PARAMETERS)
        drift, speed = mpmath.matrix([[1, 1, one / 2 - beta]]), mpmath.matrix([[0, 1, 1 - gamma]])
        pull = 1 - alpha_m + (1 - alpha_f) * beta * w
        accel = -(mpmath.matrix([[alpha_f * w, 0, alpha_m]]) + (1 - alpha_f) * w * drift) / pull
        A = mpmath.matrix([list(drift + beta * accel), list(speed + gamma * accel), list(accel)])
        return np.array((A**length - mpmath.eye(3)).tolist(), dtype=float)


PARAMETERS = ("beta", "gamma", "alpha_m", "alpha_f")


@pytest.mark.parametrize("omega", [1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("name", SCHEMES)
def test_block_of_slow_mode_is_accurate(name, omega):
    """The change within a block is a small part of the state; it has all digits, unlike the difference of states."""
    steps = modal_step(SCHEMES[name], omega=np.array([omega]))
    stride = StepBlock.of(steps, 32)
    found = stride.change[:, :, 0] * [-steps.stiffness[0], 1.0, 1.0]  # a displacement acts like a negative load
    np.testing.assert_allclose(found, exact_change(SCHEMES[name], omega, 32), rtol=1e-12, atol=1e-300)


def test_unstable_mode_has_no_block():
    """Newmark's method with beta 1/12 above its stability limit, sqrt(6)."""
    assert StepBlock.of(modal_step(newmark(beta=1.0 / 12.0), omega=np.array([2.4])), 32) is not None
    assert StepBlock.of(modal_step(newmark(beta=1.0 / 12.0), omega=np.array([3.0])), 32) is None


def test_decayed_state_is_zero():
    """The state does not decay to subnormal numbers, which are a hundred times slower; checked after every block."""
    steps = modal_step(newmark(), 0.9, np.array([1.0]))
    stride, state = StepBlock.of(steps, 32), np.ones((3, 1))
    for _ in range(12):
        state = drop_vanished(state)
        assert (state == 0.0).all() or np.abs(state).max() > 1e-150
        causes, ends = np.empty((17, 3, 1)), np.zeros((16, 3, 1))
        causes[0] = stride.causes(state, np.zeros(1))
        stride.advance(state, np.zeros((17, 1)), causes, ends)
        state = ends[-1]
    assert (drop_vanished(state) == 0.0).all()
