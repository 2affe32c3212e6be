"""A follower by itself, as a case writes it."""

from __future__ import annotations

from pydantic import ValidationError

from flexcam.cam import Follower, Turn
from flexcam.case.lines import Places
from flexcam.case.report import faults
from flexcam.case.tables.cams import FreeCamRecord
from flexcam.case.toml import toml
from flexcam.checks import InputError, refuse


def given_follower(follower: str, base_radius: str | None = None, *, clockwise: bool = False) -> tuple[Follower, Turn]:
    """Return the follower that a TOML table describes, and the sense of rotation of its cam."""
    try:
        table = toml(f"follower = {follower}")["follower"]
    except ValueError as fault:
        allowed = 'a table such as { type = "roller", radius = "9 mm" }'
        raise refuse("follower", follower, allowed, str(fault), "texts need quotes") from None
    given = {
        "follower": table,
        "base_radius": base_radius,
        "rotation": "clockwise" if clockwise else "counterclockwise",
    }
    try:
        cam = FreeCamRecord.model_validate(given).made()
    except ValidationError as refusal:
        raise InputError(faults(refusal.errors(include_url=False), Places({}), FreeCamRecord)) from None
    if cam.follower is None:
        raise refuse("base_radius", "nothing", "the radius of the base circle", "the lift counts from it", "give it")
    return cam.follower, cam.turn
