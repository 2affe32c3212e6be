"""Targets of the fuzzer: readers and commands that accept a changed input or refuse it with an error of flexcam."""

from __future__ import annotations

# ruff: noqa: E501 - tables, a row to a line
import atexit
import contextlib
import io
import os
import re
import shutil
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import h5py
import numpy as np

from flexcam.analysis.natural_modes import modes
from flexcam.analysis.preparation import prepare
from flexcam.cams import lift_table
from flexcam.case.builder import build_model
from flexcam.case.case import Case
from flexcam.case.reader import read_cams, read_case
from flexcam.cli.app import run_state
from flexcam.cli.main import main
from flexcam.core.errors import InputError
from flexcam.dynamics import Response, RunFailedError, solve
from flexcam.io import open_hdf5, read_lift, read_mesh, read_profile, read_result, write_digest
from flexcam.io.files import READ_ERRORS
from flexcam.io.sweep_table import read_table
from tests.fuzz import damage, mutate

ROOT = Path(__file__).parents[2]
STEPS, LARGE, CONTACT = 3, 3000, 10
"""Steps of the run of an accepted case; number of elements above which it is not run."""


class BrokenError(AssertionError):
    """A fault of flexcam: an empty error message, a NaN in an output, or a wrong number."""


def check_refusal(refusal: InputError) -> str:
    """Return ``refused`` if all faults have a place, a given value and an allowed value."""
    if not refusal.faults or not all(fault.where and fault.given and fault.allowed for fault in refusal.faults):
        raise BrokenError(f"an empty refusal: {refusal}")
    return "refused"


def is_large(read: Case) -> bool:
    """Return whether a case is so large that its run would take minutes."""
    record = read.record
    coils = sum(one.elements for one in record.springs.values())
    return sum(one.elements for one in record.members.values()) + CONTACT * coils > LARGE


def check_finite(response: Response) -> None:
    arrays = [response.time, response.angle, response.probes.displacement, response.fields.acceleration]
    if not all(np.isfinite(array).all() for array in [*arrays, *response.channels.values()]):
        raise BrokenError("an output that is not finite")


def case(path: Path, random: Random) -> str:
    """Read a case, build it and run a few steps."""
    del random
    read = read_case(path)
    if is_large(read):
        return "accepted"
    if read.record.run.start == "periodic":
        read = read.with_run({"start": "equilibrium"})
    ready = prepare(read)
    try:
        check_finite(
            solve(replace(ready.problem, steps=min(STEPS, ready.problem.steps)), ready.scheme, save=ready.save)
        )
    except RunFailedError:
        return "failed"
    modes(read, 3)
    build_model(read)
    return "accepted"


def call(*words: object) -> str:
    """Run a command line in this process and return its outcome."""
    stdout, stderr = io.StringIO(), io.StringIO()
    run_state.solving = False
    run_state.signals.clear()
    try:
        with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
            main([str(word) for word in words])
    except SystemExit as ended:
        if ended.code not in CODES:
            raise BrokenError(f"exit code {ended.code}: {' '.join(map(str, words))}: {stderr.getvalue()}") from None
        no_number = JSON_NAN if "--json" in words else PRINTED_NAN
        if "Traceback" in stderr.getvalue() or no_number.search(stdout.getvalue()):
            raise BrokenError(stdout.getvalue()[-2000:] + stderr.getvalue()[-500:]) from None
        return CODES[ended.code]
    raise BrokenError("no exit code")


CODES = {0: "accepted", 2: "refused", 3: "failed"}
"""Outcomes of the allowed exit codes; 70 is a fault of flexcam."""

JSON_NAN = re.compile(r"[:\[,]\s*(?:NaN|-?Infinity)\b")
PRINTED_NAN = re.compile(r"(?<![\w'\"./=-])(?:nan|-?inf)(?![\w'\"./=-])")
"""Printed values that are not numbers; input texts are in quotes or part of words."""

LINES = (
    ["check"], ["check", "--json"], ["modes"], ["modes", "--json"], ["compare", "--json"], ["cam"], ["cam", "--json"], ["run"],
    ["run", "--json"], ["stability", "--json", "--count", "2"], ["campbell", "--json", "--count", "3"], ["export", "--format", "inp"],
    ["sweep", "--json", "--workers", "0", "--set", "run.speed=100,200rpm"], ["sensitivity", "--json", "--of", "frequency.1"],
)  # fmt: skip
"""Commands that take a case."""

OUTPUT_COMMANDS = ("run", "sweep", "export")


def command_line(words: list[str], path: Path) -> list[object]:
    output_options = ["-o", path.parent / "out", "--overwrite"] if words[0] in OUTPUT_COMMANDS else []
    return [words[0], path, *words[1:], *output_options]


