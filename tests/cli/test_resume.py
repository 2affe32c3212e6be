"""``flexcam run --resume``: runs that were stopped go on; everything else is refused, and nothing is touched."""

from __future__ import annotations

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
WALKED = ("--set", "run.engine=direct", "--set", "run.revolutions=12")
"""A second of steps in Python."""

SERIES = ("displacement", "velocity", "acceleration")


def assert_same(path, other):
    one, two = read_result(path).response, read_result(other).response
    assert one.status.ok
    assert replace(one.stats, seconds=0.0) == replace(two.stats, seconds=0.0)
    assert all(np.array_equal(getattr(one.fields, name), getattr(two.fields, name)) for name in SERIES)
    assert all(np.array_equal(values, two.channels[name]) for name, values in one.channels.items())


def begun(folder, *words):
    """Start a run in a process of its own and return it once it has saved some of its steps."""
    process = start(["run", "case.toml", "-o", "out", *words], folder, OFTEN)
    partial, sizes, until = folder / "out/case.partial.vtkhdf", set(), time.monotonic() + 30.0
    while len(sizes) < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        sizes |= {partial.stat().st_size} if partial.exists() else set()
        time.sleep(0.005)
    return process, partial


@pytest.mark.slow
def test_after_kill_and_terminate(flexcam, case, tried, tmp_path):
    """Killed, resumed, terminated, resumed again."""
    process, partial = begun(tmp_path, *WALKED)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    killed = read_result(partial).response
    first, size = len(killed.time), prepare(read_case(case)).problem.system.size
    assert first > 0
    assert flexcam("info", partial, "--json").json["stats"] == {"steps": first - 1, "size": size}
    assert f"{first - 1} of {size} unknowns\n" in "\n".join(
        line.rstrip() for line in flexcam("info", partial).out.splitlines()
    )
    process, partial = begun(tmp_path, *WALKED, "--resume")
    process.send_signal(signal.SIGTERM)
    assert "interrupted" in process.communicate()[1]
    assert process.returncode == 143
    assert len(read_result(partial).response.time) > first
    ended = flexcam("run", "case.toml", "-o", "out", *WALKED, "--resume")
    assert ended.code == 0
    assert flexcam("run", "case.toml", "-o", "whole", *WALKED).out.splitlines()[:8] == ended.out.splitlines()[:8]
    assert_same(tmp_path / "out/case.vtkhdf", tmp_path / "whole/case.vtkhdf")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["case.vtkhdf"]
    assert flexcam("info", tmp_path / "out/case.vtkhdf", "--verify").code == 0
    tried("killed", "kill -9, --resume, SIGTERM, --resume", 2, "result and summary of the uninterrupted run")


@pytest.fixture
def broken(case, tmp_path):
    """Leave the partial result of a run that ended for some cause after so many blocks of 640 instants."""

    def leave(cause=Cause.INTERRUPTED, *, blocks=1, overrides=("run.revolutions=3",)):
        ready = prepare(read_case(case, overrides))
        file = open_result_file(ready, tmp_path / "out")
        close = file.close
        file.close = lambda status, stats: close(Status(cause, "so it was", "do this"), stats)
        solve(ready.problem, ready.scheme, save=ready.save, sinks=[Cut(blocks), file])
        return file.partial

    return leave


SAME = ("--set", "run.revolutions=3", "--resume")
NEEDED = ("checkpoint", "history/time", "history/probes/cam/velocity", "VTKHDF/PointData/displacement")
"""Datasets without which a run cannot go on as it was."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the result of the same run, left alone."""
    ready = prepare(read_case(DATA / "inline.toml", ["run.revolutions=3"]))
    file = open_result_file(ready, tmp_path_factory.mktemp("whole"))
    assert solve(ready.problem, ready.scheme, save=ready.save, sinks=[file]).status.ok
    return file.path


@pytest.mark.parametrize("cause", mostly_slow([Cause.INTERRUPTED, Cause.TIME_LIMIT, Cause.NOT_SAVED], 2))
def test_causes_that_go_on(cause, broken, flexcam):
    broken(cause)
    assert flexcam("run", "case.toml", "-o", "out", *SAME).code == 0


@pytest.mark.parametrize("cause", [Cause.NOT_FINITE, Cause.NO_CONVERGENCE, Cause.STEP_TOO_SMALL])
def test_causes_that_would_come_again(cause, broken, flexcam, refused):
    refused(broken(cause), SAME, str(cause), "same way", "Do this")


@pytest.fixture
def refused(flexcam, tmp_path):
    """Refuse to resume with certain words, and leave the partial result untouched and nothing else."""

    def check(partial, words, *told):
        before = {path: path.read_bytes() for path in partial.parent.iterdir()} if partial.parent.exists() else {}
        ended = flexcam("run", "case.toml", "-o", "out", *words)
        assert ended.code == 2
        for word in told:
            assert word in ended.err
        after = {path: path.read_bytes() for path in partial.parent.iterdir()} if partial.parent.exists() else {}
        assert after == before

    return check


def test_nothing_to_resume(case, refused, tmp_path):
    refused(tmp_path / "out/case.partial.vtkhdf", SAME, "there is no partial result", "Leave out --resume")


