"""Content of a report: reduced curves, texts, tables, deflected members, and escaping of the page."""

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
from flexcam.dynamics import Outline, Response, Series, scalar_probes
from flexcam.fem.assembly import Member, build_beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.recovery import deflection
from flexcam.fem.sections import Section
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

HTML = """</script></title><script>alert("1")</script><img src=x onerror='alert(2)'> & "quoted" 'single' {{ 7 * 7 }}"""


def noisy_curve(count, seed=1):
    """Return a smooth curve with random spikes."""
    noise = np.random.default_rng(seed)
    x = np.linspace(0.0, 720.0, count)
    return x, np.sin(np.radians(x)) + (noise.random(count) > 0.99) * noise.random(count)


def make_response(probes, channels, count=721):
    """Return a response in which all histories are different curves."""
    columns = sum(len(components) for _, components in probes)
    x, _ = noisy_curve(count)
    values = np.column_stack([noisy_curve(count, seed)[1] for seed in range(columns)])
    none = np.zeros(0)
    empty = np.zeros((0, 0))
    return Response(
        Outline((), tuple(probes), tuple((name, "N") for name in channels)), np.radians(x) / 300.0, np.radians(x),
        Series(values, 2 * values, 3 * values),
        {name: noisy_curve(count, 99 + i)[1] for i, name in enumerate(channels)},
        none, none, Series(empty, empty, empty),
    )  # fmt: skip


def test_reduced_curve_keeps_extremes_and_shape(readonly):
    x, y = map(readonly, noisy_curve(7201))
    few, values = reduce_points(x, y)
    assert len(few) < len(x) / 4
    assert (values.min(), values.max(), few[0], few[-1]) == (y.min(), y.max(), x[0], x[-1])
    assert np.isin(few, x).all()
    assert np.abs(np.interp(x, few, values) - y).max() <= 1e-4 * np.ptp(y), "larger than the stated tolerance"


def test_reduced_line_has_two_points_and_limit_applies():
    x = np.linspace(0.0, 1.0, 1000)
    assert len(reduce_points(x, 3.0 * x)[0]) == 2
    assert len(reduce_points(x, np.random.default_rng(2).random(1000), most=100)[0]) <= 100
    assert len(reduce_points(x[:1], x[:1])[0]) == 1


def test_reduced_long_history_keeps_peaks():
    x, y = noisy_curve(300_000)
    few, values = reduce_points(x, y)
    assert len(few) <= 3000
    assert (values.min(), values.max(), few[0], few[-1]) == (y.min(), y.max(), x[0], x[-1])
    assert (np.diff(few) > 0.0).all()


def test_charts_combine_curves_of_several_results():
    one = make_response([("valve", ("valve",)), ("cam", ("ux", "rx"))], ["contacts.seat.force", "springs.valve.surge"])
    other = make_response([("valve", ("valve",))], ["contacts.seat.force"])
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
    sentence = f"to {1e3 * one['valve'].displacement[at]:.4g} mm at {np.degrees(one.angle[at]):.4g} deg"
    assert sentence in valve.words[0]


def test_points_of_many_curves_are_limited():
    """Six results with thirty probes: the points fit into 1 MB, and a note states that some are omitted."""
    one = make_response(
        [(f"p{i}", ("ux", "uy", "uz")) for i in range(30)], [f"contacts.c{i}.force" for i in range(40)], 1500
    )
    runs = {str(i): (one, None) for i in range(6)}
    found, notes = build_albums(runs, "p3.uy")
    assert found[0].charts[0].name == "p3.uy"
    curves = [c for album in found for chart in album.charts for panel in chart.panels for c in panel.curves]
    assert sum(len(curve.x) for curve in curves) <= 55_000
    assert len(notes) == 1
    assert build_albums({"": (make_response([("a", ("a",))], []), None)}, "a")[1] == []


def test_run_without_steps_has_no_curves():
    assert build_albums({"": (make_response([("a", ("a",))], ["contacts.c.force"], 0), None)}, "a") == ([], [])
    assert scalar_probes(Outline((), (("a", ("a",)), ("b", ("ux", "uy"))), ())) == {
        "a": "a",
        "b.ux": "ux",
        "b.uy": "uy",
    }


def test_terminal_tables_are_converted():
    made = report_table(
        plain_table("Stresses", ("MPa", "mean"), [("rod", "1.5"), ("shaft", "a place with a long name, here")])
    )
    rows = (("rod", "1.5"), ("shaft", "a place with a long name, here"))
    assert made == ReportTable("Stresses", ("MPa", "mean"), rows, (0, 1))
    assert report_table(facts_table("Facts", [("a", "1")])) == ReportTable("Facts", (), (("a", "1"),), (0, 1))


