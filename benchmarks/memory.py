"""The largest memory that work takes, with Python and libraries."""

from __future__ import annotations

import subprocess
import sys

from benchmarks.processes import ROOT

# Not of `resource`: there a new process begins with the peak of the one that made it.
_READ = "print(next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')))"


def peak(statements: str) -> int:
    """Run statements in a process of their own and return the most memory it held, MB (Linux)."""
    done = subprocess.run(
        [sys.executable, "-c", f"{statements}\n{_READ}"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    return round(int(done.stdout.split()[-1]) / 1024.0)
