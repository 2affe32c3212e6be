"""What the train of a case did in a run, as far as the case's model knows it."""

from __future__ import annotations

import numpy as np

from flexcam.response import Response
from flexcam.runner.prepared import Prepared
from flexcam.train import Figure, operation

_FEW = ("sdof", "chain")
"""Models that keep of the camshaft what contacts feel, and of a published load, which feels none of it, nothing."""

_CAMSHAFT = ("cams.", "supports.")


def figures_of(ready: Prepared, response: Response) -> list[Figure]:
    """Return what a train did in the last revolution of a run, without what its model does not hold."""
    found = operation(ready.model, response, ready.revolution)
    if ready.case.record.fidelity.model not in _FEW:
        return found
    return [one for one in found if not one.name.startswith(_CAMSHAFT) or _moves(response, one)]


def _moves(response: Response, one: Figure) -> bool:
    values = response.channels[one.name.rpartition(".")[0]]
    return bool(np.ptp(values) > _STILL * np.abs(values).max())


_STILL = 1e-9
"""Part of a value by which rounding moves it."""
