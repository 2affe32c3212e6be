"""Files of solid mechanisms: STL of an instant; motion for ParaView (VTM), as glTF binary (GLB) and as an HTML page."""

from __future__ import annotations

import json
import re
import struct
from base64 import b64encode
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from flexcam.core import FloatArray, IntArray
from flexcam.io import atomic_write_path, check_writable, create_folder, write_collection, write_polydata
from flexcam.io.vtk import write_vtk
from flexcam.plotting.scene.mechanism import Mechanism
from flexcam.plotting.scene.motion import Motion
from flexcam.plotting.scene.solids import COLOURS, NEUTRAL_COLOUR, OPACITIES, Solid

_MILLIMETRES = 1e3  # STL has no unit; CAD programs and slicers read mm
FRAMES_PER_SECOND = 24  # of animations
_RELATIVE_REST = 1e-9  # motion relative to the size of a part below which it is at rest


@dataclass(frozen=True, eq=False)
class Part:
    """All solids of one part of a mechanism at the instants of a motion."""

    name: str  # kind and name in the case, such as ``lobe-intake``; also a file name
    kind: str
    faces: IntArray  # point indices of the triangles, shape (t, 3)
    points: FloatArray  # points, m, global axes, shape (f, n, 3)
    values: FloatArray | None  # colour values, shape (f, n); None if there are none

    @property
    def moves(self) -> bool:
        """True if its points move or its values change."""
        motion = np.abs(self.points - self.points[0]).max()
        changed = self.values is not None and bool((self.values != self.values[0]).any())
        return bool(motion > _RELATIVE_REST * np.ptp(self.points[0], axis=0).max()) or changed

    def colour(self, *, by_value: bool = False) -> tuple[float, ...]:
        """Return red, green and blue (sRGB) and the opacity, 0 to 1; without a value among coloured parts, grey."""
        code = NEUTRAL_COLOUR if by_value else COLOURS[self.kind]
        return (*(int(code[i : i + 2], 16) / 255.0 for i in (1, 3, 5)), OPACITIES.get(self.kind, 1.0))


def collect_parts(mechanism: Mechanism, motion: Motion, scale: float = 1.0) -> list[Part]:
    """Return the parts of a mechanism at all instants of a motion, with its elastic part times a scale."""
    states: dict[str, list[list[Solid]]] = defaultdict(lambda: [[] for _ in range(len(motion))])
    for i in range(len(motion)):
        for solid in mechanism.solids(motion.instant(i, scale)):
            label = solid.kind if solid.name in ("", solid.kind) else f"{solid.kind}-{solid.name}"
            states[label][i].append(solid)
    parts: list[Part] = []
    for label, instants in states.items():
        name = re.sub(r"[^\w.-]", "_", label)
        if name.lower() in {part.name.lower() for part in parts}:
            name += f"-{len(parts)}"
        first = instants[0]
        starts = np.cumsum([0, *(len(solid.points) for solid in first)])[:-1]
        faces = np.concatenate([solid.faces + start for solid, start in zip(first, starts, strict=True)])
        points = np.array([np.concatenate([solid.points for solid in solids]) for solids in instants])
        values = None
        if first[0].values is not None:
            values = np.array([np.concatenate([np.asarray(solid.values) for solid in solids]) for solids in instants])
        parts.append(Part(name, first[0].kind, faces, points, values))
    return parts


