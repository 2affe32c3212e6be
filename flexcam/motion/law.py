"""What a motion law is: a rise from 0 to 1 over 0 to 1, with its derivatives."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from flexcam.linalg import FloatArray


class Law(Protocol):
    """Normalized motion law s(z), s(0) = 0 and s(1) = 1.

    A law is a frozen dataclass with its parameters as fields. Where a derivative jumps, the value is that to the
    right (at z = 1 that to the left).
    """

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions inside 0 to 1 where a derivative jumps."""
        ...

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order (0 to 4) at positions z from 0 to 1, shape as `z`."""
        ...


@runtime_checkable
class ClosedResidual(Protocol):
    """A law that knows its residual vibration in closed form."""

    def residual(self, ratio: FloatArray) -> FloatArray:
        """Return the amplitude over the lift for rise times of so many periods of the oscillator, above zero."""
        ...