SHORT = ("--set", "run.revolutions=0.005")


def command(path: Path, random: Random) -> str:
    """Run a command line on a case."""
    words = random.choice(LINES)
    with contextlib.suppress(InputError):
        read = read_case(path)
        if is_large(read) or read.record.run.start == "periodic":
            return "accepted"
    if words[0] in OUTPUT_COMMANDS:
        shutil.rmtree(path.parent / "out", ignore_errors=True)
    return call(*command_line(words, path), *(SHORT if words[0] != "export" else ()))


def option(path: Path, random: Random) -> str:
    """Run a command line with changed options on a valid case."""
    path.write_text(VALID_CASE.read_text(encoding="utf-8"), encoding="utf-8")
    line = [str(one) for one in command_line(random.choice(LINES), path)]
    for _ in range(random.choice((1, 1, 2, 3))):
        a, one = random.randrange(2, len(line) + 1), random.choice(OPTIONS)
        line[a:a] = one.split(" ", 1) if random.random() < 0.5 else [mutate.text(one, random)]
    return call(*line, *SHORT)


VALID_CASE = ROOT / "tests/data/inline.toml"

OPTIONS = (
    "--set run.speed=3000rpm", "--set springs.valve.stiffness=3:6:1kN/m", "--set masses.new.at=cam", "--json", "--time-limit 1s",
    "--sample lhs:3", "--sample sobol:4", "--seed 1", "--scalars deviation", "--count 4", "--lowest 100rpm", "--highest 5000rpm",
    "--accuracy 10rpm", "--workers 0", "--limit 5", "--resume", "--histories", "--set title=a", "--set output.probes=['cam']",
    "--set run.step=20us", "--set fidelity.model=rigid", "--set fidelity.modes=4", "--set run.start=periodic", "--csv -",
    "--set run.integrator.method=bathe", "--set members.camshaft.elements=3", "--help", "--probe cam",
)  # fmt: skip


def result_command(path: Path, random: Random) -> str:
    """Run a command line on a result with changed structure and an updated digest."""
    update_digest(path)
    words = random.choice(
        (["info"], ["info", "--json"], ["export", "--format", "csv"], ["export", "--every", "7"],
         ["plot", "-o", str(path.with_suffix(".svg"))], ["report"]),
    )  # fmt: skip
    return call(words[0], path, *words[1:], *(["--overwrite"] if words[0] != "info" else []))


def update_digest(path: Path) -> None:
    """Update the digest of a changed file without forbidden content, so that only other faults can be refused."""
    with contextlib.suppress(InputError):
        with open_hdf5(path, "", ""):
            pass
        with contextlib.suppress(*READ_ERRORS, InputError), h5py.File(path, "r+", locking=False) as file:
            write_digest(file)


def mesh_command(path: Path, random: Random) -> str:
    """Run a command line on a case with a changed mesh."""
    return call(random.choice(("check", "modes", "compare")), _write_case_naming(MESH_CASE, 'mesh = "', path), "--json")


def lift_command(path: Path, random: Random) -> str:
    """Run a command line on a case with a changed lift table."""
    return call(
        random.choice(("check", "cam", "compare")),
        _write_case_naming(LIFT_TABLE_CASE, 'lift_table = "', path),
        "--json",
    )


MESH_CASE = ROOT / "cases/tayeb/model-1-shm.toml"
LIFT_TABLE_CASE = ROOT / "flexcam/templates/measured-lift.toml"


def _write_case_naming(case: Path, key: str, named: Path) -> Path:
    """Write a case that refers to another file in the same folder."""
    before, _, after = case.read_text(encoding="utf-8").partition(key)
    path = named.with_name("naming.toml")
    path.write_text(f'{before}{key}{named.name}"{after.partition(chr(34))[2]}', encoding="utf-8")
    return path


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
    """Read a measured lift and make a lift event of it."""
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
    """Read a result; it is refused, or all data equal the written ones."""
    del random
    if difference := damage.result_differs(read_result(path), valid_data("result")):
        raise BrokenError(f"silently wrong: {difference}")
    return "accepted"


def table(path: Path, random: Random) -> str:
    """Read the table of a sweep; it is refused, or all data equal the written ones."""
    del random
    if difference := damage.table_differs(read_table(path), valid_data("table")):
        raise BrokenError(f"silently wrong: {difference}")
    return "accepted"


