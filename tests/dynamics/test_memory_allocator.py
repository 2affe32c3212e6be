"""A run does not change how the memory allocator of the process treats freed memory."""

import platform
import subprocess
import sys

import pytest

FAULTS_SCRIPT = """
import resource, sys
import numpy as np
from flexcam.dynamics import Problem, newmark, solve
from flexcam.core import Triplets
from flexcam.dynamics import ConstantSpeed, System

def block():
    arrays = [np.ones(200_000) for _ in range(8)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

if sys.argv[1] == "run":
    one = Triplets.from_dense([[1.0]])
    solve(Problem(System(one, one, one, ("x",)), ConstantSpeed(1.0), step=0.01, steps=10), newmark())
block()
first = block()
print(block() - first)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="what glibc does with freed memory")
def test_run_does_not_change_memory_allocator():
    """Eight arrays of 1.6 MB are 3125 pages; glibc retains such blocks only after larger ones were freed."""
    faults = {
        way: int(
            subprocess.run(
                [sys.executable, "-c", FAULTS_SCRIPT, way], capture_output=True, check=True, text=True
            ).stdout
        )
        for way in ("plain", "run")
    }
    assert faults["plain"] > 1000
    assert abs(faults["run"] - faults["plain"]) < 300
