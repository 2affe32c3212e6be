"""What all commands share: the application, its options, and what a signal handler and a running solution share."""

from __future__ import annotations

import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from flexcam import __version__
from flexcam.case import Case, read_case
from flexcam.checks import refuse
from flexcam.commands.unused import unused
from flexcam.terminal import note
from flexcam.units import RPM, parse


@dataclass
class Running:
    """What the signal handler and a running solution know of each other, and the command that is under way."""

    command: str = ""
    signals: list[int] = field(default_factory=list[int])
    solving: bool = False

    def stopped(self) -> bool:
        """Tell whether a signal asked the run to end."""
        return bool(self.signals)


running = Running()

CaseFile = Annotated[Path, Parameter(help="Case file (TOML).")]
ResultPath = Annotated[Path, Parameter(help="Result file (.vtkhdf).")]
Overrides = Annotated[
    list[str] | None,
    Parameter("--set", negative=(), help="Lay a value over the case's: run.speed=4000rpm. May be repeated."),
]
Json = Annotated[bool, Parameter("--json", negative=(), help="Print one JSON object.")]
Picture = Annotated[Path | None, Parameter("--plot", help="Also draw it (.svg, .png or .pdf).")]
Folder = Annotated[Path, Parameter(["-o", "--output"], help="Folder of the results.")]
Overwrite = Annotated[bool, Parameter("--overwrite", negative=(), help="Replace existing results.")]
AllowLarge = Annotated[
    bool, Parameter("--allow-large", negative=(), help="Run even if memory or disk seem too small for it.")
]


def _versions() -> str:
    runs_on = ("numpy", "scipy", "h5py", "meshio", "pydantic", "cyclopts")
    return f"flexcam {__version__}\npython {platform.python_version()}\n" + "\n".join(
        f"{n} {version(n)}" for n in runs_on
    )


app = App(
    name="flexcam",
    version=_versions,
    help_format="plaintext",
    help="Flexible valve trains and cam mechanisms by finite elements.",
    help_prologue="""\
flexcam check cases/tayeb/model-3-shm.toml
flexcam compare cases/tayeb/model-3-shm.toml --set run.speed=4000rpm
flexcam run cases/tayeb/model-3-shm.toml -o results
flexcam export results/model-3-shm.vtkhdf --format pvd
""",
    suppress_keyboard_interrupt=False,
)
app.register_install_completion_command()  # pyright: ignore[reportUnknownMemberType]


_BARE = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*$")


def quantity(where: str, text: str, dimension: str, unit: str) -> float:
    """Return the SI number of an option's text; a number without a unit is refused, for it would be taken as SI."""
    if _BARE.match(text) and float(text) != 0.0:
        allowed = f"a number with its unit, such as '{text.strip()} {unit}'"
        raise refuse(where, text, allowed, "a bare number could be anything", f"write '{text.strip()} {unit}'")
    return parse(text, dimension, where)


def load(path: Path, overrides: Sequence[str] | None) -> Case:
    """Read a case with the values of ``--set`` laid over it; what of it the command does not act on is told."""
    case = read_case(path, overrides or ())
    tell_unused(overrides, case)
    return case


def tell_unused(overrides: Sequence[str] | None, case: Case | None = None) -> None:
    """Tell what the command under way does not act on; of a file with cams alone, what is laid over it."""
    for sentence in unused(running.command, overrides or (), case):
        note(sentence)


def load_beams(path: Path, overrides: Sequence[str] | None) -> Case:
    """Read a case for a command that asks its beams; a case that asks for a coarser model is refused."""
    case = load(path, overrides)
    asked = case.record.fidelity
    for key, given, allowed in (("model", asked.model, "beams"), ("modes", asked.modes, None)):
        if given != allowed:
            why, remedy = "this is asked of all unknowns of the members", f"leave fidelity.{key} out"
            raise refuse(case.place(("fidelity", key)), str(given), "beams with every unknown", why, remedy)
    return case


def from_one(option: str, number: int) -> None:
    """Refuse a number of things that is none."""
    if number < 1:
        raise refuse(option, number, "a whole number from 1")


_MOST_SPEEDS = 10_000


def speed_range(
    lowest: str | None, highest: str | None, count: int, speed: float, scale: float, most: float = 1.5
) -> tuple[float, float]:
    """Return the speeds of the camshaft between which a command looks; from half to `most` times the case's."""
    if not 2 <= count <= _MOST_SPEEDS:
        raise refuse("--count", count, f"a whole number from 2 to {_MOST_SPEEDS}", "each speed is a run")
    low = 0.5 * speed if lowest is None else quantity("--lowest", lowest, "speed", "rpm") / scale
    high = most * speed if highest is None else quantity("--highest", highest, "speed", "rpm") / scale
    if not high > low:
        given = highest or f"{scale * high / RPM:g} rpm, {most:g} times that of the case"
        raise refuse("--highest", given, f"above the lowest speed, {scale * low / RPM:g} rpm")
    if not low > 0.0:
        raise refuse("--lowest", lowest, "a speed above zero")
    return low, high


def bracket(option: str, text: str, scale: float) -> float:
    """Return how closely a speed is looked for, of the camshaft in rad/s."""
    width = quantity(option, text, "speed", "rpm") / scale
    if not width > 0.0:
        raise refuse(option, text, "a speed above zero", "a bracket is halved until it is as narrow")
    return width


def free_picture(plot: Path | None, overwrite: bool) -> None:
    """Refuse a picture that could not be written, before anything is computed."""
    if plot is not None:
        from flexcam.view import free_for_picture

        free_for_picture(plot, overwrite=overwrite)
