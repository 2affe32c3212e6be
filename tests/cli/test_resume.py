"""``flexcam run --resume``: stopped runs continue; other cases are refused without changes of files."""

import signal
import time
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexcam import InputError, read_case, read_result
from flexcam import run as flexcam_run
from flexcam.analysis.preparation import prepare
from flexcam.analysis.run import open_partial_result, open_result_file
from flexcam.dynamics import Cause, Status, solve
from tests.command import OFTEN, start
from tests.sinks import Cut
from tests.thinning import mostly_slow

DATA = Path(__file__).parents[1] / "data"
SLOW_RUN = ("--set", "run.engine=direct", "--set", "run.revolutions=12")
"""About one second of steps in Python."""

SERIES = ("displacement", "velocity", "acceleration")


def assert_same(path, other):
    first, second = read_result(path).response, read_result(other).response
    assert first.status.ok
    assert replace(first.stats, seconds=0.0) == replace(second.stats, seconds=0.0)
    assert all(np.array_equal(getattr(first.fields, name), getattr(second.fields, name)) for name in SERIES)
    assert all(np.array_equal(values, second.channels[name]) for name, values in first.channels.items())


def start_run(folder, *words):
    """Start a run in its own process and return it after it has saved some of its steps."""
    process = start(["run", "case.toml", "-o", "out", *words], folder, OFTEN)
    partial, sizes, until = folder / "out/case.partial.vtkhdf", set(), time.monotonic() + 30.0
    while len(sizes) < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        sizes |= {partial.stat().st_size} if partial.exists() else set()
        time.sleep(0.005)
    return process, partial


@pytest.mark.slow
def test_resume_after_sigkill_and_sigterm(flexcam, case, tried, tmp_path):
    """Kill, resume, terminate and resume the run again."""
    process, partial = start_run(tmp_path, *SLOW_RUN)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    killed = read_result(partial).response
    first, size = len(killed.time), prepare(read_case(case)).problem.system.size
    assert first > 0
    assert flexcam("info", partial, "--json").json["stats"] == {"steps": first - 1, "size": size}
    assert f"{first - 1} of {size} unknowns\n" in "\n".join(
        line.rstrip() for line in flexcam("info", partial).out.splitlines()
    )
    process, partial = start_run(tmp_path, *SLOW_RUN, "--resume")
    process.send_signal(signal.SIGTERM)
    assert "interrupted" in process.communicate()[1]
    assert process.returncode == 143
    assert len(read_result(partial).response.time) > first
    ended = flexcam("run", "case.toml", "-o", "out", *SLOW_RUN, "--resume")
    assert ended.code == 0
    assert flexcam("run", "case.toml", "-o", "whole", *SLOW_RUN).out.splitlines()[:8] == ended.out.splitlines()[:8]
    assert_same(tmp_path / "out/case.vtkhdf", tmp_path / "whole/case.vtkhdf")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["case.vtkhdf"]
    tried("killed", "kill -9, --resume, SIGTERM, --resume", 2, "result and summary of the uninterrupted run")


@pytest.fixture
def write_partial_result(case, tmp_path):
    """Return a function that writes the partial result of a run which ended after some blocks of 2560 instants."""

    def write(cause=Cause.INTERRUPTED, *, blocks=1, overrides=("run.revolutions=12",)):
        ready = prepare(read_case(case, overrides))
        file = open_result_file(ready, tmp_path / "out")
        close = file.close
        file.close = lambda status, stats: close(Status(cause, "so it was", "do this"), stats)
        solve(ready.problem, ready.scheme, save=ready.save, sinks=[Cut(blocks), file])
        return file.partial

    return write


RESUME = ("--set", "run.revolutions=12", "--resume")
REQUIRED_DATASETS = ("checkpoint", "history/time", "history/probes/cam/velocity", "VTKHDF/PointData/displacement")
"""Datasets that a continued run requires."""


