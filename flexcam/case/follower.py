"""A follower by itself, as a case writes it."""

from __future__ import annotations

from pydantic import ValidationError

from flexcam.cam import Follower, Turn
from flexcam.case import quantity as q
from flexcam.case.lines import Places
from flexcam.case.report import faults
from flexcam.case.tables.base import Record
from flexcam.case.tables.cams import FollowerRecord
from flexcam.case.toml import toml
from flexcam.checks import InputError, refuse


class _AloneRecord(Record):
    """A follower and the base circle it stands on."""

    follower: FollowerRecord
    base_radius: q.Length | None = None


def given_follower(follower: str, base_radius: str | None = None, *, clockwise: bool = False) -> tuple[Follower, Turn]:
    """Return the follower that a TOML table describes, and the sense of rotation of its cam."""
    try:
        table = toml(f"follower = {follower}")["follower"]
    except ValueError as fault:
        allowed = 'a table such as { type = "roller", radius = "9 mm" }'
        raise refuse("follower", follower, allowed, str(fault), "texts need quotes") from None
    try:
        alone = _AloneRecord.model_validate({"follower": table, "base_radius": base_radius})
    except ValidationError as refusal:
        raise InputError(faults(refusal.errors(include_url=False), Places({}), _AloneRecord)) from None
    made = alone.follower.made(alone.base_radius)
    if made is None:
        raise refuse("base_radius", "nothing", "the radius of the base circle", "the lift counts from it", "give it")
    return made, -1 if clockwise else 1
