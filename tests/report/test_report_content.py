"""What a report holds: curves thinned truly, words, tables, lines in space, and a page that nothing breaks out of."""

from __future__ import annotations

import html.parser
import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from flexcam import read_case
from flexcam.analysis.limits import Limit, Limits
from flexcam.analysis.run_metrics import Margins
from flexcam.dynamics import Outline, Response, Series
from flexcam.fem.assembly import Member, beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.recovery import deflection
from flexcam.fem.sections import Section
from flexcam.io.exports import scalar_probes
from flexcam.report.content import (
    Chapter,
    Chart,
    ChartGroup,
    Curve,
    Panel,
    Picture,
    Report,
    ReportOptions,
    ReportTable,
    Scene,
    Shape,
    additional_content,
    report_table,
)
from flexcam.report.figures import build_albums, reduce_points
from flexcam.report.page import embed_json, render_page
from flexcam.report.tables import limits_table, metrics_table
from flexcam.report.terminal import facts_table, plain_table, result_console
from flexcam.valvetrain import Metric

EVIL = """</script></title><script>alert("1")</script><img src=x onerror='alert(2)'> & "quoted" 'single' {{ 7 * 7 }}"""


def rough(count, seed=1):
    """Return a smooth curve with spikes."""
    noise = np.random.default_rng(seed)
    x = np.linspace(0.0, 720.0, count)
    return x, np.sin(np.radians(x)) + (noise.random(count) > 0.99) * noise.random(count)


def run_of(probes, channels, count=721):
    """Return a response whose every history is its own curve."""
    columns = sum(len(components) for _, components in probes)
    x, _ = rough(count)
    values = np.column_stack([rough(count, seed)[1] for seed in range(columns)])
    none = np.zeros(0)
    empty = np.zeros((0, 0))
    return Response(
        Outline((), tuple(probes), tuple((name, "N") for name in channels)), np.radians(x) / 300.0, np.radians(x),
        Series(values, 2 * values, 3 * values), {name: rough(count, 99 + i)[1] for i, name in enumerate(channels)},
        none, none, Series(empty, empty, empty),
    )  # fmt: skip


def test_a_thinned_curve_misses_nothing(readonly):
    x, y = map(readonly, rough(7201))
    few, values = reduce_points(x, y)
    assert len(few) < len(x) / 4
    assert (values.min(), values.max(), few[0], few[-1]) == (y.min(), y.max(), x[0], x[-1])
    assert np.isin(few, x).all()
    assert np.abs(np.interp(x, few, values) - y).max() <= 1e-4 * np.ptp(y), "as told"


def test_a_straight_line_is_two_points_and_a_limit_holds():
    x = np.linspace(0.0, 1.0, 1000)
    assert len(reduce_points(x, 3.0 * x)[0]) == 2
    assert len(reduce_points(x, np.random.default_rng(2).random(1000), most=100)[0]) <= 100
    assert len(reduce_points(x[:1], x[:1])[0]) == 1


def test_a_very_long_history_keeps_its_peaks():
    x, y = rough(300_000)
    few, values = reduce_points(x, y)
    assert len(few) <= 3000
    assert (values.min(), values.max(), few[0], few[-1]) == (y.min(), y.max(), x[0], x[-1])
    assert (np.diff(few) > 0.0).all()


def test_curves_of_several_results():
    one = run_of([("valve", ("valve",)), ("cam", ("ux", "rx"))], ["contacts.seat.force", "springs.valve.surge"])
    other = run_of([("valve", ("valve",))], ["contacts.seat.force"])
    (motion, forces), _ = build_albums({"slow": (one, other), "fast": (other, None)}, "cam.rx")
    assert [chart.name for chart in motion.charts] == ["cam.rx", "valve", "cam.ux"]
    assert [panel.label for panel in motion.charts[0].panels] == [
        "displacement, deg",
        "velocity, rad/s",
        "acceleration, rad/s²",
    ]
    valve = motion.charts[1]
    assert [curve.name for curve in valve.panels[0].curves] == ["slow", "slow, rigid", "fast"]
    assert [curve.group for curve in valve.panels[0].curves] == [0, 0, 1]
    assert valve.panels[0].label == "displacement, mm"
    assert valve.panels[0].curves[0].y.max() == pytest.approx(1e3 * one["valve"].displacement.max())
    assert [chart.name for chart in forces.charts] == ["contacts seat force", "springs valve surge"]
    at = np.argmax(one["valve"].displacement)
    told = f"to {1e3 * one['valve'].displacement[at]:.4g} mm at {np.degrees(one.angle[at]):.4g} deg"
    assert told in valve.words[0]


