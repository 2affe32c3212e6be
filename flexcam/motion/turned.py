"""A law turned about its middle: what comes last comes first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexcam.linalg import FloatArray
from flexcam.motion.law import Law


@dataclass(frozen=True)
class Turned:
    """s(z) = 1 - u(1 - z); a symmetric law is its own.

    R. Roussev, B. Paleva-Kadiyska and V. Galabov, Quinquinomial power functions (2021), eq. 1, turn their laws so for
    the cam that dwells only below.

    Parameters
    ----------
    law
        The law u.
    """

    law: Law

    @property
    def breaks(self) -> tuple[float, ...]:
        """Positions of inner jumps."""
        return tuple(sorted(1.0 - at for at in self.law.breaks))

    def __call__(self, z: FloatArray, order: int = 0) -> FloatArray:
        """Return the derivative of the given order at z; at a jump that to the right, which is u's to the left."""
        mirrored = 1.0 - z
        for at in self.law.breaks:
            mirrored = np.where(z == 1.0 - at, np.nextafter(at, 0.0), mirrored)
        turned = (-1.0) ** (order + 1) * self.law(mirrored, order)
        return 1.0 + turned if order == 0 else turned
