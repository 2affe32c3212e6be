"""Lift of a measured cam profile, and the printed names of lift files."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import numpy as np
from rich.table import Table

from flexcam.analysis.cam_analysis import NEGATIVE_LIFT_TOLERANCE
from flexcam.cams import Bridge, Extreme, find_bridges, lift_from_profile
from flexcam.case.builder import parse_follower
from flexcam.cli.app import CommandOutput, check_distinct_files, parse_quantity, write_output
from flexcam.core import FloatArray
from flexcam.core.errors import positive, refuse
from flexcam.io import read_profile, write_lift_table
from flexcam.report.terminal import facts_table, format_mm

_MIN_POINTS, _MAX_POINTS = 12, 100_000


def lift_from_profile_table(
    name: str, points: int, angle: FloatArray, lift: FloatArray, hollow: Bridge | None
) -> Table:
    """Return the table of a lift computed from a profile."""
    low, high = (Extreme(float(lift[i]), float(angle[i])) for i in (int(np.argmin(lift)), int(np.argmax(lift))))
    rows = [
        ("points", str(points)),
        ("max lift", f"{format_mm(high.value)} mm at {math.degrees(high.at):.4g} deg"),
        ("min lift", f"{format_mm(low.value)} mm at {math.degrees(low.at):.4g} deg"),
    ]
    if low.value < -NEGATIVE_LIFT_TOLERANCE * high.value:
        rows.append(("warning", "the profile lies inside the base circle; check its radius and the unit"))
    if hollow is not None:
        place = f"{format_mm(hollow.point[0], 4)}, {format_mm(hollow.point[1], 4)} mm"
        said = f"the follower bridges a hollow of the profile, with a gap of {format_mm(hollow.depth, 3)} mm at {place}"
        rows.append(("warning", f"{said}; a smaller roller follows the profile"))
    return facts_table(f"Lift of {name}", rows)


def print_lift_of_profile(
    profile: Path, follower: str | None, base_radius: str | None, unit: Literal["um", "mm", "cm", "m", "in"] | None,
    clockwise: bool, points: int, output: Path | None, *, overwrite: bool, as_json: bool,
) -> None:  # fmt: skip
    """Print the lift of a follower on a profile given by points, and write it as a table, if requested."""
    check_distinct_files({"--output": output}, [profile])
    if follower is None:
        raise refuse("--follower", "nothing", "the follower as in a case, such as '{ type = \"flat\" }'")
    if base_radius is not None:
        positive("--base-radius", parse_quantity("--base-radius", base_radius, "length", "mm"), "m")
    if not _MIN_POINTS <= points <= _MAX_POINTS:
        raise refuse("--points", points, f"a whole number from {_MIN_POINTS} to {_MAX_POINTS}")
    made, turn = parse_follower(follower, base_radius, clockwise=clockwise)
    angle, xy = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False), read_profile(profile, unit=unit)
    lift, bridge = lift_from_profile(xy, made, angle, turn=turn), find_bridges(xy, made, turn=turn)
    files = [] if output is None else [write_lift_table(output, angle, lift, overwrite=overwrite)]
    json = {
        "points": len(xy), "angle": angle.tolist(), "lift": lift.tolist(),
        "bridged": None if bridge is None else asdict(bridge),
    }  # fmt: skip
    table = lift_from_profile_table(profile.name, len(xy), angle, lift, bridge)
    write_output(CommandOutput([table], json), as_json=as_json, written=files, describe_file=describe_lift_file)


def describe_lift_file(path: Path, phase: float = 0.0) -> str:
    """Return the name of a lift file, and the keys of a case with which it replaces the lift of a cam."""
    delay = f', phase = "{math.degrees(phase):.10g} deg"' if phase else ""
    keys = f'lift_table = "{path.name}"{delay} instead of the law with its keys, and phase, centreline, timing'
    return f"{path}  (in a case: {keys})"
