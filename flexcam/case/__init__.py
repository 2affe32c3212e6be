"""Case files: TOML text to checked records in SI, and from them the model.

May import `train`, `io` and everything below them; owns pydantic.
A new key is a field of a record in `tables`, acted on in `build`, or in `starting` and `runner` where it is one of a
run; the page of the format is made from the records.
"""

from flexcam.case.build import build_model
from flexcam.case.case import Case
from flexcam.case.follower import given_follower
from flexcam.case.motions import GivenLaw, GivenLift, given_law, law_file
from flexcam.case.plausible import unusual
from flexcam.case.read import CaseFile, read_cams, read_case, recalled_case
from flexcam.case.records import CamsRecord, CaseRecord
from flexcam.case.starters import new_case, templates

__all__ = [
    "CamsRecord",
    "Case",
    "CaseFile",
    "CaseRecord",
    "GivenLaw",
    "GivenLift",
    "build_model",
    "given_follower",
    "given_law",
    "law_file",
    "new_case",
    "read_cams",
    "read_case",
    "recalled_case",
    "templates",
    "unusual",
]
