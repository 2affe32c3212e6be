"""Commands whose JSON output is compared with goldens."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.golden.records import LIGHT, Record, digest, json_record, row
from tests.golden.runs import MODELS, ROOT, cases

CASES = ROOT / "cases"
TAYEB = str(CASES / "tayeb/model-3-shm.toml")
INTAKE = str(CASES / "pushrod-engine/intake.toml")
MATHIEU = str(CASES / "checks/mathieu.toml")
LINEAR, LEVER = (str(MODELS / f"{name}.toml") for name in ("linear-train", "lever-rocker"))
CAMS = (*sorted((CASES / "cams").glob("*.toml")), ROOT / "tests/data/every-cam.toml", MODELS / "hertz-train.toml")
COARSE = ("--set", "run.steps_per_revolution=360", "--set", "run.revolutions=1")
FLAT = '{ type = "roller", radius = "10 mm" }'
TEMPLATES = (
    "direct-acting", "dohc-16-valve", "exhaust-valve", "finger-follower", "lumped-train", "measured-lift",
    "published-model", "pushrod-engine", "v8-bank",
)  # fmt: skip

RecordFunction = Callable[[Sequence[str], Path], Record]


@dataclass(frozen=True)
class Command:
    """A command line with its golden, its name in it, its words, and preceding commands."""

    golden: str
    name: str
    words: tuple[str, ...]
    before: tuple[tuple[str, ...], ...] = ()
    take: RecordFunction = json_record

    def record(self, folder: Path) -> Record:
        """Run the preceding commands and the command itself in a folder; return its record."""
        for words in self.before:
            json_record(words, folder)
        return self.take(self.words, folder)


def _table(words: Sequence[str], folder: Path) -> Record:
    """Return the record of a command with the columns of the CSV files that it writes."""
    record = json_record(words, folder)
    for path in sorted(folder.rglob("*.csv")):
        with path.open(encoding="utf-8") as file:
            names, *lines = list(csv.reader(line for line in file if not line.startswith("#")))
        columns = zip(*lines, strict=True)
        record |= {
            f"csv/{name}": row([float(value) for value in values], LIGHT)
            for name, values in zip(names, columns, strict=True)
            if _are_numbers(values)
        }
    return record


def _are_numbers(values: Sequence[str]) -> bool:
    try:
        [float(value) for value in values]
    except ValueError:
        return False
    return True


def _files(words: Sequence[str], folder: Path) -> Record:
    """Return the record of a command with the number of files of each kind that it writes."""
    record = json_record(words, folder)
    endings = [path.suffix for path in folder.rglob("*") if path.is_file()]
    return record | {f"files/{ending}": endings.count(ending) for ending in sorted(set(endings))}


def _contents(words: Sequence[str], folder: Path) -> Record:
    """Return the record of `info` without the statistics of the solver, which rounding changes."""
    return {key: value for key, value in json_record(words, folder).items() if not key.startswith("stats/")}


def _checks() -> list[Command]:
    return [Command("commands-check", name, ("check", str(path))) for name, path in cases().items()]


def _cams() -> list[Command]:
    made = [Command("commands-cam", path.stem, ("cam", str(path), "--points", "180")) for path in CAMS]
    profile = ("cam", str(CASES / "cams/li-fb2.toml"), "-o", "out", "--format", "csv")
    follower = ("--follower", FLAT, "--base-radius", "20 mm")
    lift = ("cam", "--from-profile", "out/li-fb2-exhaust.csv", *follower, "--points", "180")
    return [
        *made,
        Command("commands-cam", "profile", (*profile, "--cutter", "40 mm"), take=_table),
        Command("commands-cam", "lift", lift, (profile,)),
    ]


def _laws() -> list[Command]:
    scca = ("law", "scca", "--with", "b=0.25", "--with", "c=0.5", "--with", "d=0.25", "--residual", "1.5")
    family = ("synthesize", "law", "--minimize", "Ca", "--bound", "Cj=60")
    swept = ("--speed", "1500rpm", "--count", "20")
    return [
        Command("commands-laws", "laws", ("law", "--list", "--residual", "2.5")),
        Command("commands-laws", "law 4-5-6-7", ("law", "4-5-6-7")),
        Command("commands-laws", "law scca", scca),
        Command("commands-laws", "law unknown", ("law", "unknown")),
        Command("commands-laws", "synthesize polynomial", (*family, "--family", "polynomial")),
        Command("commands-laws", "synthesize spline", (*family, "--pieces", "12")),
        Command("commands-laws", "synthesize harmonic", ("synthesize", "harmonic", TAYEB, "--tolerance", "200 um")),
        Command("commands-laws", "synthesize polydyne", ("synthesize", "polydyne", LINEAR, *swept)),
    ]


def _results() -> list[Command]:
    run = ("run", LINEAR, "-o", "out", *COARSE)
    result = "out/linear-train.vtkhdf"
    choice = ("run", TAYEB, "-o", "out", *COARSE, "--set")
    return [
        Command("commands-results", "info", ("info", result), (run,), _contents),
        Command("commands-results", "export csv", ("export", result, "--format", "csv"), (run,), _table),
        Command(
            "commands-results",
            "export instants",
            ("export", result, "--format", "csv", "--instants", "50"),
            (run,),
            _table,
        ),
        Command(
            "commands-results", "export pvd", ("export", result, "--format", "pvd", "--every", "5"), (run,), _files
        ),
        Command("commands-results", "export inp", ("export", LINEAR, "--format", "inp", "-o", "out"), (), _files),
        Command("commands-results", "report", ("report", result, "-o", "out/page.html"), (run,), _files),
        Command("commands-results", "plot", ("plot", result, "--rigid", "-o", "out/motion.svg"), (run,), _files),
        Command("commands-results", "compare results", ("compare", result, "--against", result), (run,)),
        Command("commands-results", "run twice", run, (run,)),
        Command("commands-results", "run estimate", (*choice, "fidelity.estimate=true")),
        Command("commands-results", "run tolerance", (*choice, 'fidelity.tolerance="20 %"')),
    ]


def _speeds() -> list[Command]:
    around = ("--lowest", "2000rpm", "--highest", "4000rpm")
    response = ("--response", *around, "--count", "2", "--orders", "1:8")
    return [
        Command("commands-speeds", "limits", ("limits", LEVER, *around, "--accuracy", "100rpm", *COARSE)),
        Command("commands-speeds", "parting", ("compare", LEVER, *around, "--count", "2", *COARSE)),
        Command("commands-speeds", "campbell", ("campbell", TAYEB, *around, "--count", "3", "--orders", "1:6")),
        Command("commands-speeds", "orders", ("campbell", LINEAR, *response, *COARSE)),
        Command("commands-speeds", "stability", ("stability", TAYEB, "--set", "run.speed=4000rpm", *COARSE)),
        Command("commands-speeds", "stability mathieu", ("stability", MATHIEU, "--set", "run.revolutions=1")),
        Command("commands-speeds", "stability map", ("stability", LINEAR, *around, "--count", "2", *COARSE)),
    ]


def _models() -> list[Command]:
    frame = str(MODELS / "frame.toml")
    return [
        Command("commands-models", "compare", ("compare", TAYEB, *COARSE)),
        Command("commands-models", "compare contact", ("compare", LEVER, *COARSE)),
        Command("commands-models", "compare sdof", ("compare", LINEAR, "--against", "sdof", *COARSE)),
        Command("commands-models", "modes", ("modes", frame, "--count", "8")),
        Command("commands-models", "modes rest", ("modes", INTAKE, "--prestress", "rest")),
        Command("commands-models", "modes equilibrium", ("modes", INTAKE, "--prestress", "equilibrium")),
        Command("commands-models", "modes mac", ("modes", frame, "--count", "6", "--mac", frame)),
        Command("commands-models", "trade", ("trade", LINEAR, "--repeats", "1", *COARSE)),
        Command("commands-models", "schema", ("schema",), take=digest),
        Command("commands-models", "selftest", ("selftest",)),
        Command("commands-models", "new", ("new",)),
        *(
            Command("commands-models", f"new {name}", ("check", "case.toml"), (("new", name, "-o", "case.toml"),))
            for name in TEMPLATES
        ),
    ]


def _studies() -> list[Command]:
    alone = ("--workers", "0", "-o", "out", "--scalars", "contacts,springs,members", *COARSE)
    mass = ("--to", "masses.valve.mass")
    best = ("--vary", "springs.valve.stiffness=30:60kN/m", "--least", "springs.valve.force.largest")
    return [
        Command(
            "commands-studies", "sweep", ("sweep", LINEAR, "--set", "run.speed=1000:2000:500rpm", *alone), take=_table
        ),
        Command(
            "commands-studies",
            "sweep lhs",
            ("sweep", LINEAR, "--set", "masses.valve.mass=80:100g", "--sample", "lhs:3", *alone),
            take=_table,
        ),
        Command("commands-studies", "sensitivity", ("sensitivity", LINEAR, "--of", "frequency.1", *mass)),
        Command(
            "commands-studies",
            "sensitivity run",
            ("sensitivity", LINEAR, "--of", "contacts.intake.force.largest", *mass, *COARSE),
        ),
        Command(
            "commands-studies",
            "scatter",
            ("sensitivity", LINEAR, "--of", "frequency.1", "--tolerance", "masses.valve.mass=±5%", "--count", "8"),
        ),
        Command("commands-studies", "optimize", ("optimize", LINEAR, *best, "--evaluations", "24", *COARSE)),
    ]


COMMANDS = (*_checks(), *_cams(), *_laws(), *_results(), *_speeds(), *_models(), *_studies())
"""All commands with goldens."""
