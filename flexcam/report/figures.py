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
from flexcam.dynamics import SERIES, STATE, Response, component_unit, scalar_probes
from flexcam.fem.elements.beam import Beams
from flexcam.fem.mesh import Mesh
from flexcam.fem.recovery import deflection
from flexcam.io.exports import energies
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
        indices = np.unique([0, *peaks, len(y) - 1])
        x, y = x[indices], y[indices]
    tolerance = _CURVE_TOLERANCE * float(np.ptp(y))
    tolerances = _point_tolerances(x, y, tolerance)
    while (mask := tolerances > tolerance).sum() > most:
        tolerance *= 2.0
    return x[mask], y[mask]


def _point_tolerances(x: FloatArray, y: FloatArray, tolerance: float) -> FloatArray:
    """Return the tolerance below which each point is kept; zero for points that are not kept at a tolerance."""
    tolerances = np.zeros(len(x))
    tolerances[[0, -1, int(np.argmin(y)), int(np.argmax(y))]] = np.inf
    while True:
        at = np.flatnonzero(tolerances)
        distance = np.abs(y - np.interp(x, x[at], y[at]))
        distance[at] = 0.0
        stretch = np.append(np.repeat(np.arange(len(at) - 1), np.diff(at)), len(at) - 2)
        farthest = np.maximum.reduceat(distance, at[:-1])[stretch]
        added = (distance == farthest) & (distance > tolerance)
        if not added.any():
            return tolerances
        # A point of a segment is found only if both ends of the segment are kept.
        ends = np.minimum(tolerances[at[:-1]], tolerances[at[1:]])[stretch]
        tolerances[added] = np.minimum(distance, ends)[added]


