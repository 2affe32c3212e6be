"""What is fed with changed input, and what may come of it: accepted or refused, in flexcam's own words."""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import numpy as np

from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import prepare
from flexcam.cams import lift_table
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import read_cams, read_case
from flexcam.cli.main import main
from flexcam.core.errors import InputError
from flexcam.dynamics import Response, RunFailedError, solve
from flexcam.io import read_lift, read_mesh, read_profile, read_result
from flexcam.studies.tables import read_table
from tests.fuzz import damage, mutate

ROOT = Path(__file__).parents[2]
STEPS, LARGE, CONTACT = 3, 3000, 10
"""Steps that an accepted case is run for; elements above which it is not."""


class BrokenError(AssertionError):
    """Something that must not happen: no words in a refusal, no number in an output, a wrong number."""


def told(refusal: InputError) -> str:
    """Return ``refused``, if the refusal says where, what was given and what is allowed."""
    if not refusal.faults or not all(fault.where and fault.given and fault.allowed for fault in refusal.faults):
        raise BrokenError(f"an empty refusal: {refusal}")
    return "refused"


def _large(read: Case) -> bool:
    """Tell whether a case is sound and so large that it would run for minutes, which is what was asked."""
    record = read.record
    coils = sum(one.elements for one in record.springs.values())
    return sum(one.elements for one in record.members.values()) + CONTACT * coils > LARGE


def _finite(response: Response) -> None:
    arrays = [response.time, response.angle, response.probes.displacement, response.fields.acceleration]
    if not all(np.isfinite(array).all() for array in [*arrays, *response.channels.values()]):
        raise BrokenError("an output that is not finite")


def case(path: Path, random: Random) -> str:
    """Read a case, build it, and run a few steps of it."""
    del random
    read = read_case(path)
    if _large(read):
        return "accepted"
    if read.record.run.start == "periodic":
        read = read.with_run({"start": "equilibrium"})
    ready = prepare(read)
    try:
        _finite(solve(replace(ready.problem, steps=min(STEPS, ready.problem.steps)), ready.scheme, save=ready.save))
    except RunFailedError:
        return "failed"
    modes(read, 3)
    build_model(read)
    return "accepted"


def command(path: Path, random: Random) -> str:
    """Run a command line on a case, to its exit code."""
    words = random.choice((["check"], ["check", "--json"], ["modes"], ["compare", "--json"], ["cam"]))
    with contextlib.suppress(InputError):
        if _large(read_case(path)):
            return "accepted"
    said, wrong = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(wrong):
            main([*words[:1], str(path), *words[1:], "--set", "run.revolutions=0.02"])
    except SystemExit as ended:
        if ended.code not in (0, 2, 3):
            raise BrokenError(f"exit code {ended.code}: {wrong.getvalue()}") from None
        if "Traceback" in wrong.getvalue() or "NaN" in said.getvalue():
            raise BrokenError(said.getvalue()[-500:] + wrong.getvalue()[-500:]) from None
        return {0: "accepted", 2: "refused", 3: "failed"}[ended.code]
    raise BrokenError("no exit code")


def cams(path: Path, random: Random) -> str:
    """Read a file of cams."""
    del random
    for one in read_cams(path).cams.values():
        _ = one.part
    return "accepted"


def mesh(path: Path, random: Random) -> str:
    """Read a mesh."""
    del random
    if not np.isfinite(read_mesh(path).nodes).all():
        raise BrokenError("a node that is nowhere")
    return "accepted"


def lift(path: Path, random: Random) -> str:
    """Read a measured lift and make an event of it."""
    del random
    columns = read_lift(path)
    event, _ = lift_table(columns.angle, columns.lift)
    if not np.isfinite([event(np.linspace(0.0, 7.0, 99), order) for order in (0, 1, 2)]).all():
        raise BrokenError("a lift that is not finite")
    return "accepted"


def profile(path: Path, random: Random) -> str:
    """Read the points of a profile."""
    del random
    if not np.isfinite(read_profile(path, unit="mm")).all():
        raise BrokenError("a point that is nowhere")
    return "accepted"


def result(path: Path, random: Random) -> str:
    """Read a result: either all that is read is what was written, or it is refused."""
    del random
    if difference := damage.result_differs(read_result(path), _sound("result")):
        raise BrokenError(f"silently wrong: {difference}")
    return "accepted"


def table(path: Path, random: Random) -> str:
    """Read the table of a sweep: either all is what was written, or it is refused."""
    del random
    if difference := damage.table_differs(read_table(path), _sound("table")):
        raise BrokenError(f"silently wrong: {difference}")
    return "accepted"