def test_complete_already(case, flexcam, refused, tmp_path):
    assert flexcam("run", "case.toml", "-o", "out").code == 0
    refused(tmp_path / "out/case.partial.vtkhdf", ["--resume"], "is complete", "Leave out --resume")


def test_cut_off_before_the_first_block(broken, refused):
    refused(broken(blocks=0), SAME, "before its first steps", "--overwrite")


def test_another_override(broken, refused):
    refused(broken(), ("--set", "run.revolutions=4", "--resume"), "--set", "run.revolutions=4", "run.revolutions=3")


def test_another_case(broken, case, refused):
    partial = broken()
    case.write_text(case.read_text().replace("6 mm", "7 mm"))
    line = next(i for i, one in enumerate(case.read_text().splitlines(), start=1) if "7 mm" in one)
    refused(
        partial, SAME, f'the text of the case, line {line}: got lift = "7 mm", expected lift = "6 mm"', "--overwrite",
    )  # fmt: skip


@pytest.mark.parametrize("package", ["flexcam", "numpy"])
def test_another_version(package, broken, refused, monkeypatch):
    from flexcam.analysis import run

    partial, known = broken(), run._version
    monkeypatch.setattr(run, "_version", lambda name: "99.0" if name == package else known(name))
    refused(partial, SAME, f"--resume: {package}: got 99.0", known(package))


def test_another_table_beside_the_case(flexcam, case, refused, broken, tmp_path):
    """The text of the case is the same, the lift it names is not."""
    rows = [(a, 3.0 * (1.0 - np.cos(np.radians(a)))) for a in range(0, 361, 5)]

    def write(scale):
        lines = [f"{angle}, {scale * lift:.6f}" for angle, lift in rows]
        (tmp_path / "lift.csv").write_text("\n".join(["cam_deg, lift_mm", *lines]))

    write(1.0)
    old = 'law = "shm"\nlift = "6 mm"\nrise = "180 deg"\nreturn = "180 deg"'
    assert old in case.read_text()
    case.write_text(case.read_text().replace(old, 'lift_table = "lift.csv"'))
    partial = broken()
    write(1.01)
    refused(partial, SAME, "a mesh or a table of the case", "Restore the old value")


@pytest.mark.slow
def test_a_damaged_partial_result(flexcam, broken, whole, tried, tmp_path):
    """Refused, or what was damaged does not count: then the run goes on to the right end."""
    partial = broken()
    sound = partial.read_bytes()
    with h5py.File(partial) as file:
        chunks = [file[name].id.get_chunk_info(0) for name in NEEDED]
    needed = [chunk.byte_offset + chunk.size // 2 for chunk in chunks]
    spread = [int(place * len(sound)) for place in (0.05, 0.2, 0.35, 0.95)]
    codes = []
    for place in needed + spread:
        content = bytearray(sound)
        for i in range(64):
            content[place + i] ^= 0x5A
        partial.write_bytes(content)
        codes.append(flexcam("run", "case.toml", "-o", "out", *SAME).code)
        if codes[-1] == 0:
            assert_same(tmp_path / "out/case.vtkhdf", whole)
            (tmp_path / "out/case.vtkhdf").unlink()
    assert set(codes) <= {0, 2}
    assert codes[: len(needed)] == [2] * len(needed)
    tried(
        "damaged", "--resume from a partial result with 64 bytes flipped", len(codes), "refused, or the correct result"
    )


@pytest.mark.slow
def test_a_result_that_is_there_already_needs_overwrite(flexcam, broken, refused, tmp_path):
    """A run that was to replace a result broke off: going on asks for the same permission."""
    partial = broken()
    old = tmp_path / "out/case.vtkhdf"
    old.write_bytes(b"the result before")
    refused(partial, SAME, "--overwrite")
    assert flexcam("run", "case.toml", "-o", "out", *SAME, "--overwrite").code == 0
    assert read_result(old).response.status.ok


@pytest.mark.parametrize("after", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_what_stops_before_its_next_block_loses_nothing(after, broken, case, flexcam, whole, tmp_path):
    """While earlier blocks are read back (1), and before another one is finished (2)."""
    words = ("run.revolutions=3",)
    partial = broken(blocks=2)
    held = len(read_result(partial).response.time)
    ready = prepare(read_case(case, words))
    earlier = open_partial_result(ready, partial.parent)
    file = open_result_file(ready, partial.parent, resume=earlier)
    again = solve(ready.problem, ready.scheme, save=ready.save, sinks=[Cut(after), file], resume=earlier)
    assert again.status.cause is Cause.INTERRUPTED
    assert len(read_result(partial).response.time) == held
    assert open_partial_result(ready, partial.parent).checkpoint.steps == earlier.checkpoint.steps
    assert [path.name for path in partial.parent.iterdir()] == [partial.name]
    assert flexcam("run", "case.toml", "-o", "out", *SAME).code == 0
    assert_same(tmp_path / "out/case.vtkhdf", whole)


def test_another_problem_from_python(broken, case):
    """Nothing but `solve` stands between what was left and another lift."""
    partial = broken()
    earlier = open_partial_result(prepare(read_case(case, ("run.revolutions=3",))), partial.parent)
    other = read_case(case, ("run.revolutions=3", "run.steps_per_revolution=3599"))
    with pytest.raises(InputError, match="run of another problem"):
        flexcam_run(other, resume=earlier)
