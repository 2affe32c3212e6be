"""Solid mechanisms on screen, in images, movies and HTML pages. Only this module imports pyvista.

Call `flexcam.plotting.rendering.select_renderer` first: VTK aborts its process if a library is missing.
"""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyvista does not type most of its interface.

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista

from flexcam.core import FloatArray
from flexcam.plotting.scene.mechanism import Mechanism
from flexcam.plotting.scene.motion import Motion
from flexcam.plotting.scene.solids import COLOURS, NEUTRAL_COLOUR, OPACITIES, Solid

_SHARP_ANGLE = 35.0  # angle between triangles, deg, above which an edge is drawn sharp
_BELOW_WORDS, _BESIDE_BAR = 1.08, 0.8  # fractions of height and width left by the title and the colour bar
_BAR = {
    "color": "black", "n_labels": 5, "fmt": "%.3g", "vertical": True,
    "position_x": 0.84, "position_y": 0.2, "height": 0.55,
}  # fmt: skip

_FRAME_TIME = 40  # time between two instants of a mode in the window, ms


class MechanismView:
    """Mechanism in a window or off-screen, with the elastic part of its motion times a scale.

    The size is in pixels; the title is above the image.
    """

    def __init__(
        self, mechanism: Mechanism, motion: Motion, *,
        off_screen: bool, scale: float = 1.0, size: tuple[int, int] = (1024, 768), title: str = "",
    ) -> None:  # fmt: skip
        self._mechanism, self._motion, self._scale, self._size, self.title = mechanism, motion, scale, size, title
        self.plotter: Any = pyvista.Plotter(off_screen=off_screen, window_size=list(size))
        self.plotter.set_background("white")
        self._actors: dict[str, Any] = {}
        for kind, mesh in self._meshes(0).items():
            self._actors[kind] = self.plotter.add_mesh(mesh, **self._style(kind, mesh))
        self.plotter.enable_anti_aliasing("ssaa")
        self._set_camera()
        self.show(0)

    def _style(self, kind: str, mesh: pyvista.PolyData) -> dict[str, Any]:
        common = {"smooth_shading": True, "specular": 0.35, "specular_power": 20.0, "opacity": OPACITIES.get(kind, 1.0)}
        if "value" in mesh.point_data:
            values = self._motion.values
            top = _range(values) if values is not None else (0.0, 1.0)
            small = max(min(self._size[0] / 1024.0, 1.0), 0.75)
            fonts = {"title_font_size": round(16 * small), "label_font_size": round(14 * small)}
            bar = {**_BAR, **fonts, "title": f"{self._motion.label}\n"}
            even = {"ambient": 0.35, "diffuse": 0.7, "specular": 0.1}  # colours are data here
            return {**common, **even, "scalars": "value", "clim": top, "cmap": "viridis", "scalar_bar_args": bar}
        return {**common, "color": NEUTRAL_COLOUR if self._motion.values is not None else COLOURS[kind]}

    def _solids(self, i: int) -> list[Solid]:
        return self._mechanism.solids(self._motion.instant(i, self._scale))

    def _meshes(self, i: int) -> dict[str, pyvista.PolyData]:
        """Return a mesh per kind of part; coloured members are separate from parts without values."""
        kinds: dict[str, list[Any]] = {}
        for solid in self._solids(i):
            mesh = pyvista.PolyData.from_regular_faces(solid.points, solid.faces)
            if solid.values is not None:
                mesh.point_data["value"] = solid.values
            kinds.setdefault(solid.kind, []).append(mesh)
        joined = {kind: parts[0].append_polydata(*parts[1:]) for kind, parts in kinds.items()}
        sharp = {"split_vertices": True, "feature_angle": _SHARP_ANGLE, "consistent_normals": False}
        return {kind: mesh.compute_normals(**sharp) for kind, mesh in joined.items()}

    def show(self, i: int) -> None:
        """Show instant i."""
        for kind, mesh in self._meshes(i).items():
            self._actors[kind].mapper.SetInputData(mesh)
        text = self._motion.words(i, self.title, self._scale)
        self.plotter.add_text(text, position="upper_left", font_size=11, color="black", name="words")

    def show_alone(self, i: int) -> None:
        """Show instant i as an image, with the colours in its range."""
        self.show(i)
        if self._motion.values is not None:
            for actor in self._actors.values():
                actor.mapper.scalar_range = _range(self._motion.values[i])

    def open_window(self, still: int, *, swings: bool) -> None:
        """Open the window, with a slider over the cam angle or with an animated mode."""
        degrees = np.degrees(self._motion.angle)

        def show_angle(value: float) -> None:
            self.show(int(np.argmin(np.abs(degrees - value))))

        def show_next(step: int) -> None:
            self.show(step % len(self._motion))
            self.plotter.render()

        self.show(still)
        if swings:
            self.plotter.add_timer_event(max_steps=1_000_000, duration=_FRAME_TIME, callback=show_next)
        else:
            ends = float(degrees[0]), float(degrees[-1])
            self.plotter.add_slider_widget(
                show_angle, ends, value=float(degrees[still]), title="cam angle, deg", pointa=(0.03, 0.12),
                pointb=(0.33, 0.12), color="black", fmt="%.1f", interaction_event="always",
            )  # fmt: skip
        self.plotter.show()

    def _set_camera(self) -> None:
        plane = self._mechanism.view
        instants = {(i * len(self._motion)) // 4 for i in range(4)}  # what they show defines the visible region
        seen = np.concatenate([solid.points for i in sorted(instants) for solid in self._solids(i)]) @ plane.T
        middle, half = 0.5 * (seen.max(axis=0) + seen.min(axis=0)), 0.5 * np.ptp(seen, axis=0)
        wide, beside = self._size[0] / self._size[1], 1.0 if self._motion.values is None else _BESIDE_BAR
        scale = 1.06 * float(max(half[1] * _BELOW_WORDS, half[0] / (beside * wide)))
        focus = (middle + scale * np.array([(1.0 - beside) * wide, _BELOW_WORDS - 1.0, 0.0])) @ plane
        distance = 4.0 * float(np.linalg.norm(half))
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point, camera.position, camera.up = focus, focus + distance * plane[2], plane[1]
        camera.parallel_scale = scale
        self.plotter.renderer.ResetCameraClippingRange()


def _range(values: FloatArray) -> tuple[float, float]:
    """Return minimum and maximum; differences below rounding count as zero."""
    ends = float(values.min(initial=0.0)), float(values.max(initial=0.0))
    largest = max(map(abs, ends)) or 1.0
    return ends[0], ends[1] if ends[1] > ends[0] else largest
