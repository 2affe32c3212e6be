"""Figures of laws, lifts, spectra and profiles: axes, labels, number of curves, and values."""

import math
import xml.etree.ElementTree as ET  # the files are our own

import matplotlib.colors
import matplotlib.figure
import matplotlib.image
import numpy as np
import pytest

from flexcam.cams import (
    LAWS,
    FlatFollower,
    HarmonicFamily,
    HarmonicLift,
    LiftEvent,
    Ramp,
    RollerFollower,
    SwingFlatFollower,
    SwingRollerFollower,
    cam_profile,
    joints,
    pareto,
    profile_at,
    residual_spectrum,
)
from flexcam.core.errors import InputError
from flexcam.plotting.curves import (
    draw_front,
    law_figure,
    law_front_figure,
    lift_figure,
    pressure_figure,
    profile_figure,
    spectrum_figure,
)
from flexcam.plotting.figures import add_title, save_figure

EVENT = LiftEvent(LAWS["shm"], lift=0.006, rise=1.5, fall=1.4, dwell=0.2, phase=0.7)
SMOOTH = HarmonicLift(0.003, (-0.003,), (0.0,))
FOLLOWERS = {
    "flat": FlatFollower(0.018),
    "roller": RollerFollower(0.018, 0.009, 0.002),
    "swinging roller": SwingRollerFollower(0.02, 0.009, 0.05, 0.055),
    "swinging face": SwingFlatFollower(0.018, 0.05, 0.055, 0.004, -1),
}


def curve_points(line):
    """Return the points of a curve without its gaps, and whether there are gaps."""
    xy = line.get_xydata()
    whole = np.isfinite(xy).all(axis=1)
    return xy[whole, 0], xy[whole, 1], not whole.all()


def line_style(line):
    return line.get_color(), line.get_linestyle()


@pytest.mark.slow
@pytest.mark.parametrize("names", [["4-5-6-7"], list(LAWS)], ids=len)
def test_law_figure(names):
    figure = law_figure({name: LAWS[name] for name in names})
    assert [axes.get_ylabel() for axes in figure.axes] == ["s", "s'", "s''", "s'''"]
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "", "", "z, part of the rise"]
    for order, axes in enumerate(figure.axes):
        assert [line.get_label() for line in axes.lines] == names
        for name, line in zip(names, axes.lines, strict=True):
            z, values, broken = curve_points(line)
            assert (z[0], z[-1], len(z) > 1000) == (0.0, 1.0, True)
            assert np.array_equal(values, LAWS[name](z, order))
            assert broken == bool(LAWS[name].breaks), "no steep line where the curve jumps"
        assert [line_style(line) for line in axes.lines] == [line_style(line) for line in figure.axes[0].lines]
    assert len({line_style(line) for line in figure.axes[0].lines}) == len(names), "told apart by colour and dashes"
    assert [text.get_text() for legend in figure.legends for text in legend.get_texts()] == names[
        : 99 * (len(names) > 1)
    ]
    figure.draw_without_rendering()
    top = max(axes.get_window_extent().y1 for axes in figure.axes)
    assert [legend for legend in figure.legends if legend.get_window_extent().y0 < top] == [], "it covers no curve"


@pytest.mark.slow
def test_law_front_figure():
    """One criterion over the other from end to end; a law has equal colours in the front and the curves."""
    front = pareto(HarmonicFamily((1, 2, 3)), "Ca", "Cj", count=3)
    figure = law_front_figure(front, "Ca", "Cj")
    first, *curves = figure.get_axes()
    assert first.lines[0].get_xydata() == pytest.approx(np.array([[one.criteria.Ca, one.criteria.Cj] for one in front]))
    assert [text.get_text() for text in first.texts] == ["1", "2", "3"]
    for order, axes in enumerate(curves):
        for one, line, dot in zip(front, axes.lines, first.collections, strict=True):
            assert dot.get_edgecolor()[0] == pytest.approx(matplotlib.colors.to_rgba(line.get_color()))
            x, y, _ = curve_points(line)
            assert y == pytest.approx(one.law(x, order), abs=1e-9)


def test_front_with_unconverged_and_coinciding_laws():
    """A design without convergence is a ring; one without bound is omitted; coinciding laws share a label."""
    axes = matplotlib.figure.Figure().add_subplot()
    draw_front(axes, np.array([[1.0, 9.0], [1.00001, 9.0], [2.0, 4.0], [3.0, math.nan]]), [True, True, False, True])
    assert [text.get_text() for text in axes.texts] == ["1, 2", "3 not converged"]
    assert [len(dot.get_facecolor()) for dot in axes.collections] == [1, 1, 0]


