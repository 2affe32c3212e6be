"""flexcam sweep: tables, journal, signals, and resuming after a crash."""

import json
import random
import signal
import socket
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import pytest

from flexcam import InputError, read_result
from flexcam.io.sweep_table import read_table
from tests.command import start

ROOT = Path(__file__).resolve().parents[2]

QUICK = ("--set", "run.revolutions=0.25", "--set", "run.steps_per_revolution=720")
SPEEDS = ("--set", "run.speed=1000:2500:500rpm")
NAMES = ("case.sweep.h5", "case.sweep.csv")


def read_journal(folder):
    path = folder / "case.sweep.jsonl"
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


def test_sweep_writes_tables_journal_and_summary(flexcam, case, tmp_path):
    done = flexcam("sweep", case, *QUICK, *SPEEDS, "--set", "springs.valve.stiffness=30,40kN/m", "--workers", "0")
    assert done.code == 0
    assert "8 variants over run.speed, springs.valve.stiffness" in done.out
    assert "deviation.peak" in done.out
    table = read_table(tmp_path / "results/case.sweep.h5")
    assert table.shape == (4, 2)
    assert len(read_journal(tmp_path / "results")) == 1 + 8
    assert "run.speed [rpm],springs.valve.stiffness [kN/m]" in (tmp_path / "results/case.sweep.csv").read_text()
    completed = flexcam("info", tmp_path / "results/case.sweep.h5")
    assert completed.code == 2
    assert "It is the table of a sweep" in completed.err


def test_sweep_json_with_selected_scalars(flexcam, case):
    words = ("--workers", "0", "--scalars", "deviation,probes.valve", "--json", "--sample", "sobol:2", "--seed", "3")
    done = flexcam("sweep", case, *QUICK, "--set", "run.speed=1000:2000rpm", *words)
    assert done.json["variants"] == 2
    assert done.json["inputs"] == {"run.speed": "rpm"}
    assert list(done.json["scalars"])[:3] == ["deviation.peak", "deviation.rms", "probes.valve.displacement.largest"]
    assert all(Path(path).exists() for path in done.json["files"])


def test_time_limit_fails_only_slow_variant(flexcam, case, tmp_path):
    """A resumed sweep repeats this variant and keeps the others."""
    words = ("sweep", case, "--set", "run.revolutions=0.1,1e6", "--workers", "0", "--time-limit", "0.5s", "--json")
    done = flexcam(*words)
    assert done.json["failed"] == {"time-limit": [2]}
    assert read_table(tmp_path / "results/case.sweep.h5").statuses[0].ok
    flexcam(*words, "--resume")
    assert [json.loads(line)["chunk"] for line in read_journal(tmp_path / "results")[1:]] == [0, 1, 1]
    assert "--time-limit" in flexcam(*words[:-2], "1 parsec", "--overwrite").err


def test_identical_variants_are_reported(flexcam, case, tmp_path):
    done = flexcam("sweep", case, "--set", "title=one,other", "--set", "run.revolutions=0.1", "--workers", "0",
                   "-o", tmp_path / "out")  # fmt: skip
    assert done.code == 0
    assert "every result has the same value in all variants" in done.out


def test_command_overrides_sweep_table_of_case(flexcam, case, tmp_path):
    sweep = '\n[sweep]\nset = { "run.speed" = "1000,2000,3000rpm", "springs.valve.stiffness" = "30,40kN/m" }\n'
    case.write_text(case.read_text() + sweep + 'scalars = ["deviation"]\n')
    done = flexcam("sweep", case, *QUICK, "--set", "run.speed=1500,1600rpm", "--workers", "0", "--json")
    assert done.json["variants"] == 4
    assert list(done.json["scalars"]) == ["deviation.peak", "deviation.rms"]
    assert list(done.json["inputs"]) == ["run.speed", "springs.valve.stiffness"]
    assert flexcam("run", case, *QUICK).code == 0