@dataclass(frozen=True)
class Target:
    """Something to be fed.

    Parameters
    ----------
    feed
        Takes a path and says what came of it; raises where something is broken.
    seeds
        Sound files, from which the inputs are made.
    share
        Of all inputs.
    binary
        Whether bytes are changed and not texts.
    """

    feed: Callable[[Path, Random], str]
    seeds: tuple[Path, ...]
    share: int
    binary: bool = False


def _cases() -> tuple[Path, ...]:
    found = [
        *(ROOT / "cases").rglob("*.toml"),
        *(ROOT / "tests/data").glob("*.toml"),
        *(ROOT / "flexcam/templates").glob("*.toml"),
    ]
    return tuple(sorted(path for path in found if path.parent.name != "cams" and path.name != "every-cam.toml"))


def _folder() -> Path:
    """Return the folder of the seeds that are made: one for a process and those that it starts."""
    if _SEEDS not in os.environ:
        os.environ[_SEEDS] = tempfile.mkdtemp(prefix="flexcam-fuzz-seeds-")
        atexit.register(shutil.rmtree, os.environ[_SEEDS], ignore_errors=True)
    return Path(os.environ[_SEEDS])


_SEEDS = "FLEXCAM_FUZZ_SEEDS"
MADE = _folder()


def _sound(kind: str) -> object:
    """Return the sound result or table, read once."""
    if kind not in _READ:
        _READ[kind] = read_result(MADE / "small.vtkhdf") if kind == "result" else read_table(MADE / "small.sweep.h5")
    return _READ[kind]


_READ: dict[str, object] = {}


def make_seeds() -> None:
    """Make the seeds that are made by flexcam: meshes in binary, a result, the table of a sweep."""
    damage.make_seeds(MADE)


TARGETS = {
    "case": Target(case, _cases(), 40),
    "command": Target(command, _cases(), 12),
    "cams": Target(cams, (*sorted((ROOT / "cases/cams").glob("*.toml")), ROOT / "tests/data/every-cam.toml"), 3),
    "mesh": Target(mesh, (MADE / "ascii22.msh", MADE / "ascii41.msh"), 12),
    "binary mesh": Target(mesh, (MADE / "binary22.msh", MADE / "binary41.msh"), 5, binary=True),
    "lift": Target(lift, (ROOT / "tests/data/lift.csv", ROOT / "flexcam/templates/measured-lift.csv"), 4),
    "profile": Target(profile, (MADE / "profile.csv",), 3),
    "result": Target(result, (MADE / "small.vtkhdf",), 16, binary=True),
    "table": Target(table, (MADE / "small.sweep.h5",), 5, binary=True),
}


def copied(seed: Path, folder: Path) -> Path:
    """Copy a seed and the tables it names into a folder."""
    for table in seed.parent.glob("*.csv") if seed.suffix == ".toml" else ():
        (folder / table.name).write_bytes(table.read_bytes())
    path = folder / seed.name
    path.write_bytes(seed.read_bytes().replace(b'"../../meshes/', f'"{ROOT}/meshes/'.encode()))
    return path


def write_input(target: Target, folder: Path, random: Random) -> Path:
    """Write one changed input into a folder and return its path."""
    seed = random.choice(target.seeds)
    path = copied(seed, folder)
    if not target.binary:
        content = path.read_text(encoding="utf-8")
        if random.random() < 0.05:
            path.write_bytes(mutate.raw(content.encode(), random))
        else:
            path.write_text(mutate.text(content, random), encoding="utf-8", errors="replace")
    elif seed.suffix in (".vtkhdf", ".h5") and random.random() < 0.35:
        damage.restructured(seed, path, random)
    else:
        path.write_bytes(mutate.raw(seed.read_bytes(), random))
    return path


def tried(number: int, seed: int, folder: Path, only: str = "") -> tuple[str, str]:
    """Feed input `number` of a seed; return its target and what came of it.

    Raises
    ------
    Exception
        Whatever is broken.
    """
    random = Random(f"{seed}-{number}")
    names, shares = list(TARGETS), [target.share for target in TARGETS.values()]
    name = only or random.choices(names, shares)[0]
    target = TARGETS[name]
    path = write_input(target, folder, random)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # sizes near the end of the doubles may overflow
        try:
            return name, target.feed(path, random)
        except InputError as refusal:
            return name, told(refusal)
        except RunFailedError:
            return name, "failed"
