"""Compiled code: where it is kept, and runs without a cache, with a spoiled one and in two processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from flexcam.dynamics import jit

RUN = """
import numpy as np
from flexcam.dynamics import Problem, newmark, solve
from flexcam.core import Triplets
from flexcam.dynamics import ConstantSpeed, Load, Probe, System
one, row = Triplets.from_dense([[1.0]]), np.ones(1)
push = Load("push", row, lambda motion: np.sin(motion.angle))
system = System(one, Triplets.zeros(1), one, ("x",), (push,), probes=(Probe("x", ("x",), np.eye(1), (None,)),))
run = solve(Problem(system, ConstantSpeed(3.0), 0.01, 100, engine="kernel"), newmark())
print(run.stats.engine, run.status.cause, run["x"].displacement[-1].hex())
"""


def start(folder, run=RUN):
    environment = {**os.environ, "FLEXCAM_CACHE": str(folder)}
    return subprocess.Popen([sys.executable, "-c", run], env=environment, stdout=subprocess.PIPE, text=True)


def output(process):
    out, _ = process.communicate(timeout=240)
    assert process.returncode == 0
    assert out.startswith("kernel done")
    return out


def test_the_cache_is_in_the_folder_that_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("FLEXCAM_CACHE", str(tmp_path))
    assert jit.cache_root() == tmp_path / "flexcam"
    monkeypatch.delenv("FLEXCAM_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert jit.cache_root() == tmp_path / ".cache/flexcam"


@pytest.mark.slow
def test_fresh_cached_spoiled_and_missing_code_give_the_same_numbers(tmp_path):
    together = [start(tmp_path), start(tmp_path)]  # both compile into an empty folder
    fresh, other = map(output, together)
    assert other == fresh
    together = [start(tmp_path), start(tmp_path)]
    assert [output(one) for one in together] == [fresh, fresh]
    for path in tmp_path.rglob("*.nb[ci]"):
        path.write_bytes(path.read_bytes()[:100])
    assert output(start(tmp_path)) == fresh
    assert output(start(Path("/dev/null"))) == fresh


ENGINE = """
import hashlib
import flexcam
case = flexcam.read_case("cases/pushrod-engine/intake.toml", ["run.revolutions=2", "run.crank_speed=6700rpm"])
run = flexcam.run(case)
values = [run.fields.displacement, *run.probes, *run.channels.values()]
found = hashlib.sha256(b"".join(one.tobytes() for one in values)).hexdigest()
print(run.stats.engine, run.status.cause, found)
"""


@pytest.mark.slow
def test_an_engine_gives_the_same_bits_with_fresh_and_with_cached_code(tmp_path):
    """Contacts amplify a difference in the last bit to hundreds of newtons within a few revolutions."""
    assert len({output(start(tmp_path, ENGINE)) for _ in range(3)}) == 1


class SwallowingCompiler:
    """Stands for an entry of numba, which loses an exception raised in a callback of LLVM."""

    compiled = False

    def compile(self, types):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            return
        self.compiled = True


def test_an_interrupt_is_raised_after_compilation():
    compiler = SwallowingCompiler()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite in the background ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            jit._Entry(compiler)()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert compiler.compiled


ANNOUNCED = """
import logging
import numpy as np
from flexcam.dynamics.jit import compile_functions
from flexcam.dynamics.local_newton import eliminate

logging.basicConfig(level=logging.INFO, format="%(message)s")
compile_functions((eliminate,), ("eliminate",))["eliminate"](np.ones((1, 2)), 1, 2)
"""


@pytest.mark.slow
def test_compilation_is_announced_once_per_installation(tmp_path):
    """The second process finds the compiled code."""
    words, cache = [sys.executable, "-c", ANNOUNCED], {**os.environ, "FLEXCAM_CACHE": str(tmp_path)}
    first, second = (subprocess.run(words, env=cache, capture_output=True, text=True).stderr for _ in range(2))
    assert "compiling" in first
    assert "compiling" not in second