def test_lift_figure():
    events = {"shm": EVENT, "harmonic": SMOOTH}
    figure = lift_figure(events)
    words = [("lift", "mm"), ("velocity", "mm/rad"), ("acceleration", "mm/rad²"), ("jerk", "mm/rad³")]
    assert [tuple(axes.get_ylabel().split("\n")) for axes in figure.axes] == words
    assert figure.axes[-1].get_xlabel() == "cam angle, deg"
    assert figure.axes[-1].get_xlim() == (0.0, 360.0)
    for order, axes in enumerate(figure.axes):
        for (name, event), line in zip(events.items(), axes.lines, strict=True):
            angle, values, broken = curve_points(line)
            assert (line.get_label(), angle[0], angle[-1]) == (name, 0.0, 360.0)
            # Degrees and back: an ulp of the angle times the slope, and an event snaps to joints within 1e-9 rad.
            size = 1e3 * np.abs(event(np.linspace(0.0, 2 * math.pi, 721), order)).max()
            np.testing.assert_allclose(values, 1e3 * event(np.radians(angle), order), rtol=0.0, atol=1e-9 * size)
            assert broken == (name == "shm" and order == 2), "its acceleration steps at four places, nothing else"


def test_both_limits_of_jump_are_drawn():
    """The jerk at the end of a short ramp, between the points of an even grid, has its full size."""
    event = LiftEvent(LAWS["3-4-5"], lift=0.006, rise=1.2, fall=1.2, phase=1.0037, ramp=Ramp(0.0002, 0.3))
    (line,) = lift_figure({"": event}).axes[3].lines
    curve_points = np.asarray(line.get_ydata(), dtype=float)
    expected = [1e3 * value for joint in joints(event) for value in event(joint.angle + np.array([-1e-7, 1e-7]), 3)]
    assert np.nanmin(curve_points) == pytest.approx(min(expected), rel=1e-3)
    assert np.nanmax(curve_points) == pytest.approx(max(expected), rel=1e-3)


def test_gaps_are_at_steps_of_acceleration():
    line = lift_figure({"shm": EVENT}).axes[2].lines[0]
    x = line.get_xdata()
    gaps = np.flatnonzero(np.isnan(x))
    between = np.column_stack([x[gaps - 1], x[gaps + 1]])
    steps = np.degrees([0.7, 2.2, 2.4, 3.8])
    assert ((between[:, 0] <= steps) & (steps <= between[:, 1])).all()
    assert np.ptp(between, axis=1).max() <= 0.25 + 1e-9  # a point every quarter of a degree


def test_spectrum_figure():
    names = ["cycloidal", "4-5-6-7"]
    figure = spectrum_figure({name: LAWS[name] for name in names})
    (axes,) = figure.axes
    assert axes.get_xlabel() == "rise time over the period of the oscillator"
    assert axes.get_ylabel() == "residual amplitude over lift"
    for name, line in zip(names, axes.lines, strict=True):
        ratio, values, _ = curve_points(line)
        assert line.get_label() == name
        assert ratio.min() > 0.0
        assert np.array_equal(values, residual_spectrum(LAWS[name], ratio))
        assert axes.get_ylim()[1] > values.max(), "nothing is cut off"


@pytest.mark.parametrize("turn", [1, -1])
def test_coloured_profile(turn):
    """A value at a cam angle colours the point in contact at this angle; instants may be in any order."""
    follower, angle = FOLLOWERS["flat"], 1.9
    seen = profile_at(EVENT, follower, np.array([3.0, 3.1, 1.9, 8.2, 1.95]), turn)
    made = cam_profile(EVENT, follower, count=360, turn=turn)
    axes, scale = profile_figure(made, angle=angle, coloured=(seen, np.arange(5.0), "film, µm")).axes
    (colours,) = axes.collections
    np.testing.assert_allclose(colours.get_array(), [2.5, 3.5, 2.0, 0.5])  # by angle: 1.9, 8.2 - 2 pi, 1.95, 3.0, 3.1
    first = colours.get_segments()[0][0]
    np.testing.assert_allclose(first, 1e3 * np.array([seen.touch.point[2].real, seen.touch.point[2].imag]), atol=1e-9)
    assert scale.get_xlabel() == "film, µm"


