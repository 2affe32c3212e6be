"""Contradictory, repeated, incomplete or excessive options are refused or reported."""

from pathlib import Path

import pytest

from tests.thinning import mostly_slow

ROOT = Path(__file__).parents[2]
INLINE = ROOT / "tests/data/inline.toml"
ENGINE = ROOT / "cases/pushrod-engine/intake.toml"
CAM = ROOT / "cases/cams/li-fb2.toml"
HUGE = "100000000000"
STIFF = "springs.valve.stiffness"

REFUSED = {
    "too many speeds of a map": (("stability", INLINE, "--lowest", "1000rpm", "--count", HUGE), "2 to 10000"),
    "too many speeds to compare": (("compare", ENGINE, "--lowest", "1000rpm", "--count", HUGE), "2 to 10000"),
    "too many speeds for orders": (("campbell", "--response", INLINE, "--count", HUGE), "2 to 10000"),
    "too many speeds for modes": (("campbell", INLINE, "--count", HUGE), "2 to 10000"),
    "too many speeds of a picture": (("plot", INLINE, "--what", "map", "--count", HUGE), "2 to 10000"),
    "too many orders": (("campbell", INLINE, "--orders", "1:9999"), "1 to 1000"),
    "speeds of no map": (("stability", INLINE, "--count", "5"), "applies only with --lowest, --highest or --plot"),
    "a negative height": (("limits", ENGINE, "--bounce-height=-1mm"), "zero or more"),
    "a negative part": (("compare", ENGINE, "--lowest", "1000rpm", "--tolerance=-5%"), "--tolerance: got -0.05"),
    "a part in per cent": (("compare", ENGINE, "--lowest", "1000rpm", "--tolerance", "5"), "Write it as in '5 %'"),
    "a part in mm": (("compare", ENGINE, "--lowest", "1000rpm", "--tolerance", "5mm"), "--tolerance: got '5mm'"),
    "no picture of that kind": (("compare", ENGINE, "--plot", "x.bmp"), ".svg"),
    "a limit over speed": (
        ("limits", ENGINE, "--over", "run.crank_speed=1000:2000:500rpm", "--and", "masses.valve.mass=80:90:10g"),
        "--over: got run.crank_speed, expected another value",
    ),
    "an interval without its option": (
        ("optimize", INLINE, "--vary", STIFF, "--least", "frequency.1"),
        f"no interval, expected {STIFF}=LOW:HIGHunit, such as {STIFF}=36:44N/mm",
    ),
    "a unit that an interval cannot have": (
        ("optimize", INLINE, "--vary", f"{STIFF}=30:60foo", "--most", "frequency.1"),
        "expected a stiffness such as '40 kN/m'. The unit 'foo'",
    ),
    "a unit that a speed cannot have": (
        ("limits", ENGINE, "--accuracy", "5foo"), "got '5foo', expected a speed such as '3000 rpm'. The unit",
    ),
    "an unknown result": (
        ("sensitivity", INLINE, "--of", "nonsense", "--to", STIFF), "multiplier.N (Floquet) with N from 1; limits.NAME",
    ),
    "the derivative by a text": (
        ("sensitivity", INLINE, "--of", "frequency.1", "--to", "title"), "texts cannot be varied here.\n",
    ),
    "the derivative by a whole number": (
        ("sensitivity", INLINE, "--of", "frequency.1", "--to", "run.steps_per_revolution"), "Compare its values with",
    ),
    "a result without another": (("compare", "x.vtkhdf"), "Add --against with another result or a case"),
    "orbits without oil films": (
        ("plot", INLINE, "--what", "orbits"), "--what: orbits need a run of the flexible model with an oil film",
    ),
    "one goal twice": (
        ("optimize", INLINE, "--vary", f"{STIFF}=30:60kN/m", "--least", "frequency.1", "--most", "frequency.1"),
        "two different quantities",
    ),
    "forms without a folder": (("cam", CAM, "--format", "csv"), "--format: it applies only with -o"),
    "a kind without pictures": (("cam", CAM, "--plot-format", "png"), "--plot-format: it applies only with --plot"),
    "two kinds of instants": (
        ("export", INLINE, "--format", "csv", "--every", "2", "--instants", "5"), "not allowed with --instants",
    ),
    "a mesh at instants": (("export", INLINE, "--format", "msh", "--every", "2"), "a mesh none"),
    "speeds of no comparison": (("compare", ENGINE, "--count", "5"), "applies only with --lowest, --highest or --plot"),
    "a probe over speed": (("compare", ENGINE, "--lowest", "1000rpm", "--probe", "valve"), "three models"),
    "a channel without a response": (
        ("campbell", INLINE, "--channel", "contacts.intake.force"), "--channel: it applies only with --response",
    ),
    "modes of a response": (("campbell", "--response", INLINE, "--modes", "3"), "needs no modes"),
    "some orders of a response": (("campbell", "--response", INLINE, "--orders", "2,4"), "Write 1:4"),
    "a law beside the list": (("law", "--list", "shm"), "--list alone"),
    "no law": (("law",), "or --list"),
    "a cam beside a profile": (("cam", CAM, "--from-profile", "p.csv"), "--from-profile, which reads no case"),
    "a cutter for a profile": (("cam", "--from-profile", "p.csv", "--cutter", "9 mm"), "which reads no case"),
    "a follower without a profile": (("cam", CAM, "--follower", "{}"), "applies only with --from-profile"),
    "no cam": (("cam",), "or --from-profile FILE"),
    "only cams": (("limits", CAM), "expected a complete case. It has only cams. Give a complete case"),
    "a limit without a map": (
        ("limits", ENGINE, "--limit", "float"), "--limit: got no map, expected --over KEY=START:STOP:STEPunit",
    ),
    "a misspelt result": (
        ("sensitivity", INLINE, "--of", "contacts.intake.force", "--to", STIFF),
        "--of: there is no result 'contacts.intake.force'. Did you mean 'contacts.intake.force.largest'",
    ),
    "a profile without a follower": (("cam", "--from-profile", "p.csv"), "--follower: missing"),
    "a huge scale": (("view", INLINE, "--scale", "1e300", "--save", "x.png"), "at most 1e+06"),
    "no folder": (("run", INLINE, "-o", ""), "-o: missing, expected a value"),
    "no folder at all": (("run", INLINE, "--output="), "--output: missing"),
    "no table": (("trade", INLINE, "--csv", ""), "--csv: missing"),
    "a word that is missing": (("synthesize", "law"), "MINIMIZE (--minimize) is missing"),
    "a port beyond all ports": (
        ("sweep", INLINE, "--set", "run.speed=1000,2000rpm", "--scheduler", "tcp://127.0.0.1:99999"), "out of range",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", mostly_slow(REFUSED, 2))
def test_invalid_options_are_refused_without_output_files(flexcam, what):
    words, expected = REFUSED[what]
    done = flexcam(*words)
    assert done.code == 2
    assert expected in done.err
    assert not [path for path in Path().rglob("*") if path.is_file()]


SEVERAL_FAULTS = {
    "run": (("run", "none.toml", "-o", "x.h5", "--time-limit", "5"), ["case file", "--time-limit", "folder"]),
    "trade": (("trade", INLINE, "--set", "run.speed=-1", "--repeats", "0", "--plot", "x.bmp"),
              ["run.speed", "--repeats", "picture"]),
    "response": (("campbell", "--response", "none.toml", "--orders", "0", "--csv", "a.svg", "--plot", "a.svg"),
               ["case file", "--orders", "--plot"]),
    "campbell": (("campbell", "none.toml", "--orders", "0", "--plot", "x.bmp"), ["case file", "--orders", "picture"]),
    "modes": (("modes", "none.toml", "--count", "0", "-o", "x.h5"), ["case file", "--count", "folder"]),
    "sweep": (("sweep", INLINE, "--set", "run.speed=1,x", "-o", "x.h5", "--workers", "-1"),
              ["--set run.speed=1,x", "--workers", "folder"]),
}  # fmt: skip


@pytest.mark.parametrize("command", SEVERAL_FAULTS)
def test_faults_of_case_and_options_are_reported_together(flexcam, command):
    words, locations = SEVERAL_FAULTS[command]
    done = flexcam(*words)
    assert done.code == 2
    lines = [line for line in done.err.splitlines() if not line.startswith("Note:")]
    assert [line.partition(":")[0].partition(" (")[0] for line in lines] == locations
    assert not [path for path in Path().rglob("*") if path.is_file()]


@pytest.fixture
def result(flexcam):
    assert flexcam("run", INLINE, "--set", "run.steps_per_revolution=360").code == 0
    return Path("results/inline.vtkhdf")


def test_override_of_result_is_refused(flexcam, result):
    done = flexcam("compare", result, "--against", result, "--set", "run.speed=1rpm")
    assert done.code == 2
    assert "--set: got run.speed=1rpm, expected --set only with a case" in done.err
    few = ("--set", "run.steps_per_revolution=360")
    assert flexcam("compare", result, "--against", INLINE, *few).code == 0


def test_too_many_instants_are_refused(flexcam, result):
    done = flexcam("export", result, "--format", "csv", "--instants", HUGE)
    assert done.code == 2
    assert "2 to 10000000" in done.err


def test_existing_result_is_refused_before_choice_of_model(flexcam, result, monkeypatch):
    def fail_on_choice(*asked):
        raise AssertionError

    monkeypatch.setattr("flexcam.analysis.model_choice.select_case", fail_on_choice)
    done = flexcam("run", INLINE, "--set", "fidelity.tolerance=1%")
    assert done.code == 2
    assert "result: results/inline.vtkhdf already exists" in done.err


def test_repeated_override_causes_note(flexcam):
    done = flexcam(
        "check", INLINE, "--set", "run.speed=1000rpm", "--set", "run.revolutions=1", "--set", "run.speed=2rpm"
    )
    assert done.code == 0
    assert done.err == "Note: --set run.speed=1000rpm has no effect: --set run.speed=2rpm replaces it; leave one out\n"


@pytest.mark.parametrize("words", [("--contact", "nope"), ("--contact=nope",), ("--response", "--probe", "nope")])
def test_unknown_name_is_reported_with_its_option(flexcam, words):
    refused = flexcam("campbell", ROOT / "cases/tayeb/model-3-shm.toml", *words)
    assert refused.code == 2
    assert refused.err.startswith(f"{words[-2] if words[-1] == 'nope' else words[0].partition('=')[0]}: got 'nope'")


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        (("synthesize", "polydyn"), "choose one of harmonic, law, polydyne,"),
        (("polydyn",), "choose one of new, check, "),
    ],
)
def test_unknown_command_is_refused_with_choices(flexcam, words, remedy):
    refused = flexcam(*words)
    assert refused.code == 2
    assert remedy in " ".join(refused.err.split()).replace("Choose", "choose")


@pytest.mark.parametrize(("option", "is_meant"), [("--sped", False), ("--overrwrite", True)])
def test_only_a_similar_option_is_suggested(flexcam, option, is_meant):
    refused = flexcam("run", INLINE, option)
    assert refused.code == 2
    assert ("Did you mean --overwrite" in refused.err) == is_meant
    assert f"Unknown option: {option}" in refused.err.replace('"', "")