@pytest.mark.slow
def test_sweep_histories_are_result_files(flexcam, case, tmp_path):
    done = flexcam("sweep", case, *QUICK, "--set", "run.speed=1000,2000rpm", "--workers", "1", "--histories")
    assert done.code == 0
    table = read_table(tmp_path / "results/case.sweep.h5")
    for i in range(2):
        response = read_result(tmp_path / f"results/case.sweep/variant-{i + 1:05d}.vtkhdf").response
        assert abs(response["valve"].displacement).max() == table["probes.valve.displacement.largest"][i]


@pytest.mark.slow
def test_histories_of_earlier_sweep_require_overwrite(flexcam, case, tmp_path):
    args = ("--set", "run.revolutions=0.1", "--histories", "--workers", "0")
    out, histories = tmp_path / "out", tmp_path / "out/case.sweep"
    assert flexcam("sweep", case, "--set", "run.speed=1000:3000#3rpm", *args, "-o", out).code == 0
    before = {path.name: path.read_bytes() for path in histories.iterdir()}
    for path in out.glob("case.sweep.*"):
        path.unlink()
    other = ("sweep", case, "--set", "run.speed=2000,4000rpm", *args, "-o", out)
    refused = flexcam(*other)
    assert refused.code == 2
    assert refused.err.startswith(f"--histories: got 3 in {histories}, expected none from an earlier sweep")
    assert {path.name: path.read_bytes() for path in histories.iterdir()} == before
    assert flexcam(*other, "--overwrite").code == 0
    assert sorted(path.name for path in histories.iterdir()) == ["variant-00001.vtkhdf", "variant-00002.vtkhdf"]
    assert flexcam(*other, "--resume").code == 0
    assert len(list(histories.iterdir())) == 2


@pytest.mark.slow
def test_sweep_does_not_overwrite_existing_files(flexcam, case, tmp_path):
    words = ("sweep", case, *QUICK, "--set", "run.speed=1000,2000rpm", "--workers", "0", "-o", tmp_path / "out")
    assert flexcam(*words).code == 0
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    again = flexcam(*words)
    assert again.code == 2
    assert "--overwrite" in again.err
    assert flexcam(*words, "--set", "cams.intake.lift=7mm", "--resume").code == 2
    assert flexcam(*words, "--set", "run.speeed=1,2", "--overwrite").code == 2
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    assert flexcam(*words, "--resume").code == 0
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    assert flexcam(*words, "--set", "cams.intake.lift=7mm", "--overwrite").code == 0


def test_misspelled_scalars_are_refused_before_first_run(flexcam, case, tmp_path):
    words = ("sweep", case, *QUICK, "--set", "run.speed=1000,2000rpm", "--workers", "0")
    wrong = flexcam(*words, "--scalars", "deviaton,probes.valve.acceleration.larges,energy")
    assert wrong.code == 2
    assert "Did you mean 'deviation'?" in wrong.err
    assert "Did you mean 'probes.valve.acceleration.largest'?" in wrong.err
    assert len(wrong.err.splitlines()) == 2
    assert not (tmp_path / "results").exists()


def test_scalars_available_in_some_variants_only(flexcam, case):
    """A rigid train has no deviation from itself, a flexible model has one; the order of the variants is irrelevant."""
    words = ("sweep", case, *QUICK, "--workers", "0", "--scalars", "deviation", "--json", "--overwrite")
    for models in ("rigid,beams", "beams,rigid"):
        done = flexcam(*words, "--set", f"fidelity.model={models}")
        assert list(done.json["scalars"]) == ["deviation.peak", "deviation.rms"]
    assert flexcam(*words, "--set", "fidelity.model=rigid", "--set", "run.revolutions=1,2").code == 2


