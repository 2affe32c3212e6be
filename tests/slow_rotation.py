"""Run the slow tests file by file for a given time, beginning at another file every day."""

from __future__ import annotations

import subprocess
import sys
import time
from datetime import UTC, datetime

SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 480.0


def slow_files() -> list[str]:
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "slow"]
    listed = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    return sorted({line.partition("::")[0] for line in listed.splitlines() if "::" in line})


def main() -> int:
    files = slow_files()
    first = datetime.now(UTC).timetuple().tm_yday % max(len(files), 1)
    end = time.monotonic() + SECONDS
    for done, name in enumerate(files[first:] + files[:first]):
        left = end - time.monotonic()
        if left < 10.0:
            sys.stdout.write(f"time is up after {done} of {len(files)} slow files\n")
            return 0
        command = [sys.executable, "-m", "pytest", "-q", "-m", "slow", name]
        try:
            if subprocess.run(command, check=False, timeout=left).returncode:
                return 1
        except subprocess.TimeoutExpired:
            sys.stdout.write(f"time is up within {name}\n")
            return 0
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
