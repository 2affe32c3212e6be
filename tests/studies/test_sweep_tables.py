"""Tables of sweeps: round trips, reproducible bytes, no NaN in files."""

import csv
from dataclasses import replace

import h5py
import numpy as np
import pytest

from flexcam import InputError, build_model, read_case, run
from flexcam.dynamics import Cause, Status
from flexcam.io.sweep_table import (
    format_csv,
    is_scalar_prefix,
    read_table,
    table_frame,
    unknown_scalar_fault,
    write_table,
)
from flexcam.studies.journal import make_table
from flexcam.studies.plan import Plan, Row, make_plan, parse_axes, parse_sample

FAILED = Status(Cause.NOT_FINITE, 'it left, "far"\nµm', "a smaller step")


def make_rows(count):
    units = {"contacts.a.force.largest": "N", "deviation.peak": "1", "late": "m"}
    found = [
        Row(Status(), {"contacts.a.force.largest": 1.0 / (i + 1), "deviation.peak": 0.1 * i}) for i in range(count)
    ]
    found[1] = Row(FAILED)
    found[-1] = replace(found[-1], scalars={**found[-1].scalars, "late": -0.25})
    return [replace(row, units={name: units[name] for name in row.scalars}) for row in found]


@pytest.fixture
def table():
    plan = make_plan(parse_axes(["run.speed=1000:3000:1000rpm", "run.integrator.method=newmark,bathe"]))
    return make_table(plan, make_rows(6), {"case": "title = 'ä'", "plan": "{}"})


def assert_equal_tables(one, other):
    assert [c.name for c in one.inputs] == [c.name for c in other.inputs]
    assert all(
        list(a.values) == list(b.values) and a.unit == b.unit for a, b in zip(one.inputs, other.inputs, strict=True)
    )
    assert list(one.scalars) == list(other.scalars)
    assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.scalars)
    assert (one.units, one.statuses, one.shape, one.about) == (other.units, other.statuses, other.shape, other.about)


def test_hdf5_round_trip(table, tmp_path):
    assert_equal_tables(read_table(write_table(table, tmp_path / "t.h5")), table)
    sampled = make_table(Plan(parse_axes(["a=0:1 m", "b=x,y"]), parse_sample("lhs:6")), make_rows(6))
    assert_equal_tables(read_table(write_table(sampled, tmp_path / "s.h5")), sampled)
    nothing = make_table(Plan(parse_axes(["a=1,2"])), [Row(FAILED), Row(FAILED)])
    assert_equal_tables(read_table(write_table(nothing, tmp_path / "n.h5")), nothing)


@pytest.mark.parametrize("end", ["h5", "csv", "parquet"])
def test_equal_tables_give_equal_bytes(table, tmp_path, end):
    one, other = (write_table(table, tmp_path / f"{name}.{end}").read_bytes() for name in "ab")
    assert one == other
    assert not list(tmp_path.glob("*partial*"))


def test_files_contain_no_nan(table, tmp_path):
    with h5py.File(write_table(table, tmp_path / "t.h5")) as file:
        for name, values in file["scalars"].items():
            assert np.isfinite(values[()]).all()
            assert (values[()][~file["valid"][name][()]] == 0.0).all()
        assert file["valid/late"][()].tolist() == [False] * 5 + [True]
    assert "nan" not in format_csv(table).lower()


def test_csv_columns_and_values(table):
    read = list(csv.DictReader(format_csv(table).splitlines(keepends=True)))
    assert [row["variant"] for row in read] == list("123456")
    assert [float(row["run.speed [rpm]"]) for row in read] == [1000, 1000, 2000, 2000, 3000, 3000]
    assert read[1]["deviation.peak"] == ""
    assert read[1]["status"] == "not-finite"
    assert read[1]["message"] == f"{FAILED.text}; {FAILED.remedy}"
    assert float(read[5]["contacts.a.force.largest [N]"]) == table["contacts.a.force.largest"][5]
    assert float(read[5]["late [mm]"]) == 1e3 * table["late"][5]


def test_table_frame(table):
    frame = table_frame(table)
    assert frame.loc[4, "deviation.peak"] == table["deviation.peak"][3]
    assert frame.loc[2].isna()["deviation.peak"]
    assert frame.attrs["units"]["run.speed"] == "rpm"


def test_parquet_has_nulls_for_missing_values(table, tmp_path):
    from pyarrow import parquet

    column = parquet.read_table(write_table(table, tmp_path / "t.parquet"))["deviation.peak"]
    assert column.null_count == 1


def test_histories_as_frame():
    response = run(read_case("tests/data/inline.toml", ["run.revolutions=0.1"]))
    frame = response.to_frame()
    assert np.array_equal(frame["valve.displacement"], response["valve"].displacement)
    assert np.array_equal(frame["contacts.intake.force"], response.channels["contacts.intake.force"])
    assert frame.index.name == "time"
    assert frame.attrs["units"]["valve.acceleration"] == "m/s^2"
    assert np.array_equal(frame["cam_angle"], response.angle)


def test_data_frame_without_pandas_raises_error(monkeypatch):
    response = run(read_case("tests/data/inline.toml", ["run.revolutions=0.1"]))
    monkeypatch.setattr("flexcam.core.errors.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"flexcam\[tables\]"):
        response.to_frame()


def test_descriptions_name_contents():
    case = read_case("tests/data/inline.toml", ["run.revolutions=0.1"])
    assert repr(case.title) in repr(case)
    assert all(name in repr(build_model(case)) for name in (*case.record.contacts, *case.record.members))
    assert "done: the run is complete" in repr(run(case))


def test_invalid_files_and_names_raise_error(table, tmp_path):
    path = write_table(table, tmp_path / "t.h5")
    with pytest.raises(InputError, match="Use --overwrite"):
        write_table(table, path)
    with pytest.raises(InputError, match="ends in"):
        write_table(table, tmp_path / "t.xlsx")
    with pytest.raises(InputError, match="no such file"):
        read_table(tmp_path / "none.h5")
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError):
        read_table(path)
    with pytest.raises(InputError, match=r"Did you mean 'deviation\.peak'"):
        table["deviation.peek"]
    with pytest.raises(InputError, match="deviaton"):
        table.select(["contacts", "deviaton"])
    assert list(table.select(["late", "contacts"]).scalars) == ["late", "contacts.a.force.largest"]


def test_prefix_is_suggested_only_where_allowed():
    """A figure needs a column."""
    scalars = ["springs.valve.stress.largest"]
    remedies = [unknown_scalar_fault("springs.valve.stres", scalars, prefixes=p).remedy for p in (True, False)]
    assert remedies == ["did you mean 'springs.valve.stress'?", "did you mean 'springs.valve.stress.largest'?"]


def test_scalars_are_selected_by_prefix():
    assert is_scalar_prefix("contacts.", ["contacts.seat.force"])
    assert is_scalar_prefix("contacts.seat", ["contacts.seat.force"])
    assert not is_scalar_prefix("contacts.se.", ["contacts.seat.force"])
