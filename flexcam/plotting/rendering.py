"""Solid mechanisms on screen, in images and in movies, with pyvista.

This module does not import pyvista when it is loaded, and `select_renderer` tests it in another process: VTK aborts its
process if a library is missing.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingImports=false
# pyvista and imageio do not type most of their interface.

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from flexcam.core import FloatArray
from flexcam.core.errors import refuse, require_packages, system_message
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.io import atomic_write_path, check_writable
from flexcam.plotting.scene.mechanism import Mechanism
from flexcam.plotting.scene.motion import Motion
from flexcam.plotting.scene.solids import COLOURS, NEUTRAL_COLOUR, OPACITIES, Solid

_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"  # environment variable of VTK with the class of its window
_PROBE = """
import sys, pyvista
plotter = pyvista.Plotter(off_screen=sys.argv[1] == "off", window_size=(32, 32))
plotter.set_background("white")
plotter.add_mesh(pyvista.Sphere(), color="black", lighting=False)
if sys.argv[1] == "off":
    image = plotter.screenshot(return_img=True)
else:
    plotter.show(interactive=False, auto_close=False)
    if "EGL" in plotter.render_window.GetClassName() or "OSOpenGL" in plotter.render_window.GetClassName():
        sys.exit("no display answers")
    image = plotter.screenshot(return_img=True)