def test_resume_with_corrected_scalars_repeats_no_run(flexcam, tmp_path):
    """The member is never compressed, so it has no buckling margin: this is known only after all runs."""
    words = ("sweep", ROOT / "cases/checks/cantilever.toml", "--set", "loads.push.force=100,200N", "--workers", "0")
    wrong = flexcam(*words, "--scalars", "members.beam.buckling_margin")
    assert wrong.code == 2
    assert "--resume" in wrong.err
    before = read_journal(tmp_path / "results")
    assert flexcam(*words, "--scalars", "probes.tip", "--resume").code == 0
    assert read_journal(tmp_path / "results") == before


def test_sweep_of_probe_scalars_computes_no_other_scalars(flexcam, case, tmp_path):
    """The journal records the selection; a journal with all scalars serves every selection."""
    words = ("sweep", case, *QUICK, *SPEEDS, "--workers", "0")
    assert flexcam(*words, "--scalars", "deviation,probes.valve").code == 0
    _, *rows = read_journal(tmp_path / "results")
    assert not any(b"contacts." in row or b"energy." in row for row in rows)
    before = read_journal(tmp_path / "results")
    refused = flexcam(*words, "--scalars", "probes,contacts", "--resume")
    assert refused.code == 2
    assert "whether scalars other than those of the probes are computed" in refused.err
    assert read_journal(tmp_path / "results") == before
    assert flexcam(*words, "--scalars", "probes", "--resume").code == 0
    assert flexcam(*words, "--overwrite").code == 0
    everything = read_journal(tmp_path / "results")
    (tmp_path / "results/case.sweep.jsonl").write_bytes(b"".join(everything[:-1]))  # as a crash leaves it
    assert flexcam(*words, "--scalars", "probes", "--resume").code == 0
    assert b"contacts." in read_journal(tmp_path / "results")[-1]
    assert flexcam(*words, "--scalars", "contacts", "--resume").code == 0


def test_failed_variants_do_not_stop_sweep(flexcam, case):
    stable, unstable = (f"{{ method = 'newmark', beta = {beta} }}" for beta in (0.25, 0.001))
    words = ("sweep", case, "--set", "run.steps_per_revolution=360", "--workers", "0")
    done = flexcam(*words, "--set", f"run.integrator={stable},{unstable}", "--set", "run.revolutions=20")
    assert done.code == 0
    assert "1 of 2 failed (not-finite): variant 2. The first:" in done.out
    failing = ("--set", f"run.integrator={unstable}", "--set", "run.revolutions=20,21")
    done = flexcam(*words, *failing, "--json", "--overwrite")
    assert done.code == 3
    assert done.json["status"] == "not-finite"
    assert done.json["failed"] == {"not-finite": [1, 2]}
    assert done.json["scalars"] == {}


