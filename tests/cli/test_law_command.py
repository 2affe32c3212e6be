"""law and law --list: criteria as JSON and as text, kinds with parameters, law files and refused input."""

# ruff: noqa: E501 - tables, a row to a line

import inspect
import math
import xml.etree.ElementTree as ET  # the files are our own

import pytest

from flexcam.cams import KINDS, LAWS, criteria, residual_spectrum
from tests.command import facts
from tests.thinning import mostly_slow

PI, NEAR = math.pi, math.sin(1.25 * math.pi)
KEYS = {
    "status", "law", "Cv", "Ca", "Cj", "Cm", "extremes", "jumps", "end_conditions", "rest_at_ends", "symmetric",
    "broken", "rms", "harmonics", "residual", "files",
}  # fmt: skip
CLOSED_FORMS = {  # Cv, Ca, Cj, Cm of the normalized law, residual amplitude after 1.25 periods
    "shm": (PI / 2, PI**2 / 2, PI**3 / 2, PI**3 / 8, abs(math.cos(1.25 * PI)) / (4 * 1.25**2 - 1)),
    "cycloidal": (2.0, 2 * PI, 4 * PI**2, 1.5 * math.sqrt(3.0) * PI, abs(NEAR) / (1.25 * PI * (1.25**2 - 1))),
    "parabolic": (2.0, 4.0, None, 8.0, (2 * math.sin(0.625 * PI) / (1.25 * PI)) ** 2),
    "3-4-5": (15 / 8, 10 / math.sqrt(3.0), 60.0, None, None),
    "4-5-6-7": (35 / 16, 84 * math.sqrt(5.0) / 25, 52.5, None, None),
}
KIND_PARAMETERS = {  # parameters of every kind for --with, and the equivalent named law
    "scca": ({"b": "0.25", "c": "0.5", "d": "0.25"}, "modified-trapezoid"),
    "polynomial": ({"exponents": "[3, 4, 5]"}, "3-4-5"),
    "quinquinomial": ({"row": "2"}, "quinquinomial-2"),
    "harmonic": ({"harmonics": "[[1, 0.9375], [3, 0.0625]]"}, "gutman-1-3"),
    "harmonic-acceleration": ({"b": f"[{2 * PI!r}]"}, "cycloidal"),
    "cosine": ({"coefficients": "[0.5, -0.5]"}, "shm"),
    "fb2": ({"split": "0.3"}, "fb2"),
    "bspline": ({"coefficients": "[0, 0, 0, 1, 1, 1]", "degree": "5"}, "3-4-5"),
    "table": ({"z": "[0, 0.5, 1]", "s": "[0, 0.5, 1]"}, "3-4-5"),  # the only quintic through them, at rest
}


def refused_fault(wide_flexcam, *words):
    """Return the only fault of a refused command, which is the same as text and as JSON."""
    done, printed_refusal = wide_flexcam(*words, "--json"), wide_flexcam(*words)
    assert (done.code, done.err, printed_refusal.code, printed_refusal.out) == (2, "", 2, "")
    report = done.json
    assert (report["status"], len(report["errors"])) == ("refused", 1)
    (fault,) = report["errors"]
    assert list(fault) == ["where", "given", "allowed", "why", "remedy"]
    assert fault["allowed"] or fault["why"]
    printed = printed_refusal.err.lower().replace(": missing", ": nothing")
    shown = [fault[key] for key in fault if key != "given" or fault["allowed"]]
    assert [part for part in shown if part.replace(" --json", "").lower() not in printed] == []
    return fault


def with_options(parameters):
    return [f"--with={key}={value}" for key, value in parameters.items()]