@pytest.mark.parametrize("columns", [100, 80])
def test_table_header_is_wrapped_between_words(monkeypatch, capsys, columns):
    """Text columns become narrow first."""
    monkeypatch.setenv("COLUMNS", str(columns))
    heads = ("limit", "crank rpm", "uncertainty", "occurs at", "event")
    row = ("contact", "5800 or below", "", "5800 to at least 6663.73", 5 * "the follower leaves its cam ")
    result_console().print(plain_table("Title", heads, [row]))
    lines = capsys.readouterr().out.splitlines()[1:]
    assert all(len(line) <= columns for line in lines)
    shown = " ".join(itertools.takewhile(lambda line: not line.startswith("contact"), lines)).split()
    assert sorted(shown) == sorted(" ".join(heads).split())


def make_bar(steel, angles=(0.0, 0.0)):
    """Return a bar of one element and its direction."""
    direction = np.array(
        [np.cos(angles[0]) * np.cos(angles[1]), np.sin(angles[0]) * np.cos(angles[1]), np.sin(angles[1])]
    )
    mesh = Mesh([[0, 0, 0], direction.tolist()], {"bar": [0, 1]}, {"tip": [1]})
    return build_beams(mesh, {"bar": Member(steel, Section.rectangle(0.02, 0.03), shear=False)}), direction


def test_deflection_of_cantilever_matches_theory(steel):
    """Under a tip force w = F x^2 (3 l - x) / 6 EI, which the cubic element represents exactly."""
    made, _ = make_bar(steel)
    force = 100.0
    x = np.linspace(0.0, 1.0, 9)
    for along, bending, turn, sign in ((1, made.EIz[0], 5, 1.0), (2, made.EIy[0], 4, -1.0)):
        nodal = np.zeros((2, 6))
        axis = made.triads[0, along]
        nodal[1, :3] = force / (3.0 * bending) * axis
        nodal[1, 3:] = sign * force / (2.0 * bending) * made.triads[0, turn - 3]
        found = deflection(made, nodal, 8)[0]
        expected = force * x**2 * (3.0 - x) / (6.0 * bending)
        np.testing.assert_allclose(found[:, along], expected, rtol=1e-12, atol=1e-18)


def test_deflection_of_rigid_motion_is_exact(steel, readonly):
    """All points of the line move with the rigid motion."""
    made, direction = make_bar(steel, (0.4, 0.9))
    turn, shift = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    nodal = np.concatenate([np.array([shift, shift + np.cross(turn, direction)]), np.tile(turn, (2, 1))], axis=1)
    local = deflection(made, readonly(nodal), 4)[0]
    places = np.linspace(0.0, 1.0, 5)[:, None] * direction
    expected = shift + np.cross(turn, places)
    np.testing.assert_allclose(local[:, :3] @ made.triads[0], expected, atol=1e-14)


@pytest.fixture
def hostile_report():
    """Return a report in which all strings contain HTML and script code."""
    curve = Curve(HTML, 0, False, np.arange(3.0), np.arange(3.0))
    chart = Chart(HTML, (HTML,), (Panel(HTML, (curve,)),))
    shape = Shape(HTML, HTML, np.ones((1, 2, 3)))
    scene = Scene(np.zeros((2, 3)), {HTML: (0, 2)}, {HTML: 0}, (shape,))
    one = ReportTable(HTML, (HTML, HTML), ((HTML, HTML),))
    picture = Picture(HTML, b"png", HTML)
    chapter = Chapter(HTML, HTML, (HTML,), (HTML,), (HTML,), (one,), (picture,), scene, HTML, replace(one, heads=()))
    return Report(HTML, (chapter, chapter), (ChartGroup(HTML, HTML, (chart, chart)),), (HTML,), picture)


class PageParser(html.parser.HTMLParser):
    """Parser of the tags, attributes and texts of a page, with scripts separate."""

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


def test_hostile_texts_are_escaped(hostile_report):
    read = PageParser(render_page(hostile_report))
    assert len(read.scripts) == 4, "the data and three programs"
    data = json.loads(read.scripts[0])
    assert data["albums"][0]["charts"][0]["panels"][0]["curves"][0]["name"] == HTML, "the data are incomplete"
    assert list(data["scenes"][0]["names"]) == [HTML]
    assert not [one for one in read.tags if any(name.startswith("on") for name in one[1])], "no handler of an event"
    assert {attributes["src"].partition(",")[0] for tag, attributes in read.tags if tag == "img"} == {
        "data:image/png;base64"
    }
    assert "".join(read.texts).count(HTML) >= 12, "every string is text"