@pytest.mark.parametrize("name", FOLLOWERS)
@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("angle", [0.0, 1.9])
def test_profile_figure(name, turn, angle):
    """The cam is rotated by its angle in its own sense, and touches its follower there."""
    made = cam_profile(EVENT, FOLLOWERS[name], count=360, turn=turn)
    (axes,) = profile_figure(made, angle=angle).axes
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("x, mm", "y, mm", 1.0)
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    roller = math.isfinite(made.follower.roller_radius)
    expected = {"cam", "base circle", "contact", *(("pitch curve", "roller") if roller else ("flat face",))}
    expected |= {"arm", "pivot"} if name.startswith("swing") else set()
    assert {label for label in lines if not label.startswith("_")} == expected
    (arrow,) = axes.texts
    (bx, by), (ax, ay) = arrow.xy, arrow.xyann
    assert (ax * by - ay * bx > 0.0) == (turn == 1), "the arrow goes round as the cam does"
    if "arm" in lines:
        np.testing.assert_allclose(lines["pivot"], [[1e3 * made.follower.distance, 0.0]])
        np.testing.assert_array_equal(lines["arm"][:1], lines["pivot"])
    if name == "swinging roller":
        assert np.hypot(*np.diff(lines["arm"], axis=0)[0]) == pytest.approx(1e3 * made.follower.arm, rel=1e-12)
    at = round(math.degrees(angle))
    c, s = math.cos(turn * angle), math.sin(turn * angle)
    turned = 1e3 * made.points @ np.array([[c, s], [-s, c]])
    np.testing.assert_allclose(lines["cam"], np.vstack([turned, turned[:1]]), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*lines["base circle"].T), 1e3 * made.follower.base_radius, rtol=1e-12)
    # The nearest of 360 points is up to half a degree away, times the speed of the rim.
    near = np.hypot(*(lines["contact"] - turned[at]).T)
    assert near.max() <= 1.001 * math.radians(0.5) * np.hypot(*turned.T).max()
    contact = lines["contact"][0]
    if roller:
        centre = lines["roller"][:-1].mean(axis=0)
        radius = 1e3 * made.follower.roller_radius
        np.testing.assert_allclose(np.hypot(*(lines["roller"] - centre).T), radius, rtol=1e-9)
        assert np.hypot(*(contact - centre)) == pytest.approx(radius, rel=1e-9)
    else:
        (ax, ay), (bx, by) = lines["flat face"]
        assert abs((bx - ax) * (contact[1] - ay) - (by - ay) * (contact[0] - ax)) < 1e-9
    assert f"cam angle {at} deg" in axes.get_title()
    assert f"lift {1e3 * EVENT(np.radians([at]))[0]:.4g} mm" in axes.get_title()


def test_pressure_figure():
    made = cam_profile(EVENT, RollerFollower(0.018, 0.009), count=360)
    upper, lower = pressure_figure(made).axes
    assert upper.get_ylabel().replace("\n", " ") == "pressure angle deg"
    assert lower.get_ylabel().replace("\n", " ") == "radius of curvature, mm"
    assert lower.get_xlabel() == "cam angle, deg"
    angle, pressure, _ = curve_points(upper.lines[0])
    np.testing.assert_allclose(angle, np.arange(360.0), atol=1e-12)
    assert np.array_equal(pressure, np.degrees(made.pressure_angle))
    x, radius, _ = curve_points(lower.lines[0])
    assert np.array_equal(radius, 1e3 * made.radius[np.round(x).astype(int)])
    assert len(x) > 300
    assert np.abs(radius).max() < 10e3 * (0.018 + 0.009 + 0.006), "a nearly straight flank is left out"


@pytest.fixture(scope="module")
def picture():
    return law_figure({"shm": LAWS["shm"]})


@pytest.mark.slow
def test_figures_are_written_in_all_formats(picture, tmp_path):
    assert save_figure(picture, tmp_path / "a.svg") == tmp_path / "a.svg"
    tree = ET.parse(tmp_path / "a.svg")  # noqa: S314
    assert sum(len(path.get("d", "")) for path in tree.iter("{http://www.w3.org/2000/svg}path")) > 9000
    pixels = matplotlib.image.imread(save_figure(picture, tmp_path / "a.png"))
    assert min(pixels.shape[:2]) > 500
    assert np.ptp(pixels) > 0.5
    assert save_figure(picture, tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("name", ["a", "a.jpg", "a.SVGZ", "a.svg.txt", ".svg"])
def test_unknown_file_ending_raises_error(name, picture, tmp_path):
    with pytest.raises(InputError, match=r"\.svg, \.png, \.pdf"):
        save_figure(picture, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_existing_figure_is_not_overwritten(picture, tmp_path):
    for name in ("a.pdf", "a.png", "a.svg"):
        (tmp_path / name).write_text("mine")
        with pytest.raises(InputError, match="overwrite"):
            save_figure(picture, tmp_path / name)
        assert (tmp_path / name).read_text() == "mine"
    save_figure(picture, tmp_path / name, overwrite=True)
    assert (tmp_path / name).stat().st_size > 1000


def test_dollar_signs_in_title_are_not_tex(tmp_path):
    """Matplotlib parses text between two dollar signs as TeX, which fails for most texts."""
    figure = add_title(law_figure({"shm": LAWS["shm"]}), r"a $\frac{$ b$")
    assert save_figure(figure, tmp_path / "a.svg").exists()
