"""Sinks for tests of `solve`."""


class Cut:
    """A sink that raises `KeyboardInterrupt` after a number of blocks."""

    def __init__(self, after):
        self.remaining = after

    def write(self, block):
        self.remaining -= 1
        if self.remaining < 0:
            raise KeyboardInterrupt

    def close(self, status, stats):
        pass
