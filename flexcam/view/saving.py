"""Pictures, movies and pages of a stage, by the ending of their name."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyvista and imageio leave most of their types open.

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from flexcam.checks import refuse
from flexcam.io import free_to_write, made_folder, whole
from flexcam.view.page import write_page

if TYPE_CHECKING:
    from flexcam.view.solid import Stage

NEEDS = {
    ".png": ("", ()),
    ".gif": ("movie", ("imageio",)),
    ".mp4": ("movie", ("imageio", "imageio_ffmpeg")),
    ".html": ("html", ("trame_vtk",)),
}
"""What a kind of file needs: the extra of flexcam, and its modules."""

FRAMES = 72
"""Frames of a revolution."""

_PER_SECOND = 24


def free_to_save(path: Path, size: tuple[int, int], *, overwrite: bool = False) -> None:
    """Refuse a file that cannot be written, before anything is drawn."""
    if path.suffix not in NEEDS:
        raise refuse("--save", str(path), f"a name that ends in {', '.join(NEEDS)}")
    extra, modules = NEEDS[path.suffix]
    lacking = [name for name in modules if find_spec(name) is None]
    if lacking:
        why = f"{' and '.join(lacking)} cannot be imported"
        raise refuse("--save", str(path), "a kind of file whose packages are installed", why,
                     f"pip install 'flexcam[{extra}]'")  # fmt: skip
    if path.suffix == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise refuse("--size", f"{size[0]}x{size[1]}", "even numbers", "the colours of a movie are kept by fours")
    free_to_write("picture", path, overwrite=overwrite)


def save(stage: Stage, path: Path, frames: Sequence[int], still: int) -> None:
    """Write a picture or page of one instant, or a movie of many."""
    made_folder(path.parent)
    with whole(path) as draft:
        _save(stage, draft, frames, still)


def _save(stage: Stage, path: Path, frames: Sequence[int], still: int) -> None:
    match path.suffix:
        case ".gif":
            path.write_bytes(_gif(stage, frames))
        case ".mp4":
            _movie(stage, path, frames)
        case ".png":
            stage.show(still)
            stage.plotter.screenshot(path)
        case _:
            stage.show(still)
            stage.plotter.render()
            write_page(stage.plotter.render_window, path, stage.title)
    stage.plotter.close()


def _gif(stage: Stage, frames: Sequence[int]) -> bytes:
    """Return a movie as a file holds it: a writer to the file would print what the system refuses, and go on."""
    from imageio.v2 import get_writer

    made = BytesIO()
    duration = 1000.0 / _PER_SECOND  # ms
    stage.plotter.mwriter = get_writer(made, format=".gif", mode="I", duration=duration, loop=0)
    for i in frames:
        stage.show(i)
        stage.plotter.write_frame()
    stage.plotter.mwriter.close()
    return made.getvalue()


def _movie(stage: Stage, path: Path, frames: Sequence[int]) -> None:
    quiet = {"ffmpeg_log_level": "quiet"}  # what it would print is told below
    stage.plotter.open_movie(str(path), framerate=_PER_SECOND, macro_block_size=2, **quiet)
    for i in frames:
        stage.show(i)
        stage.plotter.write_frame()
    stage.plotter.close()
    if b"moov" not in path.read_bytes():  # its writer is silent where the disk is full
        raise OSError("its end is missing: no space left, perhaps")