@pytest.mark.parametrize("name", mostly_slow(LAWS, 4))
def test_criteria_of_every_law(name, wide_flexcam):
    report, law = facts(wide_flexcam, "law", name), criteria(LAWS[name])
    assert report.keys() == KEYS
    for key in ("Cv", "Ca", "Cj", "Cm", "symmetric", "rest_at_ends"):
        assert report[key] == getattr(law, key), key
    assert report["broken"] == list(law.violations)
    for key in ("jumps", "rms", "harmonics"):
        assert report[key] == list(getattr(law, key)), key
    peaks = {key: max(abs(end["value"]) for end in pair) for key, pair in report["extremes"].items()}
    assert peaks == {"velocity": law.Cv, "acceleration": law.Ca, "jerk": law.Cj or peaks["jerk"], "moment": law.Cm}
    ends = {z: list(end.values()) for z, end in report["end_conditions"].items()}
    assert ends == {"z=0": list(law.ends[0]), "z=1": list(law.ends[1])}
    assert [entry["ratio"] for entry in report["residual"]] == [1.0, 1.5, 2.0, 3.0, 5.0]


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_criteria_match_closed_forms(name, wide_flexcam):
    """Tolerance 1e-11: extremes are found by bisection, 1e-12 in value."""
    found = facts(wide_flexcam, "law", name, "--residual", "2.5", "--residual", "1.25")
    assert [entry["ratio"] for entry in found["residual"]] == [2.5, 1.25], "in the order asked"
    values = [found["Cv"], found["Ca"], found["Cj"], found["Cm"], found["residual"][1]["amplitude"]]
    for value, closed in zip(values, CLOSED_FORMS[name], strict=True):
        assert closed is None or value == pytest.approx(closed, rel=1e-11)
    assert (found["Cj"] is None) == (name == "parabolic")


@pytest.mark.slow
def test_list_of_all_laws(wide_flexcam, tmp_path):
    found = facts(wide_flexcam, "law", "--list", "--residual", "1.5")
    assert (list(found["laws"]), found["kinds"], found["ratios"]) == (list(LAWS), list(KINDS), [1.5])
    for name, law in LAWS.items():
        assert found["laws"][name].keys() == KEYS - {"status", "law", "files"}
        assert found["laws"][name]["residual"] == residual_spectrum(law, [1.5]).tolist()
    words = wide_flexcam("law", "--list", "--plot", "all.svg").out
    assert [name for name in (*LAWS, *KINDS) if name not in words.replace(",", " ").split()] == []
    assert [line.split()[0] for line in words.splitlines() if "infinite" in line] == ["parabolic"]
    assert len([line for line in words.splitlines() if line.startswith("shm, cos ")]) == 2, "one law, one row"
    assert (tmp_path / "all.svg").stat().st_size > 10_000


@pytest.mark.parametrize(("name", "message"), [
    ("parabolic", ["C_j infinite", "the acceleration jumps at a dwell, by +4 at z = 0 and by +4 at z = 1"]),
    ("pavlovic-trigonometric", ["the velocity jumps at a dwell, by +0.0208333 at z = 0"]),
    ("pavlovic-new", ["not symmetric: s(1/2) = 0.498047", "by +9.8696 at z = 0", "1.39843 at z = 0.766805"]),
])  # fmt: skip
def test_law_output_text(name, message, wide_flexcam):
    """Check the errata of docs/verification/pavlovic-lutovac.md: s' = 1/48, s(1/2) = 0.498047, a step of pi^2."""
    words = wide_flexcam("law", name).out
    assert [text for text in message if text not in words] == []