def test_a_page_has_room_for_many_curves():
    """Six results with thirty probes: points within what 1 MB holds, and said that some are left out."""
    one = run_of([(f"p{i}", ("ux", "uy", "uz")) for i in range(30)], [f"contacts.c{i}.force" for i in range(40)], 1500)
    runs = {str(i): (one, None) for i in range(6)}
    found, notes = build_albums(runs, "p3.uy")
    assert found[0].charts[0].name == "p3.uy"
    curves = [c for album in found for chart in album.charts for panel in chart.panels for c in panel.curves]
    assert sum(len(curve.x) for curve in curves) <= 55_000
    assert len(notes) == 1
    assert build_albums({"": (run_of([("a", ("a",))], []), None)}, "a")[1] == []


def test_a_run_without_instants_has_no_curves():
    assert build_albums({"": (run_of([("a", ("a",))], ["contacts.c.force"], 0), None)}, "a") == ([], [])
    assert scalar_probes(Outline((), (("a", ("a",)), ("b", ("ux", "uy"))), ())) == {
        "a": "a",
        "b.ux": "ux",
        "b.uy": "uy",
    }


def test_tables_of_the_terminal():
    made = report_table(
        plain_table("Stresses", ("MPa", "mean"), [("rod", "1.5"), ("shaft", "a place with a long name, here")])
    )
    rows = (("rod", "1.5"), ("shaft", "a place with a long name, here"))
    assert made == ReportTable("Stresses", ("MPa", "mean"), rows, (0, 1))
    assert report_table(facts_table("Facts", [("a", "1")])) == ReportTable("Facts", (), (("a", "1"),), (0, 1))


@pytest.mark.parametrize("columns", [100, 80])
def test_no_head_of_a_table_is_broken_inside_a_word(monkeypatch, capsys, columns):
    """Columns of words become narrow first."""
    monkeypatch.setenv("COLUMNS", str(columns))
    heads = ("limit", "crank rpm", "uncertainty", "occurs at", "event")
    row = ("contact", "5800 or below", "", "5800 to at least 6663.73", 5 * "the follower leaves its cam ")
    result_console().print(plain_table("Title", heads, [row]))
    lines = capsys.readouterr().out.splitlines()[1:]
    assert all(len(line) <= columns for line in lines)
    shown = " ".join(itertools.takewhile(lambda line: not line.startswith("contact"), lines)).split()
    assert sorted(shown) == sorted(" ".join(heads).split())


def cantilever(steel, angles=(0.0, 0.0)):
    """Return a bar of one element and its direction."""
    direction = np.array(
        [np.cos(angles[0]) * np.cos(angles[1]), np.sin(angles[0]) * np.cos(angles[1]), np.sin(angles[1])]
    )
    mesh = Mesh([[0, 0, 0], direction.tolist()], {"bar": [0, 1]}, {"tip": [1]})
    return beams(mesh, {"bar": Member(steel, Section.rectangle(0.02, 0.03), shear=False)}), direction


def test_deflection_of_a_cantilever(steel):
    """Under a force at its tip: w = F x^2 (3 l - x) / 6 EI, exactly what the element's cubic holds."""
    made, _ = cantilever(steel)
    force = 100.0
    x = np.linspace(0.0, 1.0, 9)
    for along, bending, turn, sign in ((1, made.EIz[0], 5, 1.0), (2, made.EIy[0], 4, -1.0)):
        nodal = np.zeros((2, 6))
        axis = made.triads[0, along]
        nodal[1, :3] = force / (3.0 * bending) * axis
        nodal[1, 3:] = sign * force / (2.0 * bending) * made.triads[0, turn - 3]
        found = deflection(made, nodal, 8)[0]
        wanted = force * x**2 * (3.0 - x) / (6.0 * bending)
        np.testing.assert_allclose(found[:, along], wanted, rtol=1e-12, atol=1e-18)