def write_stl(folder: Path, parts: Sequence[Part], *, overwrite: bool = False) -> list[Path]:
    """Write the first instant as a binary STL file per part, in mm and global axes."""
    paths = [folder / f"{part.name}.stl" for part in parts]
    for path in paths:
        check_writable("export", path, overwrite=overwrite)
    for part, path in zip(parts, paths, strict=True):
        corners = _MILLIMETRES * part.points[0][part.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        rows = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        rows["corners"] = corners
        rows["normal"] = normals / np.linalg.norm(normals, axis=1)[:, None].clip(min=np.finfo(float).tiny)
        head = f"flexcam {part.name}, mm".encode("ascii", "replace")[:80].ljust(80)
        with atomic_write_path(path) as draft:
            draft.write_bytes(head + struct.pack("<I", len(rows)) + rows.tobytes())
    return paths


def write_vtm(
    path: Path, parts: Sequence[Part], times: FloatArray, label: str = "", *, overwrite: bool = False
) -> list[Path]:
    """Write a ParaView collection (.pvd) of a multiblock file (.vtm) per instant; parts at rest are written once.

    The blocks have the names of the parts. Parts with colour values have them as point data named `label`.
    """
    check_writable("export", path, overwrite=overwrite)
    folder = create_folder(path.with_suffix(""))
    pieces: list[Path] = []
    blocks: list[list[str]] = [[] for _ in times]
    for part in parts:
        cells = {"Polys": (part.faces.ravel(), 3 * np.arange(1, len(part.faces) + 1))}
        moves = part.moves
        for i in range(len(times)):
            piece = folder / f"{part.name}_{i if moves else 0:06d}.vtp"
            if moves or i == 0:
                values = {} if part.values is None else {label: part.values[i]}
                write_polydata(piece, part.points[i], cells, point_data=values)
                pieces.append(piece)
            blocks[i].append(f'<DataSet index="{len(blocks[i])}" name="{part.name}" file="{piece.name}"/>')
    instants = [folder / f"instant_{i:06d}.vtm" for i in range(len(times))]
    for instant, lines in zip(instants, blocks, strict=True):
        write_vtk(instant, "vtkMultiBlockDataSet", lines)
    write_collection(path, times, instants)
    return [path, *instants, *pieces]


class _Buffer:
    """Binary chunk of a glTF file with its views and accessors."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.views: list[Mapping[str, int]] = []
        self.accessors: list[Mapping[str, Any]] = []

    def add(self, arrays: FloatArray | IntArray, form: str, component: str, *, bounds: bool = True) -> list[int]:
        """Add arrays of equal shape, one after the other, as one view; return an accessor for each."""
        packed = np.ascontiguousarray(arrays, dtype=component)
        self.views.append({"buffer": 0, "byteOffset": len(self.content), "byteLength": packed.nbytes})
        self.content += packed.tobytes()
        first = len(self.accessors)
        for i, array in enumerate(packed):
            flat = array.reshape(len(array), -1)
            ends = {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()} if bounds else {}
            self.accessors.append({
                "bufferView": len(self.views) - 1, "byteOffset": i * array.nbytes,
                "componentType": {"<f4": 5126, "<u4": 5125}[component], "count": len(array), "type": form, **ends,
            })  # fmt: skip
        return list(range(first, len(self.accessors)))


def write_glb(
    path: Path, parts: Sequence[Part], upwards: FloatArray, title: str = "", *, overwrite: bool = False
) -> Path:
    """Write the motion as glTF 2.0 binary, in m: a mesh and a node per part, and a morph target per instant.

    The root node rotates `upwards` to y, as glTF requires.
    """
    check_writable("export", path, overwrite=overwrite)
    count = len(parts[0].points)
    buffer = _Buffer()
    kinds = list(dict.fromkeys(part.kind for part in parts))
    colours = [next(part for part in parts if part.kind == kind).colour() for kind in kinds]
    moving = [i for i, part in enumerate(parts) if part.moves]
    meshes = [_mesh(buffer, part, kinds.index(part.kind)) for part in parts]
    turn = np.append(np.cross(upwards, [0.0, 1.0, 0.0]), 1.0 + upwards[1])
    root = {"name": title, "rotation": (turn / np.linalg.norm(turn)).tolist(), "children": list(range(len(parts)))}
    nodes = [*({"name": part.name, "mesh": i} for i, part in enumerate(parts)), root]
    materials: list[dict[str, Any]] = []
    for kind, (*colour, opacity) in zip(kinds, colours, strict=True):  # glTF has linear colours
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour]
        surface = {"baseColorFactor": [*linear, opacity], "metallicFactor": 0.1, "roughnessFactor": 0.6}
        mode = "BLEND" if opacity < 1.0 else "OPAQUE"
        materials.append({"name": kind, "pbrMetallicRoughness": surface, "alphaMode": mode})
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "flexcam"}, "scene": 0, "scenes": [{"nodes": [len(parts)]}],
        "nodes": nodes, "meshes": meshes, "materials": materials,
    }  # fmt: skip
    if moving:
        times = buffer.add(np.arange(count)[None] / FRAMES_PER_SECOND, "SCALAR", "<f4")[0]
        weights = buffer.add(np.eye(count)[:, 1:].reshape(1, -1), "SCALAR", "<f4", bounds=False)[0]
        targets = [{"sampler": 0, "target": {"node": i, "path": "weights"}} for i in moving]
        sampler = {"input": times, "output": weights, "interpolation": "LINEAR"}
        content["animations"] = [{"name": "revolution", "samplers": [sampler], "channels": targets}]
    content |= {"accessors": buffer.accessors, "bufferViews": buffer.views}
    content["buffers"] = [{"byteLength": len(buffer.content)}]
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(buffer.content), b"BIN\0") + buffer.content
    with atomic_write_path(path) as draft:
        draft.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def _mesh(buffer: _Buffer, part: Part, material: int) -> dict[str, Any]:
    """Return the mesh of a part: the first instant, and the displacements from there to the others."""
    targets = buffer.add(part.points[1:] - part.points[0], "VEC3", "<f4") if part.moves else []
    position = buffer.add(part.points[:1], "VEC3", "<f4")[0]
    indices = buffer.add(part.faces.reshape(1, -1), "SCALAR", "<u4")[0]
    primitive: dict[str, Any] = {"attributes": {"POSITION": position}, "indices": indices, "material": material}
    mesh: dict[str, Any] = {"name": part.name, "primitives": [primitive]}
    if targets:
        primitive["targets"] = [{"POSITION": target} for target in targets]
        mesh["weights"] = [0.0] * len(targets)
    return mesh


def write_page(
    path: Path, parts: Sequence[Part], view: FloatArray, labels: Sequence[str], still: int, scale: str = ""
) -> None:
    """Write the motion as an HTML page that turns it in space and fetches nothing.

    The rows of `view` point to the right, up and to the observer. The page begins at instant `still`. `labels` has a
    text per instant, with the title in its first line; `scale` is the name of the colour values.
    """
    low = np.min([part.points.min(axis=(0, 1)) for part in parts], axis=0)
    high = np.max([part.points.max(axis=(0, 1)) for part in parts], axis=0)
    size = 0.5 * float(np.linalg.norm(high - low))
    values = [part.values for part in parts if part.values is not None]
    limits = min([0.0, *map(np.nanmin, values)]), max([0.0, *map(np.nanmax, values)])
    content = {
        "parts": [_page_part(part, low, high, limits, by_value=bool(values)) for part in parts],
        "turn": view.ravel().tolist(), "low": (-0.5 * (high - low) / size).tolist(),
        "span": ((high - low) / size).tolist(), "labels": list(labels), "still": still, "rate": FRAMES_PER_SECOND,
    }  # fmt: skip
    ticks = [f"<span>{limit:.4g}</span>" for limit in limits[::-1]]
    bar = f'<div id="bar"><span>{escape(scale)}</span>{ticks[0]}<div></div>{ticks[1]}</div>' if values else ""
    colours = ", ".join(f"rgb({r}, {g}, {b})" for r, g, b in _viridis(np.linspace(1.0, 0.0, 9)).tolist())
    page = Template((files("flexcam") / "plotting/view.html").read_text(encoding="utf-8"))
    data = json.dumps(content).replace("<", "\\u003c")
    text = page.substitute(title=escape(labels[0].partition("\n")[0]), bar=bar, data=data, colours=colours)
    with atomic_write_path(path) as draft:
        draft.write_text(text, encoding="utf-8")


def _page_part(
    part: Part, low: FloatArray, high: FloatArray, limits: tuple[float, float], *, by_value: bool
) -> dict[str, object]:
    """Return a part for a page: points as fractions of the box in 16 bits, colours in 8 bits."""
    count = len(part.points) if part.moves else 1
    places = (65535.0 * (part.points[:count] - low) / np.maximum(high - low, np.finfo(float).tiny)).round()
    *colour, opacity = part.colour(by_value=by_value)
    pad = [(0, 0), (0, 0), (0, 1)]
    entry: dict[str, object] = {
        "count": part.points.shape[1], "colour": colour, "opacity": opacity, "faces": _encode(part.faces, "<u4"),
        "points": _encode(np.pad(places, pad), "<u2"),
    }  # fmt: skip
    if part.values is not None:
        tints = _viridis((part.values[:count] - limits[0]) / ((limits[1] - limits[0]) or 1.0))
        entry["tints"] = _encode(np.pad(tints, pad), "u1")
    return entry


def _viridis(values: FloatArray) -> IntArray:
    from matplotlib import colormaps

    return np.asarray(colormaps["viridis"](values, bytes=True)[..., :3], dtype=np.int64)


def _encode(values: FloatArray | IntArray, kind: str) -> str:
    return b64encode(values.astype(kind).tobytes()).decode("ascii")