@pytest.fixture(scope="module")
def complete_result(tmp_path_factory):
    """Return the result of the same run without an interruption."""
    ready = prepare(read_case(DATA / "inline.toml", ["run.revolutions=12"]))
    file = open_result_file(ready, tmp_path_factory.mktemp("whole"))
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[file]).status.ok
    return file.path


@pytest.mark.parametrize("cause", mostly_slow([Cause.NOT_SAVED, Cause.INTERRUPTED, Cause.TIME_LIMIT]))
def test_resume_continues_interrupted_run(cause, write_partial_result, flexcam):
    write_partial_result(cause)
    assert flexcam("run", "case.toml", "-o", "out", *RESUME).code == 0


@pytest.mark.parametrize(
    "cause", [pytest.param(Cause.NOT_FINITE, marks=pytest.mark.slow), Cause.NO_CONVERGENCE, Cause.STEP_TOO_SMALL]
)
def test_resume_refuses_run_with_numerical_failure(cause, write_partial_result, flexcam, assert_refused):
    assert_refused(write_partial_result(cause), RESUME, str(cause), "same way", "Do this")


@pytest.fixture
def assert_refused(flexcam, tmp_path):
    """Check that --resume is refused with the expected words and changes no file."""

    def check(partial, words, *expected):
        before = {path: path.read_bytes() for path in partial.parent.iterdir()} if partial.parent.exists() else {}
        ended = flexcam("run", "case.toml", "-o", "out", *words)
        assert ended.code == 2
        for word in expected:
            assert word in ended.err
        after = {path: path.read_bytes() for path in partial.parent.iterdir()} if partial.parent.exists() else {}
        assert after == before

    return check


def test_resume_without_partial_result_is_refused(case, assert_refused, tmp_path):
    assert_refused(tmp_path / "out/case.partial.vtkhdf", RESUME, "there is no partial result", "Leave out --resume")


def test_resume_of_complete_run_is_refused(case, flexcam, assert_refused, tmp_path):
    assert flexcam("run", "case.toml", "-o", "out").code == 0
    assert_refused(tmp_path / "out/case.partial.vtkhdf", ["--resume"], "is complete", "Leave out --resume")


def test_resume_without_saved_steps_is_refused(write_partial_result, assert_refused):
    partial = write_partial_result(blocks=0)
    assert_refused(partial, RESUME, "before its first checkpoint", "--overwrite")
    assert_refused(partial, RESUME[:2], "Replace it with --overwrite, or, if it has a checkpoint, continue it")


def test_resume_with_other_override_is_refused(write_partial_result, assert_refused):
    assert_refused(
        write_partial_result(),
        ("--set", "run.revolutions=4", "--resume"),
        "--set",
        "run.revolutions=4",
        "run.revolutions=12",
    )


def test_resume_with_changed_case_is_refused(write_partial_result, case, assert_refused):
    partial = write_partial_result()
    case.write_text(case.read_text().replace("6 mm", "7 mm"))
    line = next(i for i, text in enumerate(case.read_text().splitlines(), start=1) if "7 mm" in text)
    assert_refused(
        partial, RESUME, f'the text of the case, line {line}: got lift = "7 mm", expected lift = "6 mm"', "--overwrite",
    )  # fmt: skip


@pytest.mark.parametrize("package", ["flexcam", "numpy"])
def test_resume_with_other_version_is_refused(package, write_partial_result, assert_refused, monkeypatch):
    from flexcam.analysis import run

    partial, original = write_partial_result(), run._version
    monkeypatch.setattr(run, "_version", lambda name: "99.0" if name == package else original(name))
    assert_refused(partial, RESUME, f"--resume: {package}: got 99.0", original(package))