@dataclass(frozen=True)
class Target:
    """A reader or command to be tested.

    Parameters
    ----------
    feed
        Function of a path that returns the outcome and raises if flexcam is broken.
    seeds
        Valid files, from which the inputs are made.
    share
        Number of inputs in the slow tests.
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
    """Return the folder of generated seeds, shared by a process and its child processes."""
    if _SEEDS not in os.environ:
        os.environ[_SEEDS] = tempfile.mkdtemp(prefix="flexcam-fuzz-seeds-")
        atexit.register(shutil.rmtree, os.environ[_SEEDS], ignore_errors=True)
    return Path(os.environ[_SEEDS])


_SEEDS = "FLEXCAM_FUZZ_SEEDS"
SEED_FOLDER = _folder()


def valid_data(kind: str) -> object:
    """Return the valid result or table, which is read once."""
    if kind not in _READ:
        _READ[kind] = (
            read_result(SEED_FOLDER / "small.vtkhdf")
            if kind == "result"
            else read_table(SEED_FOLDER / "small.sweep.h5")
        )
    return _READ[kind]


_READ: dict[str, object] = {}


def make_seeds() -> None:
    """Write the seeds that flexcam generates: binary meshes, a result, the table of a sweep."""
    damage.make_seeds(SEED_FOLDER)


TARGETS = {
    "case": Target(case, _cases(), 7500),
    "command": Target(command, _cases(), 1500),
    "option": Target(option, (VALID_CASE,), 2000),
    "cams": Target(cams, (*sorted((ROOT / "cases/cams").glob("*.toml")), ROOT / "tests/data/every-cam.toml"), 600),
    "mesh": Target(mesh, (SEED_FOLDER / "ascii22.msh", SEED_FOLDER / "ascii41.msh"), 1400),
    "binary mesh": Target(mesh, (SEED_FOLDER / "binary22.msh", SEED_FOLDER / "binary41.msh"), 700, binary=True),
    "mesh of a case": Target(mesh_command, (SEED_FOLDER / "ascii22.msh",), 900),
    "lift": Target(lift, (ROOT / "tests/data/lift.csv", ROOT / "flexcam/templates/measured-lift.csv"), 600),
    "lift of a case": Target(lift_command, (ROOT / "flexcam/templates/measured-lift.csv",), 600),
    "profile": Target(profile, (SEED_FOLDER / "profile.csv",), 400),
    "result": Target(result, (SEED_FOLDER / "small.vtkhdf",), 2200, binary=True),
    "result, sealed again": Target(result_command, (SEED_FOLDER / "small.vtkhdf",), 1000, binary=True),
    "table": Target(table, (SEED_FOLDER / "small.sweep.h5",), 600, binary=True),
}
"""Targets by name; the shares add up to the 20 000 inputs of the slow tests."""

GROUPS = {
    "cases": ("case", "cams"),
    "commands": ("command", "option", "mesh of a case", "lift of a case", "result, sealed again"),
    "files": ("mesh", "binary mesh", "lift", "profile", "result", "table"),
}
"""Targets by the file of slow tests that runs them."""

WORDS = {"accepted": "accepted and run", "refused": "refused", "failed": "ended with a status"}


def check_all(name: str, keep: Callable[[str, str, int, str], None]) -> None:
    """Run all inputs of a target within its limits of time and memory, and store the row."""
    from tests.fuzz.run import fuzz

    inputs = TARGETS[name].share
    found = fuzz(inputs, 1, 1, name)
    assert not found.broken, found.broken
    assert sum(found.outcomes.values()) == inputs
    outcomes = {word: found.outcomes[name, one] for one, word in WORDS.items()}
    keep("mutated", name, inputs, ", ".join(f"{count} {word}" for word, count in outcomes.items() if count))


def copy_seed(seed: Path, folder: Path) -> Path:
    """Copy a seed, and the tables that it refers to, into a folder."""
    for table in seed.parent.glob("*.csv") if seed.suffix == ".toml" else ():
        (folder / table.name).write_bytes(table.read_bytes())
    path = folder / seed.name
    path.write_bytes(seed.read_bytes().replace(b'"../../meshes/', f'"{ROOT}/meshes/'.encode()))
    return path


def write_input(target: Target, folder: Path, random: Random) -> Path:
    """Write one changed input into a folder and return its path."""
    seed = random.choice(target.seeds)
    path = copy_seed(seed, folder)
    if not target.binary:
        content = path.read_text(encoding="utf-8")
        if random.random() < 0.05:
            path.write_bytes(mutate.raw(content.encode(), random))
        else:
            path.write_text(mutate.text(content, random), encoding="utf-8", errors="replace")
    elif seed.suffix in (".vtkhdf", ".h5") and random.random() < 0.35:
        damage.change_structure(seed, path, random)
    else:
        path.write_bytes(mutate.raw(seed.read_bytes(), random))
    return path


def run_input(number: int, seed: int, folder: Path, only: str = "") -> tuple[str, str]:
    """Run input `number` of a seed; return its target and its outcome.

    Raises
    ------
    Exception
        If flexcam is broken.
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
            return name, check_refusal(refusal)
        except RunFailedError:
            return name, "failed"
