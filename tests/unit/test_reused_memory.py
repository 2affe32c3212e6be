"""Memory that was freed is used again: a second block of steps asks the system for none."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

FAULTS = """
import resource, sys
import numpy as np
from flexcam.memory import reuse

def block():
    arrays = [np.ones(200_000) for _ in range(8)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

if sys.argv[1] == "reuse":
    reuse()
block()
first = block()
print(block() - first)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="what glibc does with freed memory")
def test_a_second_block_takes_the_memory_of_the_first():
    """13 MB in eight arrays are 3125 pages."""
    faults = {
        way: int(subprocess.run([sys.executable, "-c", FAULTS, way], capture_output=True, check=True, text=True).stdout)
        for way in ("plain", "reuse")
    }
    assert faults["reuse"] < 300 < 1000 < faults["plain"]
