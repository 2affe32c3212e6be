"""Case files: TOML text to checked records in SI, and from them the model.

May import `train`, `io`, `fem`, `motion`, `units` and `checks`; owns pydantic.
A new key is a field in `records`, acted on in `build` (or in `flexcam.run`), and a line in the format's page.
"""

from flexcam.case.build import build_model
from flexcam.case.read import Case, read_case
from flexcam.case.records import CaseRecord

__all__ = ["Case", "CaseRecord", "build_model", "read_case"]