def build_albums(runs: Runs, main: str) -> tuple[list[ChartGroup], list[str]]:
    """Return all curves of several results, and a sentence if a page has no room for some of them."""
    first = [run for run, _ in runs.values()]
    probes = list(dict.fromkeys(name for run in first for name in scalar_probes(run.outline)))
    moving = {
        name for run in first if len(run.time) for name in scalar_probes(run.outline) if np.ptp(run[name].displacement)
    }
    probes = sorted((name for name in probes if name == main or name in moving), key=lambda name: name != main)
    channels = list(dict.fromkeys(name for run in first for name, _ in run.outline.channels))
    shown = [name for name in channels if not name.startswith(("energy.", STATE))]
    shown.sort(key=lambda name: not (name.startswith("contacts.") and name.endswith(".force")))
    limit = max(_MAX_CURVES // len(runs), 1)
    max_probes, max_channels = max(limit // 6, 1), max(limit // 4, 1)
    words = "There are more curves than a page holds: the first probes and channels are shown, the result has all"
    notes = [words] if len(moving) > max_probes or len(channels) > max_channels else []
    albums = [
        ChartGroup("Motion", "probe", tuple(_motion(runs, name) for name in probes[:max_probes])),
        ChartGroup("Forces and more", "channel", tuple(_channel(runs, name) for name in shown[:max_channels])),
        ChartGroup("Energy", "result", tuple(_energy(name, response) for name, (response, _) in runs.items())),
    ]
    filled = [replace(a, charts=tuple(c for c in a.charts if any(p.curves for p in c.panels))) for a in albums]
    size = max(_MAX_TOTAL_POINTS - _RESULT_POINTS * len(runs), _MIN_POINTS)
    return _fit_albums([album for album in filled if album.charts], size), notes


def _fit_albums(albums: list[ChartGroup], size: int) -> list[ChartGroup]:
    """Return albums reduced to the size of a page: the curves with the most points are reduced further."""

    def fit(curve: Curve, cap: int) -> Curve:
        if len(curve.x) <= cap:
            return curve
        x, y = reduce_points(curve.x, curve.y, cap)
        return replace(curve, x=x, y=y)

    def fit_chart(chart: Chart, cap: int) -> Chart:
        panels = (replace(panel, curves=tuple(fit(curve, cap) for curve in panel.curves)) for panel in chart.panels)
        return replace(chart, panels=tuple(panels))

    def points(first: float = math.inf, other: float = math.inf) -> float:
        return sum(
            min(len(curve.x), other if i else first)
            for album in albums for i, chart in enumerate(album.charts)
            for panel in chart.panels for curve in panel.curves
        )  # fmt: skip

    cap = _MAX_POINTS
    while cap > _MIN_POINTS and points() > size:
        cap = 3 * cap // 4
        if cap > _MIN_POINTS and points(_FIRST_CHART_RATIO * cap, cap) > _REDUCTION * size:
            continue
        albums = [
            replace(album, charts=(fit_chart(first, _FIRST_CHART_RATIO * cap), *(fit_chart(c, cap) for c in others)))
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
    unit = next(unit for response, _ in runs.values() for channel, unit in response.outline.channels if channel == name)
    label = " ".join(name.split(".")[1:]).replace("_", " ")
    panel = _panel(runs, label, unit, lambda response: response.channels.get(name))
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
        for run, rigid in zip(pair, (False, True), strict=True):
            history = None if run is None else values(run)
            if run is not None and history is not None and len(history):
                title = ", ".join(filter(None, (name, "rigid" if rigid else "" if name else "flexible")))
                curves.append(Curve(title, group, rigid, *reduce_points(np.degrees(run.angle), factor * history)))
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


def _lines(mesh: Mesh, limit: int) -> _LinePoints:
    """Return points along the members within a limit, including the ends and at least one point between them."""
    elements = len(mesh.elements())
    parts = min(max(limit // elements, 1), _PARTS)
    stride = -(-elements * parts // limit)
    pieces, ranges, count = list[IntArray](), dict[str, tuple[int, int]](), 0
    for name, part in mesh.element_ranges().items():
        last = (part.stop - part.start) * parts
        along = np.unique([*range(0, last, stride), last // 2, last])
        index = np.minimum(along // parts, part.stop - part.start - 1)
        pieces.append(np.array([part.start + index, along - parts * index]))
        ranges[name] = (count, count := count + len(along))
    element, place = np.concatenate(pieces, axis=1)
    return _LinePoints(element, place, parts, ranges)


def _names(mesh: Mesh, points: FloatArray) -> dict[str, int]:
    """Return the named points on the lines; names of coincident points are joined."""
    names_at: dict[int, list[str]] = {}
    for name, nodes in mesh.points.items():
        if len(nodes) == 1:
            distance = np.linalg.norm(points - mesh.nodes[nodes[0]], axis=1)
            if distance.min() < _SAME_PLACE:
                names_at.setdefault(int(np.argmin(distance)), []).append(name)
    return {", ".join(names): at for at, names in names_at.items()}


def _modes(about: ReportSubject, lines: _LinePoints) -> list[Shape]:
    if about.modes is None:
        return []
    modes, structure = about.modes, about.structure
    motion = lines.of_beams(structure.beams, structure.dofs.nodal_modes(modes.modes.shapes.T, about.result.mesh.extent))
    undrawn, shapes = _undrawn_parts(structure), list[Shape]()
    for i, (frequency, shares) in enumerate(zip(modes.modes.frequencies.tolist(), modes.shares, strict=True)):
        part = max(shares, key=lambda name: shares[name], default="")
        note = f". The part with the largest motion, {part}, is no member and not drawn" if part in undrawn else ""
        shapes.append(Shape(f"mode {i + 1}, {frequency:.4g} Hz", modes.words(i) + note, motion[i : i + 1]))
    return shapes


def _undrawn_parts(structure: Structure) -> set[str]:
    """Return the parts of modes without lines: rockers, springs, and masses outside of members."""
    model = structure.model
    masses = (
        name for name, mass in model.masses.items()
        if mass.at in model.rocker_points or model.mesh.node(mass.at) not in model.mesh.elements()
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
    motion = lines.of_beams(about.structure.beams, nodal)
    degrees = np.degrees(response.field_angle[at[[0, -1]]])
    words = f"The computed motion from {degrees[0]:.4g} to {degrees[1]:.4g} deg of cam angle"
    return [Shape("the run", words, motion)]
