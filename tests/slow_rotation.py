"""Run the slow tests file by file for a given time, beginning at another file every day."""

from __future__ import annotations

import subprocess
import sys
import time
from datetime import UTC, datetime

LEAST = 10.0
"""Seconds without which no further file is begun."""


def slow_files() -> list[str]:
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "slow", "tests"]
    listed = subprocess.run(command, capture_output=True, text=True, check=False)
    if listed.returncode not in (0, 5):  # 5: nothing was selected
        raise SystemExit(listed.stdout + listed.stderr)
    return sorted({line.partition("::")[0] for line in listed.stdout.splitlines() if "::" in line})


def main(seconds: float) -> int:
    files = slow_files()
    first = datetime.now(UTC).timetuple().tm_yday % max(len(files), 1)
    end = time.monotonic() + seconds
    done = 0
    for name in files[first:] + files[:first]:
        left = end - time.monotonic()
        if left < LEAST:
            break
        try:
            if subprocess.run(
                [sys.executable, "-m", "pytest", "-q", "-m", "slow", name], check=False, timeout=left
            ).returncode:
                return 1
        except subprocess.TimeoutExpired:
            break
        done += 1
    sys.stdout.write(f"{done} of {len(files)} slow files run to their end\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 480.0))