@pytest.mark.parametrize("kind", KINDS)
def test_kind_with_parameters_equals_named_law(kind, wide_flexcam):
    """Tolerance 1e-9: splines and sums of sines round differently from the formula of the named law."""
    parameters, name = KIND_PARAMETERS[kind]
    found, law = facts(wide_flexcam, "law", kind, *with_options(parameters)), facts(wide_flexcam, "law", name)
    got, expected = ([values["Cv"], values["Ca"], values["Cm"], *values["rms"][:2]] for values in (found, law))
    assert got == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "name"), mostly_slow([(kind, name) for kind in KIND_PARAMETERS for name in KIND_PARAMETERS[kind][0]], 2)
)
def test_invalid_parameters_are_refused(kind, name, wide_flexcam):
    """A missing required parameter, a wrong type and a misspelled name."""
    parameters = KIND_PARAMETERS[kind][0]
    if inspect.signature(KINDS[kind]).parameters[name].default is inspect.Parameter.empty:
        fault = refused_fault(
            wide_flexcam, "law", kind, *with_options({key: value for key, value in parameters.items() if key != name})
        )
        assert (fault["where"], fault["given"]) == (name, "nothing")
        assert f"{kind} requires {name}" in fault["why"]
        assert name in fault["remedy"]
    fault = refused_fault(wide_flexcam, "law", kind, *with_options({**parameters, name: '"lots"'}))
    assert (fault["where"].partition(".")[0], "lots" in fault["given"]) == (name, True)
    fault = refused_fault(wide_flexcam, "law", kind, *with_options({**parameters, f"{name}zz": "1"}))
    assert fault["where"] == f"{name}zz"
    assert [key for key in parameters if key not in fault["allowed"]] == []
    assert len(name) < 3 or f"did you mean '{name}'" in fault["remedy"]


FAULTS = {  # arguments, location, part of the message
    "parts that do not sum to 1": ("scca --with b=0.2 --with c=0.2 --with d=0.2", "b, c, d", "sum to 1"),
    "exponents that do not ascend": ("polynomial --with exponents=[3,5,4]", "exponents", "ascending"),
    "split 0": ("fb2 --with split=0", "split", "between 0 and 1"),
    "spline that ends elsewhere": ("bspline --with coefficients=[0,0,0,1,1,2]", "coefficients", "s(1) = 1"),
    "velocity at the ends": ("harmonic-acceleration --with b=[6]", "b", "the velocity must vanish"),
    "points that run back": ("table --with z=[0,0.6,0.5,1] --with s=[0,0.4,0.6,1]", "z", "ascend"),
    "no equals sign": ("scca --with b", "--with", "key=value"),
    "parameter given twice": ("fb2 --with split=0.3 --with split=0.4", "--with", "'split' is given twice"),
    "no number": ("scca --with b=quarter", "--with", "exponents=[3,4,5]"),
    "parameter of a law without": ("3-4-5 --with b=1", "law 3-4-5", "no parameters"),
    "ratio that is none": ("shm --residual x", "command line", "--residual"),
    "digit forgotten": ("4-5-6", "law", "did you mean '4-5-6-7'"),
    "kind": ("b-spline", "law", "did you mean 'bspline'"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_invalid_law_is_refused(name, wide_flexcam):
    words, where, expected = FAULTS[name]
    fault = refused_fault(wide_flexcam, "law", *words.split())
    assert fault["where"] == where
    assert expected in " ".join(fault.values())


@pytest.mark.parametrize("text", [
    None, "", "[law\n", "law = 3\n", "[lift]\nmean = 1.0\n", "[law]\nsplit = 0.3\n", '[law]\nid = "fb2"\nsplt = 7\n', "\x00",
])  # fmt: skip
def test_invalid_law_file_is_refused(text, wide_flexcam, tmp_path):
    if text is not None:
        (tmp_path / "bad.toml").write_text(text, encoding="utf-8")
    assert "bad.toml" in refused_fault(wide_flexcam, "law", "bad.toml")["where"]


@pytest.mark.slow
def test_law_plots(wide_flexcam, tmp_path):
    assert wide_flexcam("law", "shm", "--plot", "a.svg", "--spectrum", "b.png").code == 0
    assert (tmp_path / "b.png").read_bytes().startswith(b"\x89PNG")
    assert "--overwrite" in refused_fault(wide_flexcam, "law", "shm", "--spectrum", "b.png")["remedy"]
    tree = ET.parse(tmp_path / "a.svg")  # noqa: S314
    assert len(list(tree.iter("{http://www.w3.org/2000/svg}path"))) > 4
    (tmp_path / "a.svg").write_text("mine")
    assert "--overwrite" in refused_fault(wide_flexcam, "law", "shm", "--plot", "a.svg")["remedy"]
    assert (tmp_path / "a.svg").read_text() == "mine"
    assert ".svg" in refused_fault(wide_flexcam, "law", "shm", "--plot", "a.jpg")["allowed"]
