"""Run the slow tests file by file, in two processes, for a given time; every day begins with other files."""

from __future__ import annotations

import subprocess
import sys
import time
from datetime import UTC, datetime

MIN_SECONDS = 10.0
"""Minimum remaining time to start another file."""
STRIDE = 20
"""Number of files by which the first one moves every day. Two idle cores completed 37 files in 300 s."""


def slow_files() -> list[str]:
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "slow", "tests"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode not in (0, 5):  # 5: nothing was selected
        raise SystemExit(result.stdout + result.stderr)
    return sorted({line.partition("::")[0] for line in result.stdout.splitlines() if "::" in line})


def main(seconds: float) -> int:
    files = slow_files()
    first = STRIDE * datetime.now(UTC).timetuple().tm_yday % max(len(files), 1)
    end = time.monotonic() + seconds
    completed = 0
    for name in files[first:] + files[:first]:
        remaining = end - time.monotonic()
        if remaining < MIN_SECONDS:
            break
        try:
            if subprocess.run(
                [sys.executable, "-m", "pytest", "-q", "-m", "slow", "-n", "2", "--dist", "worksteal", name],
                check=False,
                timeout=remaining,
            ).returncode:
                return 1
        except subprocess.TimeoutExpired:
            break
        completed += 1
    sys.stdout.write(f"{completed} of {len(files)} slow files completed\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 240.0))
