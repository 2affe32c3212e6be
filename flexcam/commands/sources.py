"""What is drawn and reported: result files, and cases that are run for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from flexcam.cams import CamSet, load_cams
from flexcam.case import Case, build_model, recalled_case
from flexcam.case.read import holds_mechanism
from flexcam.checks import refuse
from flexcam.commands.app import load
from flexcam.console.words import told_apart
from flexcam.integrate import solve
from flexcam.io import Result, read_result
from flexcam.reopened import reopened
from flexcam.response import Response, heed
from flexcam.runner import Prepared, prepare
from flexcam.terminal import progress
from flexcam.train import Cam

RESULT = ".vtkhdf"


@dataclass(frozen=True, eq=False)
class Source:
    """A result file, or a case that is run once its response is asked for.

    Parameters
    ----------
    path
        Of the file.
    overrides
        Laid over the case.
    """

    path: Path
    overrides: tuple[str, ...] = ()

    @cached_property
    def result(self) -> Result | None:
        """The result file; None for a case."""
        return read_result(self.path) if self.path.suffix == RESULT else None

    @cached_property
    def case(self) -> Case:
        """The case, of a result that which it keeps."""
        return load(self.path, self.overrides) if self.result is None else recalled_case(self.result)

    @cached_property
    def ready(self) -> Prepared:
        """The case, ready to run."""
        return prepare(self.case) if self.result is None else reopened(self.case, self.result)[0]

    @cached_property
    def response(self) -> Response:
        """What the result holds, or what a run of the case gives."""
        return _solved(self.ready) if self.result is None else self.result.response

    @cached_property
    def rigid(self) -> Response:
        """The same with rigid members."""
        return _solved(prepare(self.case, rigid=True))

    @cached_property
    def alone(self) -> CamSet | None:
        """The cams of a file that has nothing else; None for a result, and for a case with its mechanism."""
        if self.path.suffix == RESULT or holds_mechanism(self.path):
            return None
        return load_cams(self.path, self.overrides)

    @property
    def cams(self) -> Mapping[str, Cam]:
        """Its cams, by name."""
        return build_model(self.case).cams if self.alone is None else self.alone.cams

    @property
    def subject(self) -> str:
        """What the case, or the file of cams, is called."""
        return self.case.title if self.alone is None else self.alone.title or self.stem

    @property
    def stem(self) -> str:
        """Name of the file without its endings."""
        return self.path.name.partition(".")[0]

    @property
    def title(self) -> str:
        """What the case is called, with its speed."""
        return f"{self.case.record.title or self.stem}, {self.case.told_speed}"


def _solved(ready: Prepared) -> Response:
    with progress(ready.problem.steps) as bar:
        response = solve(ready.problem, ready.scheme, save=ready.save, sinks=bar)
    heed(response.status)
    return response


def opened(paths: Sequence[Path], overrides: Sequence[str] | None, *, cams: bool = False) -> list[Source]:
    """Return the sources of some files; what cannot be read is refused before anything is computed.

    Where `cams` are asked for, a file with cams alone will do.
    """
    if not paths:
        raise refuse("command line", "no file", "one or more results (.vtkhdf) or cases (.toml)")
    if overrides and any(path.suffix == RESULT for path in paths):
        raise refuse("--set", overrides[0], "cases alone", "a result has been computed", "give the case, or run it")
    found = [Source(path, tuple(overrides or ())) for path in paths]
    for one in found:
        _ = one.result or (cams and one.alone) or one.case
    return found


def named(sources: Sequence[Source]) -> dict[str, Source]:
    """Return sources by what tells them apart: nothing for a single one, else file name, speed or number."""
    if len(sources) == 1:
        return {"": sources[0]}
    speeds = ["" if one.alone else one.case.told_speed for one in sources]
    return dict(zip(told_apart([one.stem for one in sources], speeds), sources, strict=True))
