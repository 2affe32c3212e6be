"""Axes and plans of sweeps: parsed text and resulting values."""

from contextlib import suppress
from decimal import Decimal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexcam import InputError
from flexcam.studies.plan import Plan, make_plan, parse_axes, parse_axis, parse_sample

NUMBERS = st.decimals(min_value=-1000, max_value=1000, places=3)
STEPS = st.decimals(min_value="0.001", max_value=100, places=3)
UNITS = st.sampled_from(["", "rpm", "kN/m", " kN/m", "N s/m", "mm^2", " 1/s"])


def axis_texts(spec):
    return [value.text for value in parse_axis("key", spec).values]


@settings(deadline=None, max_examples=40)  # independent of the load of the machine
@given(NUMBERS, STEPS, st.integers(0, 300), UNITS, st.booleans())
def test_range_by_step_includes_stop_on_grid(start, step, count, unit, down):
    step = -step if down else step
    stop = start + count * step
    found = parse_axis("key", f"{start}:{stop}:{step}{unit}")
    assert len(found.values) == count + 1
    assert [Decimal(repr(value.number)) for value in found.values] == [start + i * step for i in range(count + 1)]
    assert found.unit == unit.strip()
    assert all(value.text.endswith(unit.strip()) for value in found.values)
    beyond = parse_axis("key", f"{start}:{stop + step / 2}:{step}{unit}")
    assert beyond.values == found.values


@settings(deadline=None, max_examples=40)  # independent of the load of the machine
@given(NUMBERS, NUMBERS, st.integers(2, 300), UNITS)
def test_range_by_count_is_even_with_both_ends(start, stop, count, unit):
    if start == stop:
        stop += 1
    found = parse_axis("key", f"{start}:{stop}#{count}{unit}")
    assert len(found.values) == count
    assert (found.values[0].number, found.values[-1].number) == (float(start), float(stop))
    steps = [b.number - a.number for a, b in zip(found.values, found.values[1:], strict=False)]
    assert steps == pytest.approx([float(stop - start) / (count - 1)] * (count - 1), rel=1e-6, abs=1e-9)


@settings(deadline=None, max_examples=40)  # independent of the load of the machine
@given(st.lists(NUMBERS, min_size=1, max_size=20), UNITS)
def test_unit_at_end_of_list_applies_to_all(numbers, unit):
    found = parse_axis("key", ",".join(map(str, numbers)) + unit)
    assert [value.number for value in found.values] == [float(number) for number in numbers]
    assert all(value.text.endswith(unit.strip()) for value in found.values)
    assert found.is_numeric


@settings(deadline=None, max_examples=40)  # independent of the load of the machine
@given(NUMBERS, STEPS, st.floats(0, 1, exclude_max=True))
def test_interval_is_sampled_inside(low, width, part):
    found = parse_axis("key", f"{low}:{low + width} kN/m")
    value = found.at(part)
    assert found.interval
    # ten digits of a number up to 1100: half a unit of the tenth is 5e-7
    assert float(low) - 1e-6 <= value.number <= float(low + width) + 1e-6
    assert value.text.endswith("kN/m")


@settings(deadline=None, max_examples=40)  # independent of the load of the machine
@given(st.text(max_size=40))
def test_any_text_is_axis_or_input_error(spec):
    with suppress(InputError):
        assert parse_axis("key", spec).values


@pytest.mark.parametrize(
    ("spec", "values"),
    [
        ("30,40,50 kN/m", ["30kN/m", "40kN/m", "50 kN/m"]),
        ("30 N/mm, 40 kN/m", ["30 N/mm", "40 kN/m"]),
        ("newmark,bathe", ["newmark", "bathe"]),
        ("[0,0,0],[0,0,-9.81]", ["[0,0,0]", "[0,0,-9.81]"]),
        ("{ m = 'hht', alpha = -0.1 },{ m = 'bathe' }", ["{ m = 'hht', alpha = -0.1 }", "{ m = 'bathe' }"]),
        ('"a,b",c', ['"a,b"', "c"]),
        ("2.0", ["2.0"]),
        ("4000 rpm", ["4000 rpm"]),
        ("360:1080:360", ["360", "720", "1080"]),  # integers stay integers, which some keys require
        ("1e3:2e3#3rpm", ["1000rpm", "1500rpm", "2000rpm"]),
        ("1rpm:2rpm:1rpm", ["1rpm", "2rpm"]),
    ],
)  # fmt: skip
def test_axis_values_as_text(spec, values):
    assert axis_texts(spec) == values


def test_grid_order_and_single_values():
    plan = make_plan(parse_axes(["a.b=1,2", "c=5", "d=x,y,z"]))
    assert plan.shape == (2, 3)
    assert plan.variants[0] == ("c=5", "a.b=1", "d=x")
    assert [variant[1:] for variant in plan.variants] == [(f"a.b={i}", f"d={j}") for i in "12" for j in "xyz"]


@pytest.mark.parametrize("how", ["lhs:16", "sobol:16"])
def test_sample_is_stratified_and_repeatable_by_seed(how):
    made = parse_axes(["a=0:16 m", "b=w,x,y,z", "c=1:8:1"])
    plan = make_plan(made, parse_sample(how, 3))
    assert (
        plan.variants
        == make_plan(made, parse_sample(how, 3)).variants
        != make_plan(made, parse_sample(how, 4)).variants
    )
    assert sorted(int(point[0].number) for point in plan.points) == list(range(16))
    assert {point[1].text: 0 for point in plan.points}.keys() == set("wxyz")
    assert {int(point[2].number) for point in plan.points} == set(range(1, 9))


def test_plan_of_single_values_has_one_variant():
    assert Plan(parse_axes(["a=1", "b=2"])).variants == (("a=1", "b=2"),)
