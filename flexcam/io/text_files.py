"""Texts in HDF5 files, all of one fixed length: those of variable length stand on a heap that has no checksum.

A damaged heap can keep HDF5 in an endless loop, so that no reader here touches one.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.fem.mesh import Mesh
from flexcam.io.hdf5 import attribute, dataset, fill, text

_module: Any = h5py


def encoded(texts: Sequence[str]) -> Any:  # noqa: ANN401 - an array
    """Return texts as an array of UTF-8 of one length, as HDF5 takes it."""
    parts = [one.encode() for one in texts]
    return np.array(parts, dtype=_module.string_dtype("utf-8", max([1, *map(len, parts)])))


def texts(group: Any, content: Mapping[str, str]) -> None:  # noqa: ANN401 - h5py has no types
    """Write texts into a group, one dataset each."""
    for name, one in content.items():
        value = encoded([one]).reshape(())
        kind = text(value.dtype.itemsize)
        fill(dataset(group, name, kind, ()), value, kind)


def read_texts(group: Any) -> dict[str, str]:  # noqa: ANN401
    """Return the texts of a group, by name."""
    return {name: bytes(item[()]).decode() for name, item in group.items()}


def note(one: Any, name: str, content: str | Sequence[str]) -> None:  # noqa: ANN401
    """Write a text, or several, as an attribute."""
    values = encoded([content] if isinstance(content, str) else content)
    attribute(one, name, values.reshape(()) if isinstance(content, str) else values, text(values.dtype.itemsize))


def noted(one: Any, name: str) -> str:  # noqa: ANN401
    """Return the text of an attribute."""
    return bytes(one.attrs[name]).decode()


def notes(one: Any, name: str) -> tuple[str, ...]:  # noqa: ANN401
    """Return the texts of an attribute."""
    return tuple(bytes(content).decode() for content in one.attrs[name])


_ARRAY = re.compile(r"^(?P<head>.*)\[\n(?P<body>(?: +[^ \[\]{}].*,\n)+) *\](?P<tail>,?)$", re.MULTILINE)
"""An array as tomli_w writes it, an element to a line; one of arrays or tables stays as it is."""

_WIDE = 100
"""Letters of a line."""


def toml_text(content: Mapping[str, object]) -> str:
    """Return tables as TOML text."""
    import tomli_w

    return _ARRAY.sub(_joined, tomli_w.dumps(content))


def _joined(found: re.Match[str]) -> str:
    lines = found["body"].removesuffix("\n").split("\n")  # a text may hold what Python too takes for the end of a line
    elements = [line.strip(" ").removesuffix(",") for line in lines]
    line = f"{found['head']}[{', '.join(elements)}]{found['tail']}"
    return line if len(line) <= _WIDE else found[0]


def inp_text(mesh: Mesh) -> str:
    """Return nodes, elements, a set of elements per member and a set of nodes per named point."""
    import meshio  # pyright: ignore[reportMissingTypeStubs]

    blocks: Any = [("line", np.column_stack([line[:-1], line[1:]])) for line in mesh.lines.values()]
    nothing = np.zeros(0, dtype=np.intp)
    sets: Any = {
        name: [np.arange(len(pairs)) if i == k else nothing for i, (_, pairs) in enumerate(blocks)]
        for k, name in enumerate(mesh.lines)
    }
    points: Any = dict(mesh.points)
    text = io.StringIO()
    whole = meshio.Mesh(mesh.nodes, blocks, cell_sets=sets, point_sets=points)
    meshio.abaqus.write(text, whole)  # pyright: ignore
    return text.getvalue().replace("TYPE=B31H", "TYPE=B31")  # the one beam of two nodes that both programs know