def test_content_security_policy_allows_only_own_scripts(hostile_report):
    """The policy contains the hashes of the scripts and no address."""
    read = PageParser(render_page(hostile_report))
    policy = next(a["content"] for tag, a in read.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.count("'sha256-") == 3
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy.partition("style-src")[0]
    assert "http" not in policy
    assert not [a for tag, a in read.tags if tag in ("link", "iframe", "object") or "://" in str(a.get("src", ""))]


def test_page_is_accessible(hostile_report):
    """Controls, pictures and drawings have names or roles; ids are unique, and references to them are valid."""
    read = PageParser(render_page(hostile_report))
    ids = [a["id"] for _, a in read.tags if "id" in a]
    assert len(ids) == len(set(ids))
    for tag, a in read.tags:
        assert tag != "img" or a["alt"]
        assert tag != "canvas" or (a["tabindex"], bool(a["aria-label"])) == ("0", True)
        for name in ("aria-labelledby", "aria-describedby"):
            assert name not in a or a[name] in ids
        assert not a.get("href", "").startswith("#") or a["href"][1:] in ids
    assert next(a["lang"] for tag, a in read.tags if tag == "html") == "en"


def test_embedded_json_is_escaped():
    embedded = embed_json({"a": "</script><!--\u2028&"})
    assert not set("<>&\u2028") & set(embedded)
    assert json.loads(embedded) == {"a": "</script><!--\u2028&"}
    with pytest.raises(ValueError, match="JSON"):
        embed_json(float("nan"))


def test_large_numbers_are_stored_in_double_precision():
    """Such numbers occur in diverged runs, and as cam angles of very long ones."""
    from flexcam.report.page import _numbers

    assert _numbers(np.array([1e300, -1e300]))["dtype"] == "f8"
    assert _numbers(np.array([3.6e6, 3.6e6 + 0.1]))["dtype"] == "f8"
    assert _numbers(np.array([0.0, 720.0]))["dtype"] == "f4"


def test_negative_zero_is_shown_without_sign():
    made = metrics_table(None, [Metric("members.rod.compression", -0.0, "N")])
    assert list(made.columns[1].cells) == ["0 N"]


@pytest.mark.slow
def test_model_ladder_reports_error_of_reference():
    """Sixty steps of Newmark's method do not resolve the vibration of a contact of 4 MN/m."""
    case = read_case(
        "cases/li/valve-train.toml",
        ["run.steps_per_revolution=60", "run.revolutions=1", "run.integrator.method=newmark"],
    )
    sentences, *_ = additional_content(case, "valve.uy", ReportOptions(trade=True))
    assert "the reference itself has a large error in" in sentences[0]


def test_oil_film_is_shown_in_micrometres():
    made = metrics_table(None, [Metric("contacts.exhaust.film.nose", 1.476e-7, "m")])
    assert [str(cell) for column in made.columns for cell in column.cells][-1] == "0.1476 µm"


def cell_texts(table, column):
    return [*table.columns[column].cells]


def test_maximum_of_single_part_has_cam_angle():
    """A row of several equal parts has only the value."""
    alone = metrics_table(None, [Metric("contacts.a.force.largest", 1038.0, "N", 1.5)])
    assert cell_texts(alone, 1) == ["1038 N at cam 85.9 deg"]
    many = metrics_table(None, [Metric(f"contacts.c{i}.force.largest", 1038.0, "N", 0.1 * i) for i in range(8)])
    assert cell_texts(many, 1) == ["1038 N (all 8)"]


def test_speed_bands_of_limit():
    """Speeds above the last examined one are unknown."""
    ends = {4922.8: "4000 to 4252 and 4688 to at least 4923", 4688.3: "4000 to 4252 and at 4688"}
    for examined, shown in ends.items():
        limit = Limit(4000.0, 5.0, "event", ((4000.0, 4252.4), (4688.3, None)), examined)
        table = limits_table(Limits({"float": limit}, 1000.0, 9000.0), Margins(None, None, {}), 1.0)
        assert cell_texts(table, 3) == [shown]
    limit = Limit(4000.0, 5.0, "event", ((4000.0, 4252.4),), 4922.8)
    table = limits_table(Limits({"float": limit}, 1000.0, 9000.0), Margins(None, None, {}, "none"), 1.0)
    assert cell_texts(table, 3)[0] == "4000 to 4252, not at 4923"
    assert cell_texts(table, 1)[-1] == "not known"


@pytest.mark.parametrize(
    ("limit", "shown"),
    [
        (Limit(5602.19, 8.57, "event"), ["5602", "5594 to 5602"]),
        (Limit(300.0, 0.5, "event", scatter_rpm=(299.1, 301.9)), ["300.0", "299.1 to 301.9"]),
        (Limit(45.0, math.inf, "event"), ["45 or below"]),
        (Limit(None, 1.0, "event"), ["above 9000"]),
    ],
)
def test_limits_are_rounded_to_their_uncertainty(limit, shown):
    table = limits_table(Limits({"float": limit}, 1000.0, 9000.0), Margins(None, None, {}), 1.0)
    heads = [str(column.header).split(" ")[-1] for column in table.columns]
    assert [cell_texts(table, heads.index(head))[0] for head in ("rpm", "uncertainty") if head in heads] == shown


@pytest.mark.parametrize(("columns", "count"), [(80, 7), (60, 5), (40, 3)])
def test_narrow_terminal_keeps_all_digits(monkeypatch, capsys, columns, count):
    """Text columns are narrowed in favour of numbers, which fit."""
    monkeypatch.setenv("COLUMNS", str(columns))
    heads, row = (
        ("no.", *count * ("acceleration",), "status"),
        ("1", *count * ("-12345.67",), "contact lost at the nose"),
    )
    result_console().print(plain_table("Title", heads, [row]))
    assert capsys.readouterr().out.count("-12345.67") == count
