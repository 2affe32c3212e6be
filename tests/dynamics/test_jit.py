"""Cache of compiled code: its folder, and runs with empty, damaged or missing cache and in two processes."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from flexcam.dynamics import jit
from flexcam.dynamics.kernel_step import PROGRAM

RUN_SCRIPT = """
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


def start_process(folder, run=RUN_SCRIPT):
    environment = {**os.environ, "FLEXCAM_CACHE": str(folder)}
    return subprocess.Popen([sys.executable, "-c", run], env=environment, stdout=subprocess.PIPE, text=True)


def read_output(process):
    out, _ = process.communicate(timeout=240)
    assert process.returncode == 0
    assert out.startswith("kernel done")
    return out


def test_cache_folder_from_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("FLEXCAM_CACHE", str(tmp_path))
    assert jit.cache_root() == tmp_path / "flexcam"
    monkeypatch.delenv("FLEXCAM_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    assert jit.cache_root() == tmp_path / ".cache/flexcam"


@pytest.mark.slow
def test_state_of_cache_does_not_change_results(tmp_path):
    together = [start_process(tmp_path), start_process(tmp_path)]  # both compile into an empty folder
    fresh, other = map(read_output, together)
    assert other == fresh
    together = [start_process(tmp_path), start_process(tmp_path)]
    assert [read_output(one) for one in together] == [fresh, fresh]
    for path in tmp_path.rglob("*.nb[ci]"):
        path.write_bytes(path.read_bytes()[:100])
    assert read_output(start_process(tmp_path)) == fresh
    assert read_output(start_process(Path("/dev/null"))) == fresh


ENGINE_SCRIPT = """
import hashlib
import flexcam
case = flexcam.read_case("cases/pushrod-engine/intake.toml", ["run.revolutions=2", "run.crank_speed=6700rpm"])
run = flexcam.run(case)
values = [run.fields.displacement, *run.probes, *run.channels.values()]
found = hashlib.sha256(b"".join(one.tobytes() for one in values)).hexdigest()
print(run.stats.engine, run.status.cause, found)
"""


@pytest.mark.slow
def test_fresh_and_cached_code_are_bit_identical(tmp_path):
    """Contacts amplify a difference in the last bit to hundreds of newtons within a few revolutions."""
    assert len({read_output(start_process(tmp_path, ENGINE_SCRIPT)) for _ in range(3)}) == 1


def test_extension_module_replaces_the_compiler(monkeypatch):
    module = ModuleType(PROGRAM.extension)
    for name, _ in PROGRAM.entries:
        setattr(module, name, object())
    monkeypatch.setitem(sys.modules, f"flexcam.dynamics.{PROGRAM.extension}", module)
    program = replace(PROGRAM)  # the original has looked for its module already
    assert program.compile() == {name: getattr(module, name) for name, _ in PROGRAM.entries}
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert program.load_extension() is None


class SwallowingCompiler:
    """Stand-in for a numba entry, which loses exceptions raised in a callback of LLVM."""

    compiled = False

    def compile(self, types):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            return
        self.compiled = True


def test_interrupt_is_raised_after_compilation():
    compiler = SwallowingCompiler()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite in the background ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            jit._Entry(compiler, ())()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert compiler.compiled


COMPILE_SCRIPT = """
import logging
import numpy as np
from flexcam.dynamics.jit import Program
from flexcam.dynamics.local_newton import eliminate

logging.basicConfig(level=logging.INFO, format="%(message)s")
Program((eliminate,), (("eliminate", "f2 i i"),)).compile()["eliminate"](np.ones((1, 2)), 1, 2)
"""


@pytest.mark.slow
def test_compilation_is_announced_once_per_installation(tmp_path):
    """The second process uses the cached code."""
    words, cache = [sys.executable, "-c", COMPILE_SCRIPT], {**os.environ, "FLEXCAM_CACHE": str(tmp_path)}
    first, second = (subprocess.run(words, env=cache, capture_output=True, text=True).stderr for _ in range(2))
    assert "compiling" in first
    assert "compiling" not in second
