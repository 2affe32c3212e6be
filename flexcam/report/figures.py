"""Charts and scenes of a report: every probe, channel and energy of its results, reduced to the visible points."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.core.units import to_display_unit
from flexcam.dynamics import SERIES, STATE, Response, component_unit
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.recovery import deflection
from flexcam.io.exports import energies, scalar_probes
from flexcam.report.content import Chart, ChartGroup, Curve, Panel, ReportSubject, Scene, Shape
from flexcam.valvetrain import Structure

_CURVE_TOLERANCE = 1e-4  # allowed deviation of a drawn curve relative to its range: less than a pixel of a large screen
# Ratio of the points of an album's first chart, which is visible initially, to those of the others
_FIRST_CHART_RATIO = 4
_LONG_HISTORY = 40_000  # number of points of a history above which it is reduced by intervals first
# Total points of all curves of a page, about 600 kB, and the part of it used by the texts of every result
_MAX_TOTAL_POINTS, _RESULT_POINTS = 55_000, 2_500
_MAX_POINTS, _MIN_POINTS = 3000, 100  # maximum and minimum number of points of a curve
_REDUCTION = 1.5  # ratio of the points allowed to those that reduced curves have, at most: fewer reductions are useless
_MAX_CURVES = 300  # maximum number of curves of a page; probes listed in the case come first
_PARTS = 6  # drawn segments per element, if the page has space for them
_POINTS = 240  # total points of all scenes of a page: with modes and frames about 250 kB
_FRAMES = 48  # frames of the motion of a run
_SAME_PLACE = 1e-9  # distance below which points coincide, m

Runs = Mapping[str, tuple[Response, Response | None]]  # response by name, and the response with rigid members


def reduce_points(x: FloatArray, y: FloatArray, most: int = _MAX_POINTS) -> tuple[FloatArray, FloatArray]:
    """Return a curve reduced to few of its points, including its extremes, for linear interpolation.

    The points with the largest distance from the polyline are added until all are within the tolerance: D. H. Douglas
    and T. K. Peucker, Cartographica 10, 1973, for all segments at once. Of very many points, only the minimum and
    maximum of every short interval are considered.
    """
    if len(x) <= 2:
        return x, y
    if len(x) > _LONG_HISTORY:
        ends = pairwise(np.linspace(0, len(y), _LONG_HISTORY // 4 + 1).astype(int).tolist())
        peaks = [a + int(find(y[a:b])) for a, b in ends for find in (np.argmin, np.argmax)]
        kept = np.unique([0, *peaks, len(y) - 1])
        x, y = x[kept], y[kept]
    off = _CURVE_TOLERANCE * float(np.ptp(y))
    tolerances = _point_tolerances(x, y, off)
    while (kept := tolerances > off).sum() > most:
        off *= 2.0
    return x[kept], y[kept]


def _point_tolerances(x: FloatArray, y: FloatArray, within: float) -> FloatArray:
    """Return the tolerance below which each point is kept; zero for points that are not kept at a tolerance."""
    found = np.zeros(len(x))
    found[[0, -1, int(np.argmin(y)), int(np.argmax(y))]] = np.inf
    while True:
        at = np.flatnonzero(found)
        off = np.abs(y - np.interp(x, x[at], y[at]))
        off[at] = 0.0
        stretch = np.append(np.repeat(np.arange(len(at) - 1), np.diff(at)), len(at) - 2)
        farthest = np.maximum.reduceat(off, at[:-1])[stretch]
        more = (off == farthest) & (off > within)
        if not more.any():
            return found
        # A point of a segment is found only if both ends of the segment are kept.
        ends = np.minimum(found[at[:-1]], found[at[1:]])[stretch]
        found[more] = np.minimum(off, ends)[more]


def build_albums(runs: Runs, main: str) -> tuple[list[ChartGroup], list[str]]:
    """Return all curves of several results, and a sentence if a page has no room for some of them."""
    first = [one for one, _ in runs.values()]
    probes = list(dict.fromkeys(name for one in first for name in scalar_probes(one.outline)))
    moving = {
        name for one in first if len(one.time) for name in scalar_probes(one.outline) if np.ptp(one[name].displacement)
    }
    probes = sorted((name for name in probes if name == main or name in moving), key=lambda name: name != main)
    channels = list(dict.fromkeys(name for one in first for name, _ in one.outline.channels))
    shown = [name for name in channels if not name.startswith(("energy.", STATE))]
    shown.sort(key=lambda name: not (name.startswith("contacts.") and name.endswith(".force")))
    room = max(_MAX_CURVES // len(runs), 1)
    most_probes, most_channels = max(room // 6, 1), max(room // 4, 1)
    words = "There are more curves than a page holds: the first probes and channels are shown, the result has all"
    notes = [words] if len(moving) > most_probes or len(channels) > most_channels else []
    albums = [
        ChartGroup("Motion", "probe", tuple(_motion(runs, name) for name in probes[:most_probes])),
        ChartGroup("Forces and more", "channel", tuple(_channel(runs, name) for name in shown[:most_channels])),
        ChartGroup("Energy", "result", tuple(_energy(name, one) for name, (one, _) in runs.items())),
    ]
    held = [replace(one, charts=tuple(c for c in one.charts if any(p.curves for p in c.panels))) for one in albums]
    size = max(_MAX_TOTAL_POINTS - _RESULT_POINTS * len(runs), _MIN_POINTS)
    return _fit_albums([album for album in held if album.charts], size), notes


def _fit_albums(albums: list[ChartGroup], size: int) -> list[ChartGroup]:
    """Return albums reduced to the size of a page: the curves with the most points are reduced further."""

    def fit(curve: Curve, most: int) -> Curve:
        if len(curve.x) <= most:
            return curve
        x, y = reduce_points(curve.x, curve.y, most)
        return replace(curve, x=x, y=y)

    def fit_chart(chart: Chart, most: int) -> Chart:
        panels = (replace(panel, curves=tuple(fit(curve, most) for curve in panel.curves)) for panel in chart.panels)
        return replace(chart, panels=tuple(panels))

    def points(first: float = math.inf, other: float = math.inf) -> float:
        return sum(
            min(len(curve.x), other if i else first)
            for album in albums for i, chart in enumerate(album.charts)
            for panel in chart.panels for curve in panel.curves
        )  # fmt: skip

    most = _MAX_POINTS
    while most > _MIN_POINTS and points() > size:
        most = 3 * most // 4
        if most > _MIN_POINTS and points(_FIRST_CHART_RATIO * most, most) > _REDUCTION * size:
            continue
        albums = [
            replace(album, charts=(fit_chart(first, _FIRST_CHART_RATIO * most), *(fit_chart(c, most) for c in others)))
            for album in albums
            for first, *others in [album.charts]
        ]
    return albums


def _motion(runs: Runs, name: str) -> Chart:
    def values(response: Response, series: str) -> FloatArray | None:
        return getattr(response[name], series) if name in scalar_probes(response.outline) else None

    component = name.rpartition(".")[2]
    units = {series: component_unit(component, unit) for series, unit in SERIES.items()}
    panels = tuple(_panel(runs, series, unit, partial(values, series=series)) for series, unit in units.items())
    return Chart(name, _text_alternative(panels), panels)


def _channel(runs: Runs, name: str) -> Chart:
    unit = next(unit for one, _ in runs.values() for channel, unit in one.outline.channels if channel == name)
    label = " ".join(name.split(".")[1:]).replace("_", " ")
    panel = _panel(runs, label, unit, lambda one: one.channels.get(name))
    return Chart(name.replace(".", " ").replace("_", " "), _text_alternative([panel]), (panel,))


def _energy(name: str, response: Response) -> Chart:
    angle, parts = np.degrees(response.angle), enumerate(energies(response).items())
    curves = [Curve(part, i, False, *reduce_points(angle, v)) for i, (part, v) in parts if v.any()]
    panel = Panel("energy, J", tuple(curves))
    return Chart(name or "this result", _text_alternative([panel]), (panel,) if curves else ())


def _panel(runs: Runs, label: str, unit: str, values: Callable[[Response], FloatArray | None]) -> Panel:
    factor, symbol = to_display_unit(unit)
    curves: list[Curve] = []
    for group, (name, pair) in enumerate(runs.items()):
        for one, rigid in zip(pair, (False, True), strict=True):
            history = None if one is None else values(one)
            if one is not None and history is not None and len(history):
                called = ", ".join(filter(None, (name, "rigid" if rigid else "" if name else "flexible")))
                curves.append(Curve(called, group, rigid, *reduce_points(np.degrees(one.angle), factor * history)))
    return Panel(f"{label}, {symbol}" if symbol else label, tuple(curves))


def _text_alternative(panels: Sequence[Panel]) -> tuple[str, ...]:
    """Return a text alternative of panels: the range of every curve and its cam angles."""
    words: list[str] = []
    for panel in panels:
        quantity, _, unit = panel.label.partition(", ")
        for curve in panel.curves:
            extremes = int(np.argmin(curve.y)), int(np.argmax(curve.y))
            ends = [f"{curve.y[i]:.4g} {unit} at {curve.x[i]:.4g} deg" for i in extremes]
            name = f" ({curve.name})" if curve.name else ""
            words.append(f"{quantity}{name}: from {ends[0]} to {ends[1]}")
    return tuple(words)


@dataclass(frozen=True, eq=False)
class _LinePoints:
    """Points on members: index of the element and position in it, shape (p,) each."""

    element: IntArray
    part: IntArray
    parts: int
    ranges: dict[str, tuple[int, int]]

    def of_nodes(self, ends: IntArray, nodal: FloatArray) -> FloatArray:
        """Interpolate nodal values linearly: shape (..., nodes, 3) to (..., p, 3)."""
        x = (self.part / self.parts)[:, None]
        first, second = ends[self.element].T
        return (1.0 - x) * nodal[..., first, :] + x * nodal[..., second, :]

    def of_beams(self, beams: Beams, nodal: FloatArray) -> FloatArray:
        """Return the deflection, from shape (..., nodes, 6) to (..., p, 3), global axes."""
        local = deflection(beams, nodal, self.parts)[..., self.element, self.part, :3]
        return np.einsum("pji,...pj->...pi", beams.triads[self.element], local)


def scene(about: ReportSubject, share: int = 1) -> Scene | None:
    """Return the members of a result and their motion."""
    mesh = about.result.mesh
    ends = mesh.elements()
    if not len(ends):
        return None
    lines = _lines(mesh, _POINTS // share)
    points = lines.of_nodes(ends, mesh.nodes)
    shapes = (*_modes(about, lines), *_run_motion(about, lines))
    return Scene(points, lines.ranges, _names(mesh, points), shapes) if shapes else None


def _lines(mesh: Mesh, room: int) -> _LinePoints:
    """Return points along the members within a limit, including the ends and at least one point between them."""
    elements = len(mesh.elements())
    parts = min(max(room // elements, 1), _PARTS)
    every = -(-elements * parts // room)
    found, ranges, count = list[IntArray](), dict[str, tuple[int, int]](), 0
    for name, part in mesh.element_ranges().items():
        last = (part.stop - part.start) * parts
        along = np.unique([*range(0, last, every), last // 2, last])
        own = np.minimum(along // parts, part.stop - part.start - 1)
        found.append(np.array([part.start + own, along - parts * own]))
        ranges[name] = (count, count := count + len(along))
    element, place = np.concatenate(found, axis=1)
    return _LinePoints(element, place, parts, ranges)


def _names(mesh: Mesh, points: FloatArray) -> dict[str, int]:
    """Return the named points on the lines; names of coincident points are joined."""
    found: dict[int, list[str]] = {}
    for name, nodes in mesh.points.items():
        if len(nodes) == 1:
            away = np.linalg.norm(points - mesh.nodes[nodes[0]], axis=1)
            if away.min() < _SAME_PLACE:
                found.setdefault(int(np.argmin(away)), []).append(name)
    return {", ".join(names): at for at, names in found.items()}


def _modes(about: ReportSubject, lines: _LinePoints) -> list[Shape]:
    if about.known is None or about.modes is None:
        return []
    found, structure = about.modes, about.known.structure
    moved = lines.of_beams(structure.beams, structure.dofs.nodal_modes(found.modes.shapes.T, about.result.mesh.extent))
    undrawn, shapes = _undrawn_parts(structure), list[Shape]()
    for i, (frequency, shares) in enumerate(zip(found.modes.frequencies.tolist(), found.shares, strict=True)):
        most = max(shares, key=lambda part: shares[part], default="")
        note = f". The part with the largest motion, {most}, is no member and not drawn" if most in undrawn else ""
        shapes.append(Shape(f"mode {i + 1}, {frequency:.4g} Hz", found.words(i) + note, moved[i : i + 1]))
    return shapes


def _undrawn_parts(structure: Structure) -> set[str]:
    """Return the parts of modes without lines: rockers, springs, and masses outside of members."""
    model = structure.model
    masses = (
        name for name, part in model.masses.items()
        if part.at in model.rocker_points or model.mesh.node(part.at) not in model.mesh.elements()
    )  # fmt: skip
    kinds = {"rocker": model.rockers, "spring": model.springs, "mass": masses}
    return {f"{kind} {name}" for kind, names in kinds.items() for name in names}


def _run_motion(about: ReportSubject, lines: _LinePoints) -> list[Shape]:
    """Return the motion of the last revolution of a run, or of a shorter run."""
    response = about.result.response
    if len(response.field_time) < 2:
        return []
    last = response.field_angle > response.field_angle[-1] - 2.0 * np.pi * (1.0 + 1e-9)
    at = np.flatnonzero(last)[:: -(-int(last.sum()) // _FRAMES)]
    nodal = response.fields.displacement[at].reshape(len(at), -1, 6)
    if about.known is None:
        moved = lines.of_nodes(about.result.mesh.elements(), nodal[..., :3])
    else:
        moved = lines.of_beams(about.known.structure.beams, nodal)
    degrees = np.degrees(response.field_angle[at[[0, -1]]])
    words = f"The computed motion from {degrees[0]:.4g} to {degrees[1]:.4g} deg of cam angle"
    return [Shape("the run", words, moved)]
