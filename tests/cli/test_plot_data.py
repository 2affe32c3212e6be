"""flexcam plot: the values of its curves, markers and maps."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from flexcam import prepare, read_case, read_result, run
from flexcam.analysis.natural_modes import Campbell
from flexcam.analysis.orders import Signal, Waterfall
from flexcam.analysis.run import member_strength
from flexcam.analysis.run_metrics import compute_metrics
from flexcam.dynamics import Cause, Status
from flexcam.io.sweep_table import Column, SweepTable, read_table, write_table
from flexcam.plotting import figures
from flexcam.plotting.histories import last_revolution
from flexcam.plotting.spectra import campbell_figure, waterfall_figure

CASES = Path(__file__).parents[2] / "cases"
ENGINE, BUCKET = CASES / "pushrod-engine/intake.toml", CASES / "direct-acting/bucket.toml"
FEW = ("run.steps_per_revolution=720", "run.revolutions=1")
KERNEL = "run.engine=kernel"
SPEEDS, PRESSURE = ("1000", "2000"), "contacts.intake.pressure.largest"


@pytest.fixture
def draw_figure(flexcam, monkeypatch):
    """Return a function that creates the figure of `flexcam plot`."""

    def draw(*words, overrides=()):
        figures_drawn = []
        monkeypatch.setattr(figures, "save_figure", lambda figure, *_, **__: figures_drawn.append(figure))
        set_options = [word for override in overrides for word in ("--set", override)]
        done = flexcam("plot", *words, *set_options)
        assert (done.code, done.err) == (0, "")
        (figure,) = figures_drawn
        figure.draw_without_rendering()
        return figure

    return draw


@pytest.fixture
def engine(intake, tmp_path):
    shutil.copy(intake, tmp_path / "intake.vtkhdf")
    return read_result(intake).response


def legend_texts(legend):
    return [text.get_text() for text in legend.get_texts()]


def shaded_intervals(area):
    """Return the intervals of a shaded area."""
    return [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in area.get_paths()]


def test_last_revolution_from_dead_centre(engine):
    zero = math.radians(120.0)
    last = last_revolution(engine, zero, -math.pi)
    assert (np.diff(last.angle) > 0.0).all()
    assert last.angle[0] == pytest.approx(-math.pi, abs=1e-6)
    assert len(last.angle) == 720
    index = np.searchsorted(last.angle, math.radians(60.0) - 1e-6)  # cam angle 180 deg
    for values, full_history in ((last.channels["contacts.intake.force"], engine.channels["contacts.intake.force"]),
                          (last["valve"].displacement, engine["valve"].displacement)):  # fmt: skip
        assert values[index] == full_history[360]


@pytest.mark.slow
def test_rigid_difference_and_contact_loss_are_plotted(draw_figure):
    """The last panel shows the lift difference; zero cam force during the lift is shaded in every panel."""
    fast = [*FEW, "run.crank_speed=6500rpm", "run.engine=kernel"]
    figure = draw_figure(ENGINE, "--rigid", overrides=fast)
    case = read_case(ENGINE, fast)
    flexible, rigid = run(case), run(case, rigid=True)
    *others, panel = figure.axes
    assert [len(axes.collections) for axes in figure.axes] == [1] * 5
    line = panel.lines[0]
    np.testing.assert_allclose(
        line.get_ydata(), 1e3 * (flexible["valve"].displacement - rigid["valve"].displacement), atol=1e-12
    )
    assert panel.get_ylabel() == "flexible\nminus rigid\nmm"
    assert legend_texts(figure.legends[-1]) == ["contact lost during the lift"]
    shaded = [part for part in shaded_intervals(others[0].collections[0]) if part[1] - part[0] > 1.0]
    assert shaded
    for begin, end in shaded:
        inside = (np.degrees(flexible.angle) > begin + 0.1) & (np.degrees(flexible.angle) < end - 0.1)
        assert (flexible.channels["contacts.intake.force"][inside] == 0.0).all()


@pytest.mark.slow
def test_several_runs_are_plotted_over_last_revolution(draw_figure, flexcam, tmp_path):
    for folder, rpm in (("a", 3000), ("b", 4000)):
        overrides = (FEW[0], KERNEL, f"run.crank_speed={rpm}rpm", "run.revolutions=1.5")
        words = [part for override in overrides for part in ("--set", override)]
        assert flexcam("run", ENGINE, "-o", folder, *words).code == 0
    figure = draw_figure("a/intake.vtkhdf", "b/intake.vtkhdf")
    assert legend_texts(figure.legends[0]) == ["intake, crank 3000 rpm", "intake, crank 4000 rpm"]
    for line, folder in zip(figure.axes[0].lines, "ab", strict=True):
        response = read_result(tmp_path / folder / "intake.vtkhdf").response
        last = last_revolution(response)
        np.testing.assert_allclose(line.get_xdata(), np.degrees(last.angle))
        np.testing.assert_allclose(line.get_ydata(), 1e3 * last["valve"].displacement)
    assert figure.axes[-1].get_xlim() == pytest.approx((0.0, 360.0), abs=1e-6)


def test_crank_angle_without_dead_centre_starts_at_cam_zero(draw_figure, engine):
    figure = draw_figure("intake.vtkhdf", "--over", "crank")
    assert figure.axes[-1].get_xlabel() == "crank angle from cam angle 0, deg"
    assert figure.axes[0].lines[0].get_xdata()[[0, 360]] == pytest.approx([0.0, 360.0], abs=1e-6)


@pytest.mark.slow
def test_crank_angle_plot_shows_dead_centres_and_overlap(draw_figure, flexcam):
    """Two trains with one dead centre have separate lifts; both valves are open within the shaded angles."""
    assert flexcam("new", "exhaust-valve", "-o", "exhaust.toml").code == 0
    quick = ("run.steps_per_revolution=720", "run.revolutions=1", "fidelity.model=rigid")
    figure = draw_figure(BUCKET, "exhaust.toml", "--over", "crank", overrides=quick)
    lift, *_ = figure.axes
    assert figure.axes[-1].get_xlim() == (-360.0, 360.0)
    assert [text.get_text() for text in lift.texts] == ["firing TDC", "BDC", "TDC", "BDC", "firing TDC"]
    intake, exhaust = (line.get_xydata() for line in lift.lines[:2])
    assert intake[np.argmax(intake[:, 1]), 0] == pytest.approx(108.0, abs=1.0), "the centreline of its cam card"
    assert exhaust[np.argmax(exhaust[:, 1]), 0] < 0.0
    assert legend_texts(figure.legends[-1]) == ["valve overlap, both open by 0.1 mm"]
    ((begin, end),) = shaded_intervals(lift.collections[0])
    for place in (begin, end):
        assert min(np.interp(place, *curve.T) for curve in (intake, exhaust)) == pytest.approx(0.1, abs=0.02)
    assert [axes.get_ylabel() for axes in figure.axes[-2:]] == ["intake force\nN", "exhaust force\nN"]


@pytest.mark.slow
def test_valve_overlap_with_phaser(draw_figure, flexcam):
    """The intake opens 40 deg of the crankshaft earlier than without the phaser; no contact loss is marked."""
    assert flexcam("new", "cam-phaser", "-o", "phaser.toml").code == 0
    figure = draw_figure(
        "phaser.toml", "--over", "crank", overrides=("run.steps_per_revolution=720", "fidelity.model=rigid")
    )
    lift, *_ = figure.axes
    assert legend_texts(figure.legends[-1]) == ["valve overlap, both open by 0.1 mm"]
    ((begin, end),) = shaded_intervals(lift.collections[0])
    curve = lift.lines[0].get_xydata()
    assert curve[np.argmax(curve[:, 1]), 0] == pytest.approx(80.0, abs=1.0)
    assert np.interp(begin, *curve.T) == pytest.approx(0.1, abs=0.02)
    assert end == pytest.approx(24.0, abs=2.0), "as the exhaust valve, which no phaser turns, closes"
    card = " ".join(flexcam("cam", "phaser.toml").out.split())
    assert card.count("phaser turns the cam by 0 to 20 deg; the angles in this table are without it") == 1


@pytest.mark.slow
def test_torque_plot_shows_mean(draw_figure, engine, tmp_path):
    figure = draw_figure("intake.vtkhdf", "--what", "torque")
    ready = prepare(read_case(ENGINE, [*FEW, "run.engine=kernel"]))
    means = {
        metric.name: metric.value for metric in compute_metrics(ready, engine) if metric.name.endswith("torque.mean")
    }
    assert len(figure.axes) == len(means) == 2
    for axes, (name, mean) in zip(figure.axes, means.items(), strict=True):
        curve, level = axes.lines
        np.testing.assert_allclose(curve.get_ydata(), engine.channels[name.removesuffix(".mean")])
        assert list(level.get_ydata()) == [mean, mean]
        assert legend_texts(axes.get_legend()) == [f"mean {mean:.4g} N m"]


@pytest.mark.slow
def test_spring_plot_marks_installation_lift_and_coil_bind(draw_figure, engine):
    """50 kN/m and 400 N: full lift at the rigid valve lift, coil bind at the given travel, stress by Wahl."""
    figure = draw_figure("intake.vtkhdf", "--what", "spring", "--channel", "springs.valve.force")
    force, stress = figure.axes
    lift = 1e3 * run(read_case(ENGINE, FEW), rigid=True)["valve"].displacement.max()
    curve, *markers = force.lines
    assert [(float(marker.get_xdata()[0]), float(marker.get_ydata()[0])) for marker in markers[:3]] == [
        (0.0, 400.0), (pytest.approx(lift), pytest.approx(400.0 + 50.0 * lift)), (13.0, pytest.approx(1050.0))
    ]  # fmt: skip
    x, y = curve.get_data()
    np.testing.assert_allclose(y, 400.0 + 50.0 * x, atol=1e-9)
    assert x[0] == pytest.approx(-8.0), "the free length"
    wire = prepare(read_case(ENGINE)).model.springs["valve"].wire
    per_force = wire.wahl * 8.0 * wire.coil_diameter / (math.pi * wire.diameter**3)
    np.testing.assert_allclose(stress.lines[0].get_ydata(), 1e-6 * per_force * y, atol=1e-9)


@pytest.mark.slow
def test_goodman_diagram_values(draw_figure):
    strong = [*FEW, KERNEL, "materials.steel.ultimate_strength=900 MPa", "materials.steel.endurance_limit=350 MPa"]
    figure = draw_figure(ENGINE, "--what", "goodman", overrides=strong)
    (axes,) = figure.axes
    case = read_case(ENGINE, strong)
    found = member_strength(prepare(case), run(case)).members()
    line, *points = axes.lines
    assert line.get_xydata()[1:].tolist() == [[0.0, 350.0], [900.0, 0.0]]
    for point, (name, member) in zip(points, found.items(), strict=False):
        assert point.get_label() == f"{name} at {member.place}: safety {member.safety:.3g}"
        assert (point.get_xdata()[0], point.get_ydata()[0]) == (1e-6 * member.mean, 1e-6 * member.alternating)
    pushrod = found["pushrod"]
    assert pushrod.mean < 0.0
    assert 1.0 / pushrod.safety == pytest.approx(pushrod.alternating / 350e6, rel=1e-9), "compression helps nothing"


@pytest.mark.slow
def test_map_over_angle_and_speed_values(draw_figure, flexcam, tmp_path):
    for rpm in SPEEDS:
        words = (
            "--set",
            f"run.crank_speed={rpm}rpm",
            "--set",
            FEW[0],
            "--set",
            FEW[1],
            "--set",
            "fidelity.model=rigid",
        )
        assert flexcam("run", ENGINE, "-o", rpm, *words).code == 0
    files = [f"{rpm}/intake.vtkhdf" for rpm in reversed(SPEEDS)]
    figure = draw_figure(*files, "--what", "map", "--channel", "contacts.intake.force")
    (mesh,) = (collection for collection in figure.axes[0].collections if isinstance(collection, QuadMesh))
    values = np.asarray(mesh.get_array()).reshape(2, -1)
    for row, rpm in zip(values, SPEEDS, strict=True):
        response = read_result(tmp_path / rpm / "intake.vtkhdf").response
        np.testing.assert_allclose(row[2::2], response.channels["contacts.intake.force"][1:], atol=1e-9)
    assert figure.axes[1].get_ylabel() == "intake force\nN"
    case = draw_figure(ENGINE, "--what", "map", "--count", "3", overrides=[*FEW, "fidelity.model=rigid"])
    assert case.axes[0].get_ylabel() == "crank speed, rpm"


@pytest.fixture
def table(tmp_path):
    """Write a sweep of speeds and stiffnesses with one failed variant and return its table."""
    speed, stiffness = (grid.ravel() for grid in np.meshgrid([1000.0, 2000.0, 3000.0], [40.0, 50.0], indexing="ij"))
    force = speed / stiffness
    force[3] = np.nan
    statuses = [Status()] * 6
    statuses[3] = Status(Cause.NOT_FINITE, "it left", "a smaller step")
    inputs = Column("run.speed", "rpm", speed), Column("springs.valve.stiffness", "kN/m", stiffness)
    sweep = SweepTable(inputs, {PRESSURE: 1e6 * force}, {PRESSURE: "Pa"}, tuple(statuses), (3, 2))
    for suffix in (".h5", ".csv"):
        write_table(sweep, tmp_path / f"case.sweep{suffix}")
    return sweep


@pytest.mark.parametrize("file", [pytest.param("case.sweep.h5", marks=pytest.mark.slow), "case.sweep.csv"])
def test_sweep_plot_as_lines_and_map(file, draw_figure, table):
    figure = draw_figure(file, "--x", "run.speed", "--y", "contacts.intake.pressure.largest")
    (axes,) = figure.axes
    soft, stiff, failed = axes.lines
    assert (soft.get_label(), stiff.get_label()) == (
        "springs.valve.stiffness 40 kN/m", "springs.valve.stiffness 50 kN/m"
    )  # fmt: skip
    np.testing.assert_allclose(soft.get_xydata(), [[1000.0, 25.0], [2000.0, 50.0], [3000.0, 75.0]])
    np.testing.assert_allclose(stiff.get_xydata(), [[1000.0, 20.0], [2000.0, np.nan], [3000.0, 60.0]])
    assert (list(failed.get_xdata()), failed.get_label()) == ([2000.0], "failed variant")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("run.speed, rpm", "contacts.intake.pressure.largest\nMPa")
    contours = draw_figure(
        file, "--y", "contacts.intake.pressure.largest", "--map", "--x", "springs.valve.stiffness"
    ).axes[0]
    assert (contours.get_xlabel(), contours.get_ylabel()) == ("springs.valve.stiffness, kN/m", "run.speed, rpm")
    assert contours.lines[-1].get_xydata().tolist() == [[50.0, 2000.0]], "the failed variant"


def test_csv_table_equals_hdf5_table(table, tmp_path):
    hdf5_table, csv_table = (read_table(tmp_path / f"case.sweep{suffix}") for suffix in (".h5", ".csv"))
    assert (hdf5_table.shape, hdf5_table.failed) == (csv_table.shape, csv_table.failed)
    for name in ("run.speed", "springs.valve.stiffness", "contacts.intake.pressure.largest"):
        assert (hdf5_table.column(name).unit, csv_table.column(name).unit) == (table.column(name).unit,) * 2
        np.testing.assert_allclose(csv_table.column(name).values, hdf5_table.column(name).values)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["case.sweep.h5"], "--y: missing, expected contacts.intake.pressure.largest"),
        (
            ["case.sweep.csv", "--y", "contacts.intake.presure.largest"],
            "Did you mean 'contacts.intake.pressure.largest'",
        ),
        (["case.sweep.h5", "--y", "run.speed", "--x", "run.sped"], "Did you mean 'run.speed'"),
        (["case.sweep.h5", "--y", "no"], "--y: got 'no'"),
        (["case.sweep.h5", "--y", "run.speed", "--x", "no"], "--x: got 'no'"),
        (["case.sweep.h5", "--y", "run.speed", "--map", "--x", "contacts.intake.pressure.largest"], "over both keys"),
        (["case.sweep.h5", "--what", "motion"], "the table of a sweep"),
        (["case.sweep.h5", "--y", "run.speed", "--probe", "valve"], "--what sweep has no --probe"),
        (["other.csv", "--y", "run.speed"], "it has other columns"),
        (["case.toml", "--x", "run.speed"], "--what motion has no --x"),
        ([ENGINE, "--what", "spring", "--channel", "springs.valv.force"], "Did you mean 'springs.valve.force'"),
        (["case.toml", "--what", "sweep", "--y", "a"], "one table of a sweep"),
    ],
)
def test_data_plots_refuse_invalid_arguments(words, message, flexcam, table, case, tmp_path):
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    done = flexcam("plot", *words)
    assert done.code == 2
    assert message.lower() in done.err.lower()


def test_waterfall_lines_start_at_their_speeds():
    sizes = np.array([[0.0, 1.0, 2.0], [0.0, 4.0, 1.0]])
    found = Waterfall(
        Signal("contacts.intake.force"), "N", np.array([1000.0, 2000.0]), sizes, np.zeros(2), (Status(),) * 2
    )
    _, lines, *_ = waterfall_figure([found], 2.0, "crank").axes
    heights = [line.get_ydata() for line in lines.lines]
    np.testing.assert_allclose(heights[0] - 2000.0, 150.0 * sizes[0, 1:])
    np.testing.assert_allclose(heights[1] - 4000.0, 150.0 * sizes[1, 1:])


def test_campbell_diagram_marks_ends_of_lines():
    """Mode 1 appears at the second speed, mode 2 ends there, and mode 3 exists at every speed."""
    nan = math.nan
    frequencies = np.array([[nan, 30.0, 40.0], [20.0, 30.0, 40.0], [20.0, nan, 40.0]])
    found = Campbell("intake", np.array([1000.0, 2000.0, 3000.0]), frequencies, (True,) * 3, ("a", "b", "c"), {1: 1e-3},
                     np.full((3, 1), nan), (), (Status(),) * 3)  # fmt: skip
    (axes,) = campbell_figure(found, 1.0, "camshaft").axes
    (end_markers,) = (line for line in axes.lines if line.get_label() == "line ends: a contact opens or closes")
    assert sorted(map(tuple, end_markers.get_xydata().tolist())) == [(2000.0, 20.0), (2000.0, 30.0)]


def test_mode_shapes_are_plotted_along_moving_members(draw_figure, engine):
    """The second mode is that of the valve on its spring, in which no member moves."""
    figure = draw_figure("intake.vtkhdf", "--what", "modes", "--count", "3")
    assert [axes.get_xlabel() for axes in figure.axes] == ["along pushrod, mm"] * 2
    assert [part.get_suptitle().startswith(f"mode {i}, ") for i, part in enumerate(figure.subfigs, start=1)] == [
        True
    ] * 3
    assert "no member moves" in figure.subfigs[1].get_suptitle().replace("\n", " ")