sys.exit(0 if image.min() < 100 < image.max() else "the picture is empty")
"""

_TIMEOUT = 60.0  # of a rendering test, s
_COLOUR, _HEAD = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"^.*\b(?:WARN|ERR)\| ")  # in lines of VTK's log
# Classes of VTK windows that need no display; the first is tried before the default class, the other after it
_OFF_SCREEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
_REMEDY = (
    "install a renderer: on Debian and Ubuntu `apt-get install libgl1 libegl1 libegl-mesa0 libx11-6`, and for a window "
    "without a screen `xvfb`, then `xvfb-run flexcam view ...`; curves (flexcam plot) need none of it"
)


def select_renderer(*, off_screen: bool) -> None:
    """Select a class of window that works, by rendering a sphere in a separate process."""
    display = sys.platform != "linux" or bool(os.environ.get("DISPLAY"))
    if not display and not off_screen:
        why, remedy = "there is no display for a window", "add --save picture.png (or .gif, .mp4, .html)"
        raise refuse("flexcam view", "no DISPLAY", "a display, or --save", why, remedy)
    preset = os.environ.get(_WINDOW)
    headless = _OFF_SCREEN if off_screen and sys.platform == "linux" else ()
    windows = [preset] if preset else [*headless[:1], *([""] if display else []), *headless[1:]]
    why = ""
    for window in windows:
        why = _test_renderer(window, off_screen=off_screen)
        if not why:
            if window:
                os.environ[_WINDOW] = window
            return
    raise RunFailedError(Status(Cause.NO_RENDERING, f"rendering does not work on this system: {why}", _REMEDY))


@cache
def _test_renderer(window: str, *, off_screen: bool) -> str:
    """Return why a class of window cannot render; empty if it can."""
    environment = {**os.environ, **({_WINDOW: window} if window else {})}
    command = [sys.executable, "-c", _PROBE, "off" if off_screen else "on"]
    try:
        process = subprocess.run(  # noqa: S603 - our own words
            command, env=environment, capture_output=True, text=True, timeout=_TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return f"drawing took more than {_TIMEOUT:g} s"
    except OSError as fault:  # no separate interpreter, or it may not be started
        return f"no process can be started: {system_message(fault)}"
    if process.returncode == 0:
        return ""
    lines = [_HEAD.sub("", _COLOUR.sub("", line)).strip() for line in process.stderr.splitlines()]
    return next((line for line in reversed(lines) if line), f"the renderer ended with {process.returncode}")


# Modules of the extra "movie" that a file type needs
REQUIREMENTS = {".png": (), ".gif": ("imageio",), ".mp4": ("imageio", "imageio_ffmpeg"), ".html": ()}

FRAMES = 72  # frames per revolution
_PER_SECOND = 24


def check_output_path(path: Path, size: tuple[int, int], *, overwrite: bool = False) -> None:
    """Raise an error if an output file cannot be written, before rendering."""
    if path.suffix not in REQUIREMENTS:
        raise refuse("--save", str(path), f"a name that ends in one of {', '.join(REQUIREMENTS)}")
    require_packages("--save", str(path), "movie", *REQUIREMENTS[path.suffix])
    if path.suffix == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise refuse("--size", f"{size[0]}x{size[1]}", "even numbers", "colours are stored for 2 x 2 pixels")
    check_writable("picture", path, overwrite=overwrite)


def save_view(stage: MechanismView, path: Path, frames: Sequence[int], still: int) -> None:
    """Write an image of one instant, or a movie of several."""
    with atomic_write_path(path) as draft:
        match path.suffix:
            case ".gif":  # in memory: the writer of files would print system errors and continue
                from imageio.v2 import get_writer

                buffer, duration = io.BytesIO(), 1000.0 / _PER_SECOND  # ms
                stage.plotter.mwriter = get_writer(buffer, format=".gif", mode="I", duration=duration, loop=0)
                _write_frames(stage, frames)
                stage.plotter.mwriter.close()  # before the plotter, which ignores errors of the writer
                draft.write_bytes(buffer.getvalue())
            case ".mp4":
                quiet = {"ffmpeg_log_level": "quiet"}  # the error is reported below
                stage.plotter.open_movie(str(draft), framerate=_PER_SECOND, macro_block_size=2, **quiet)
                _write_frames(stage, frames)
                stage.plotter.close()
                if b"moov" not in draft.read_bytes():  # the writer does not report a full disk
                    raise OSError("its end is missing: no space left, perhaps")
            case _:
                stage.show_alone(still)
                stage.plotter.screenshot(draft)
        stage.plotter.close()


def _write_frames(stage: MechanismView, frames: Sequence[int]) -> None:
    for i in frames:
        stage.show(i)
        stage.plotter.write_frame()


_SHARP_ANGLE = 35.0  # angle between triangles, deg, above which an edge is drawn sharp
_BELOW_WORDS, _BESIDE_BAR = 1.08, 0.8  # fractions of height and width left by the title and the colour bar
_FRAME_TIME = 40  # time between two instants of a mode in the window, ms


class MechanismView:
    """Mechanism in a window or off-screen, with the elastic part of its motion times a scale.

    The size is in pixels; the title is above the image.
    """

    def __init__(
        self, mechanism: Mechanism, motion: Motion, *,
        off_screen: bool, scale: float = 1.0, size: tuple[int, int] = (1024, 768), title: str = "",
    ) -> None:  # fmt: skip
        import pyvista

        self._mechanism, self._motion, self._scale, self._size, self.title = mechanism, motion, scale, size, title
        self.plotter: Any = pyvista.Plotter(off_screen=off_screen, window_size=list(size))
        self.plotter.set_background("white")
        self._actors: dict[str, Any] = {}
        for kind, mesh in self._meshes(0).items():
            self._actors[kind] = self.plotter.add_mesh(mesh, **self._style(kind, by_value="value" in mesh.point_data))
        self.plotter.enable_anti_aliasing("ssaa")
        self._set_camera()
        self.show(0)

    def _style(self, kind: str, *, by_value: bool) -> dict[str, Any]:
        common = {"smooth_shading": True, "specular": 0.35, "specular_power": 20.0, "opacity": OPACITIES.get(kind, 1.0)}
        if by_value:
            values = self._motion.values
            limits = _range(values) if values is not None else (0.0, 1.0)
            small = max(min(self._size[0] / 1024.0, 1.0), 0.75)
            bar = {
                "color": "black", "n_labels": 5, "fmt": "%.3g", "vertical": True, "title": f"{self._motion.label}\n",
                "position_x": 0.84, "position_y": 0.2, "height": 0.55,
                "title_font_size": round(16 * small), "label_font_size": round(14 * small),
            }  # fmt: skip
            lighting = {"ambient": 0.35, "diffuse": 0.7, "specular": 0.1}  # colours are data here
            return {**common, **lighting, "scalars": "value", "clim": limits, "cmap": "viridis", "scalar_bar_args": bar}
        return {**common, "color": NEUTRAL_COLOUR if self._motion.values is not None else COLOURS[kind]}

    def _solids(self, i: int) -> list[Solid]:
        return self._mechanism.solids(self._motion.instant(i, self._scale))

    def _meshes(self, i: int) -> dict[str, Any]:
        """Return a mesh per kind of part; coloured members are separate from parts without values."""
        from pyvista import PolyData

        kinds: dict[str, list[Any]] = {}
        for solid in self._solids(i):
            mesh = PolyData.from_regular_faces(solid.points, solid.faces)
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
        points = np.concatenate([solid.points for i in sorted(instants) for solid in self._solids(i)]) @ plane.T
        middle, half = 0.5 * (points.max(axis=0) + points.min(axis=0)), 0.5 * np.ptp(points, axis=0)
        wide, share = self._size[0] / self._size[1], 1.0 if self._motion.values is None else _BESIDE_BAR
        scale = 1.06 * float(max(half[1] * _BELOW_WORDS, half[0] / (share * wide)))
        focus = (middle + scale * np.array([(1.0 - share) * wide, _BELOW_WORDS - 1.0, 0.0])) @ plane
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