def test_deflection_turns_with_the_member(steel, readonly):
    """Rigid motion stays rigid: every point of the line moves with it."""
    made, direction = cantilever(steel, (0.4, 0.9))
    turn, shift = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    nodal = np.concatenate([np.array([shift, shift + np.cross(turn, direction)]), np.tile(turn, (2, 1))], axis=1)
    local = deflection(made, readonly(nodal), 4)[0]
    places = np.linspace(0.0, 1.0, 5)[:, None] * direction
    wanted = shift + np.cross(turn, places)
    np.testing.assert_allclose(local[:, :3] @ made.triads[0], wanted, atol=1e-14)


@pytest.fixture
def evil():
    """Return a report whose every string wants to break out."""
    curve = Curve(EVIL, 0, False, np.arange(3.0), np.arange(3.0))
    chart = Chart(EVIL, (EVIL,), (Panel(EVIL, (curve,)),))
    shape = Shape(EVIL, EVIL, np.ones((1, 2, 3)))
    scene = Scene(np.zeros((2, 3)), {EVIL: (0, 2)}, {EVIL: 0}, (shape,))
    one = ReportTable(EVIL, (EVIL, EVIL), ((EVIL, EVIL),))
    picture = Picture(EVIL, b"png", EVIL)
    chapter = Chapter(EVIL, EVIL, (EVIL,), (EVIL,), (EVIL,), (one,), (picture,), scene, EVIL, replace(one, heads=()))
    return Report(EVIL, (chapter, chapter), (ChartGroup(EVIL, EVIL, (chart, chart)),), (EVIL,), picture)


class Read(html.parser.HTMLParser):
    """Tags, attributes and the text of a page; what stands in scripts apart."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.scripts, self.texts = [], [], []
        self.inside = None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag):
        self.inside = None

    def handle_data(self, data):
        if self.inside == "script":
            self.scripts[-1] += data
        else:
            self.texts.append(data)


def test_nothing_breaks_out_of_the_page(evil):
    read = Read(render_page(evil))
    assert len(read.scripts) == 4, "the data and three programs"
    data = json.loads(read.scripts[0])
    assert data["albums"][0]["charts"][0]["panels"][0]["curves"][0]["name"] == EVIL, "and all of it arrives"
    assert list(data["scenes"][0]["names"]) == [EVIL]
    assert not [one for one in read.tags if any(name.startswith("on") for name in one[1])], "no handler of an event"
    assert {attributes["src"].partition(",")[0] for tag, attributes in read.tags if tag == "img"} == {
        "data:image/png;base64"
    }
    assert "".join(read.texts).count(EVIL) >= 12, "every string is text"


def test_only_our_programs_may_run(evil):
    """The policy names their hashes and allows no address."""
    read = Read(render_page(evil))
    policy = next(a["content"] for tag, a in read.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.count("'sha256-") == 3
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy.partition("style-src")[0]
    assert "http" not in policy
    assert not [a for tag, a in read.tags if tag in ("link", "iframe", "object") or "://" in str(a.get("src", ""))]


def test_everything_can_be_reached_and_read_aloud(evil):
    """Every control has a name, every picture a text, every drawing a role; ids are unique and lead somewhere."""
    read = Read(render_page(evil))
    ids = [a["id"] for _, a in read.tags if "id" in a]
    assert len(ids) == len(set(ids))
    for tag, a in read.tags:
        assert tag != "img" or a["alt"]
        assert tag != "canvas" or (a["tabindex"], bool(a["aria-label"])) == ("0", True)
        for name in ("aria-labelledby", "aria-describedby"):
            assert name not in a or a[name] in ids
        assert not a.get("href", "").startswith("#") or a["href"][1:] in ids
    assert next(a["lang"] for tag, a in read.tags if tag == "html") == "en"


def test_json_in_a_script():
    told = embed_json({"a": "</script><!--\u2028&"})
    assert not set("<>&\u2028") & set(told)
    assert json.loads(told) == {"a": "</script><!--\u2028&"}
    with pytest.raises(ValueError, match="JSON"):
        embed_json(float("nan"))


def test_numbers_too_large_for_single_precision_arrive():
    """Those of a run that diverged, and the cam angle of a very long one."""
    from flexcam.report.page import _numbers

    assert _numbers(np.array([1e300, -1e300]))["dtype"] == "f8"
    assert _numbers(np.array([3.6e6, 3.6e6 + 0.1]))["dtype"] == "f8"
    assert _numbers(np.array([0.0, 720.0]))["dtype"] == "f4"


def test_a_zero_of_the_train_has_no_sign():
    made = metrics_table(None, [Metric("members.rod.compression", -0.0, "N")])
    assert list(made.columns[1].cells) == ["0 N"]


def test_a_ladder_on_a_rough_reference_says_so():
    """Sixty steps of Newmark's method do not see how a contact of 4 MN/m rings."""
    case = read_case(
        "cases/li/valve-train.toml",
        ["run.steps_per_revolution=60", "run.revolutions=1", "run.integrator.method=newmark"],
    )
    sentences, *_ = additional_content(case, "valve.uy", ReportOptions(trade=True))
    assert "the reference itself has a large error in" in sentences[0]