@contextmanager
def unanswered_address(listening):
    """Yield an address without a scheduler; with `listening`, connections are accepted but not answered."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        if listening:
            server.listen()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.slow
@pytest.mark.parametrize("listening", [False, True])
def test_scheduler_without_answer_is_refused(flexcam, case, tmp_path, monkeypatch, listening):
    monkeypatch.setattr("flexcam.studies.executors._TIMEOUT", 0.5)
    with unanswered_address(listening) as address:
        done = flexcam("sweep", "case.toml", *SPEEDS, "--scheduler", address)
    assert done.code == 2
    assert "None answers there within 0.5 s" in done.err
    assert ("Connection refused" in done.err) is not listening
    assert not list((tmp_path / "results").iterdir())


@pytest.mark.parametrize(
    ("address", "why"),
    [
        pytest.param(  # RFC 2606: never exists
            "tcp://nobody.invalid:8786", "Name or service not known", marks=pytest.mark.slow
        ),
        ("tcp://127.0.0.1", "missing port number"),
        ("http://127.0.0.1:8786", "unknown address scheme"),
    ],
)
def test_invalid_scheduler_address_is_refused(flexcam, case, monkeypatch, address, why):
    def raise_unknown_name(*asked, **more):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", raise_unknown_name)  # slow in some networks
    monkeypatch.setattr("flexcam.studies.executors._TIMEOUT", 3.0)  # time for one attempt on a busy machine
    done = flexcam("sweep", "case.toml", *SPEEDS, "--scheduler", address)
    assert done.code == 2
    assert why in done.err
    assert "tcp://HOST:PORT" in done.err


@pytest.mark.slow
@pytest.mark.parametrize("listening", [False, True])
def test_scheduler_timeout_is_below_ten_seconds(spawn, case, listening):
    start_time = time.monotonic()
    with unanswered_address(listening) as address:
        done = spawn("sweep", "case.toml", *SPEEDS, "--scheduler", address)
    assert done.code == 2
    assert "None answers there" in done.err
    assert time.monotonic() - start_time < 10.0


def test_other_server_at_scheduler_address_is_refused(flexcam, case):
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()

        def send_http_error():
            with server.accept()[0] as call:
                call.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        server_thread = threading.Thread(target=send_http_error)
        server_thread.start()
        done = flexcam("sweep", case, *SPEEDS, "--scheduler", f"tcp://127.0.0.1:{server.getsockname()[1]}")
        server_thread.join()
    assert done.code == 2
    assert "None answers there" in done.err


@pytest.mark.parametrize(
    ("words", "where"),
    [
        (("--seed", "5"), "--seed: got 5, expected --seed only with --sample"),
        (("--seed", "-1", "--sample", "lhs:4"), "--seed: got -1, expected a whole number, at least 0"),
        (("--sample", "lhs"), "--sample: got 'lhs', expected lhs:N"),
        (("--limit", "-5"), "--limit: got -5, expected a whole number, at least 1"),
        (("--workers", "-1"), "--workers: got -1, expected a whole number, at least 0"),
        (("--workers", "0", "--scheduler", "local"), "--workers: got 0, expected a whole number, at least 1"),
    ],
)
def test_unused_or_invalid_sweep_options_are_refused(words, where, flexcam, case, tmp_path):
    done = flexcam("sweep", case, *SPEEDS, *words, "-o", tmp_path / "out")
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith(where)
    assert not (tmp_path / "out").exists()


MANY = ("--set", "run.speed=1000:4000#20rpm", "--set", "run.revolutions=1")


def start_sweep(folder, *words):
    return start(["sweep", "case.toml", *MANY, "-o", "out", *words], folder)


def wait_for_rows(process, folder, count):
    """Wait until the journal contains the given number of rows."""
    until = time.monotonic() + 60.0
    while len(read_journal(folder)) <= count:
        if process.poll() is not None or time.monotonic() > until:
            process.kill()
            pytest.fail(f"no rows: {process.communicate()}")
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("number", "code", "workers"),
    [pytest.param(signal.SIGINT, 130, 2, marks=pytest.mark.slow), (signal.SIGTERM, 143, 0)],
)
def test_stopped_sweep_reports_saved_variants(case, tmp_path, number, code, workers):
    process = start_sweep(tmp_path, "--workers", str(workers), "--json")
    wait_for_rows(process, tmp_path / "out", 3)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == code
    assert "Traceback" not in out + err
    report = json.loads(out)
    assert report["status"] == "interrupted"
    assert f"{len(read_journal(tmp_path / 'out')) - 1} of 20 variants are kept" in report["message"]
    assert "--resume" in report["remedy"]
    assert not (tmp_path / "out/case.sweep.h5").exists()


def check_killed_and_resumed_sweep(flexcam, folder, kills, seed, workers):
    """Kill a sweep repeatedly at random moments, finish it, and compare it with an uninterrupted sweep."""
    chance, before = random.Random(seed), list[bytes]()
    for _ in range(kills):
        process = start_sweep(folder, "--workers", workers, "--resume")
        if chance.random() < 0.7:
            wait_for_rows(process, folder / "out", min(len(before) + chance.randrange(8), 16))
        time.sleep(chance.random())
        process.kill()
        process.communicate()
        after = read_journal(folder / "out")
        complete_lines = [line for line in before if line.endswith(b"\n")]
        assert after[: len(complete_lines)] == complete_lines  # complete rows are unchanged
        before = after
    for words in (("out", "--resume"), ("untouched",)):
        assert flexcam("sweep", "case.toml", *MANY, "--workers", "0", "-o", *words).code == 0
    chunks = [json.loads(line)["chunk"] for line in read_journal(folder / "out")[1:]]
    assert sorted(chunks) == list(range(20))  # each chunk once
    resumed, uninterrupted = (
        [(folder / where / name).read_bytes() for name in NAMES] for where in ("out", "untouched")
    )
    assert resumed == uninterrupted


@pytest.mark.slow
@pytest.mark.parametrize(("kills", "workers"), [(1, 0), (20, 2)])
def test_killed_and_resumed_sweep_equals_uninterrupted_sweep(kills, workers, flexcam, case, tmp_path):
    check_killed_and_resumed_sweep(flexcam, tmp_path, kills, seed=kills, workers=workers)


def test_sweep_table_of_other_format_is_refused(flexcam, case, tmp_path):
    assert flexcam("sweep", case, *QUICK, *SPEEDS, "--workers", "0").code == 0
    path = tmp_path / "results/case.sweep.h5"
    with h5py.File(path, "r+") as file:
        form = file["about/format"]
        form[...] = np.full(form.shape, b"2", dtype=form.dtype)
    with pytest.raises(InputError, match="An earlier flexcam wrote it"):
        read_table(path)


def test_rows_of_runs_with_warnings_have_them_in_message(flexcam, tmp_path):
    """The follower loses contact only at the higher speed."""
    words = ("sweep", ROOT / "cases/pushrod-engine/intake.toml", "--set", "run.crank_speed=3000,6500rpm", "--set",
             "run.steps_per_revolution=1440", "--workers", "0", "--overwrite", "-o", tmp_path)  # fmt: skip
    done = flexcam(*words)
    assert "1 of 2 ran with warnings: variant 2. The first: Warning: the follower of 'intake' loses contact" in done.out
    assert flexcam(*words, "--json").json["warned"] == 1
    for name in ("intake.sweep.h5", "intake.sweep.csv"):
        table = read_table(tmp_path / name)
        assert [status.message == "" for status in table.statuses] == [True, False]
        assert table["periodicity"].max() < 0.1
    assert "periodicity" not in flexcam(*words, "--set", "run.revolutions=1").out


def test_frequencies_are_columns_on_request(flexcam, case, tmp_path):
    words = ("sweep", case, *QUICK, "--set", "springs.valve.stiffness=30,120kN/m", "--workers", "0", "-o", tmp_path)
    names = "frequency.1,deviation.peak"
    assert flexcam(*words, "--scalars", names).code == 0
    table = read_table(tmp_path / "case.sweep.h5")
    assert sorted(table.scalars) == sorted(names.split(","))
    assert table.units["frequency.1"] == "Hz"
    expected = [flexcam("modes", case, "--set", f"springs.valve.stiffness={k}kN/m", "--json").json for k in (30, 120)]
    hertz = [found["frequencies_hz"][found["free_motions"]] for found in expected]
    np.testing.assert_allclose(table["frequency.1"], hertz, rtol=1e-12)
    assert "natural frequencies among the results" in flexcam(*words, "--resume", "--scalars", "frequency.2").err
    assert flexcam(*words, "--overwrite", "--scalars", "frequency.0").code == 2
    failed = flexcam(*words, "--overwrite", "--scalars", "deviation,frequency.999").err
    assert "The model has no more modes" in failed
    assert "run is complete" not in failed


def test_sweep_warns_of_values_of_last_variant(flexcam, case, tmp_path):
    words = ("--set", "masses.valve.mass=90,90000g", "--scalars", "deviation", "--workers", "0", "-o", tmp_path)
    assert flexcam("sweep", case, *QUICK, *words).err.count("90000g (90 kg) is unusual") == 1
