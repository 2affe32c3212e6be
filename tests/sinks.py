"""Sinks that tests hand to `solve`."""

from __future__ import annotations


class Cut:
    """A sink whose write is interrupted after so many blocks."""

    def __init__(self, after):
        self.left = after

    def write(self, block):
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt

    def close(self, status, stats):
        pass
