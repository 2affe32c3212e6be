"""What endangers a case over a range of speeds."""

from __future__ import annotations

from collections.abc import Iterable

from flexcam.case import Case
from flexcam.response import Advance, counted
from flexcam.stability.verdict import Stability, stability


def over_speeds(case: Case, speeds: Iterable[float], *, advance: Advance | None = None) -> list[Stability]:
    """Return what endangers a case at several speeds: growth rates as a map, causes beside them.

    Parameters
    ----------
    case
        The case; its own speed does not count.
    speeds
        Of the camshaft, rad/s.
    advance
        Told after each speed that one more is finished.

    Returns
    -------
    list
        One per speed, in their order.

    Raises
    ------
    InputError
        If parts do not fit together.
    RunFailedError
        If a run cannot even start.

    Examples
    --------
    ``[one.verdict for one in over_speeds(case, [100.0, 200.0])]``
    """
    return [stability(case.at_speed(speed)) for speed in counted(speeds, advance)]