def test_resume_with_changed_lift_table_is_refused(flexcam, case, assert_refused, write_partial_result, tmp_path):
    """The text of the case is unchanged; its lift table is not."""
    rows = [(a, 3.0 * (1.0 - np.cos(np.radians(a)))) for a in range(0, 361, 5)]

    def write(scale):
        lines = [f"{angle}, {scale * lift:.6f}" for angle, lift in rows]
        (tmp_path / "lift.csv").write_text("\n".join(["cam_deg, lift_mm", *lines]))

    write(1.0)
    old = 'law = "shm"\nlift = "6 mm"\nrise = "180 deg"\nreturn = "180 deg"'
    assert old in case.read_text()
    case.write_text(case.read_text().replace(old, 'lift_table = "lift.csv"'))
    partial = write_partial_result()
    write(1.01)
    assert_refused(partial, RESUME, "a mesh or a table of the case", "Restore the old value")


@pytest.mark.slow
def test_resume_from_damaged_result_is_refused_or_exact(
    flexcam, write_partial_result, complete_result, tried, tmp_path
):
    """If the damaged bytes are not needed, the continued run equals the complete one."""
    partial = write_partial_result()
    original = partial.read_bytes()
    with h5py.File(partial) as file:
        chunks = [file[name].id.get_chunk_info(0) for name in REQUIRED_DATASETS]
    required_places = [chunk.byte_offset + chunk.size // 2 for chunk in chunks]
    other_places = [int(place * len(original)) for place in (0.05, 0.2, 0.35, 0.95)]
    codes = []
    for place in required_places + other_places:
        content = bytearray(original)
        for i in range(64):
            content[place + i] ^= 0x5A
        partial.write_bytes(content)
        codes.append(flexcam("run", "case.toml", "-o", "out", *RESUME).code)
        if codes[-1] == 0:
            assert_same(tmp_path / "out/case.vtkhdf", complete_result)
            (tmp_path / "out/case.vtkhdf").unlink()
    assert set(codes) <= {0, 2}
    assert codes[: len(required_places)] == [2] * len(required_places)
    tried(
        "damaged", "--resume from a partial result with 64 bytes flipped", len(codes), "refused, or the correct result"
    )


@pytest.mark.slow
def test_resume_over_existing_result_requires_overwrite(flexcam, write_partial_result, assert_refused, tmp_path):
    """The interrupted run was to replace a result: its continuation requires the same permission."""
    partial = write_partial_result()
    old = tmp_path / "out/case.vtkhdf"
    old.write_bytes(b"the result before")
    assert_refused(partial, RESUME, "--overwrite")
    assert flexcam("run", "case.toml", "-o", "out", *RESUME, "--overwrite").code == 0
    assert read_result(old).response.status.ok


@pytest.mark.parametrize("after", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_interrupted_resume_loses_no_steps(after, write_partial_result, case, flexcam, complete_result, tmp_path):
    """An interruption while earlier blocks are read (1) and before the next block is complete (2)."""
    words = ("run.revolutions=12",)
    partial = write_partial_result(blocks=2)
    saved_steps = len(read_result(partial).response.time)
    ready = prepare(read_case(case, words))
    earlier = open_partial_result(ready, partial.parent)
    file = open_result_file(ready, partial.parent, resume=earlier)
    response = solve(ready.problem, ready.scheme, save=ready.save, sinks=[Cut(after), file], resume=earlier)
    assert response.status.cause is Cause.INTERRUPTED
    assert len(read_result(partial).response.time) == saved_steps
    assert open_partial_result(ready, partial.parent).checkpoint.steps == earlier.checkpoint.steps
    assert [path.name for path in partial.parent.iterdir()] == [partial.name]
    assert flexcam("run", "case.toml", "-o", "out", *RESUME).code == 0
    assert_same(tmp_path / "out/case.vtkhdf", complete_result)


def test_resume_with_other_problem_is_refused_in_python(write_partial_result, case):
    """In Python, only `solve` compares the saved problem with the new one."""
    partial = write_partial_result()
    earlier = open_partial_result(prepare(read_case(case, ("run.revolutions=12",))), partial.parent)
    other = read_case(case, ("run.revolutions=12", "run.steps_per_revolution=3599"))
    with pytest.raises(InputError, match="run of another problem"):
        flexcam_run(other, resume=earlier)