def test_an_oil_film_is_shown_in_micrometres():
    made = metrics_table(None, [Metric("contacts.exhaust.film.nose", 1.476e-7, "m")])
    assert [str(cell) for column in made.columns for cell in column.cells][-1] == "0.1476 µm"


def cells_of(table, column):
    return [*table.columns[column].cells]


def test_cam_angle_of_extremes():
    """A row of one part has the cam angle; a row of many equal parts has the value alone."""
    alone = metrics_table(None, [Metric("contacts.a.force.largest", 1038.0, "N", 1.5)])
    assert cells_of(alone, 1) == ["1038 N at cam 85.9 deg"]
    many = metrics_table(None, [Metric(f"contacts.c{i}.force.largest", 1038.0, "N", 0.1 * i) for i in range(8)])
    assert cells_of(many, 1) == ["1038 N (all 8)"]


def test_bands_of_a_limit():
    """Speeds above the last examined one are not known."""
    ends = {4922.8: "4000 to 4252, 4688 to at least 4923", 4688.3: "4000 to 4252, at 4688"}
    for examined, shown in ends.items():
        limit = Limit(4000.0, 5.0, "event", ((4000.0, 4252.4), (4688.3, None)), examined)
        table = limits_table(Limits({"float": limit}, 1000.0, 9000.0), Margins(None, None, {}), 1.0)
        assert cells_of(table, 3) == [shown]
    limit = Limit(4000.0, 5.0, "event", ((4000.0, 4252.4),), 4922.8)
    table = limits_table(Limits({"float": limit}, 1000.0, 9000.0), Margins(None, None, {}, "none"), 1.0)
    assert cells_of(table, 3)[0] == "4000 to 4252, not at 4923"
    assert cells_of(table, 1)[-1] == "not known"


@pytest.mark.parametrize(
    ("limit", "shown"),
    [
        (Limit(5602.19, 8.57, "event"), ["5602", "5594 to 5602"]),
        (Limit(300.0, 0.5, "event", scatter_rpm=(299.1, 301.9)), ["300.0", "299.1 to 301.9"]),
        (Limit(45.0, math.inf, "event"), ["45 or below"]),
        (Limit(None, 1.0, "event"), ["above 9000"]),
    ],
)
def test_digits_of_limits(limit, shown):
    table = limits_table(Limits({"float": limit}, 1000.0, 9000.0), Margins(None, None, {}), 1.0)
    heads = [str(column.header).split(" ")[-1] for column in table.columns]
    assert [cells_of(table, heads.index(head))[0] for head in ("rpm", "uncertainty") if head in heads] == shown


@pytest.mark.parametrize(("columns", "count"), [(80, 7), (60, 5), (40, 3)])
def test_no_digit_is_lost_in_a_narrow_terminal(monkeypatch, capsys, columns, count):
    """Columns of words give way to the digits, which fit."""
    monkeypatch.setenv("COLUMNS", str(columns))
    heads, row = (
        ("no.", *count * ("acceleration",), "status"),
        ("1", *count * ("-12345.67",), "contact lost at the nose"),
    )
    result_console().print(plain_table("Title", heads, [row]))
    assert capsys.readouterr().out.count("-12345.67") == count
