"""Fixed-length strings in HDF5 files, and TOML and Abaqus texts.

Variable-length strings lie on an HDF5 heap without a checksum; a damaged heap can cause an endless loop in HDF5.
Therefore no reader of flexcam accesses one.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from typing import Any

import h5py  # pyright: ignore[reportMissingTypeStubs]
import numpy as np

from flexcam.fem.mesh import Mesh
from flexcam.io.hdf5 import create_dataset, string_type, write_attribute, write_dataset

_module: Any = h5py


def encode_strings(texts: Sequence[str]) -> Any:  # noqa: ANN401 - an array
    """Return strings as an HDF5-compatible array of UTF-8 bytes of one length."""
    parts = [one.encode() for one in texts]
    return np.array(parts, dtype=_module.string_dtype("utf-8", max([1, *map(len, parts)])))


def write_strings(group: Any, content: Mapping[str, str]) -> None:  # noqa: ANN401 - h5py has no types
    """Write strings into a group, one dataset each."""
    for name, one in content.items():
        value = encode_strings([one]).reshape(())
        kind = string_type(value.dtype.itemsize)
        write_dataset(create_dataset(group, name, kind, ()), value, kind)


def read_strings(group: Any) -> dict[str, str]:  # noqa: ANN401
    """Return the strings of a group by name."""
    return {name: bytes(item[()]).decode() for name, item in group.items()}


def write_string_attribute(one: Any, name: str, content: str | Sequence[str]) -> None:  # noqa: ANN401
    """Write one or more strings as an attribute."""
    values = encode_strings([content] if isinstance(content, str) else content)
    write_attribute(
        one, name, values.reshape(()) if isinstance(content, str) else values, string_type(values.dtype.itemsize)
    )


def read_string_attribute(one: Any, name: str) -> str:  # noqa: ANN401
    """Return the string of an attribute."""
    return bytes(one.attrs[name]).decode()


def read_string_attributes(one: Any, name: str) -> tuple[str, ...]:  # noqa: ANN401
    """Return the strings of an attribute."""
    return tuple(bytes(content).decode() for content in one.attrs[name])


_ARRAY = re.compile(r"^(?P<head>.*)\[\n(?P<body>(?: +[^ \[\]{}].*,\n)+) *\](?P<tail>,?)$", re.MULTILINE)
"""Array in the output of tomli_w, one element per line; nested arrays and tables do not match."""

_LINE_LENGTH = 100
"""Maximum line length, characters."""


def format_toml(content: Mapping[str, object]) -> str:
    """Return tables as TOML text."""
    import tomli_w

    return _ARRAY.sub(_join_array, tomli_w.dumps(content))


def _join_array(found: re.Match[str]) -> str:
    lines = found["body"].removesuffix("\n").split("\n")  # `splitlines` would also split inside strings
    elements = [line.strip(" ").removesuffix(",") for line in lines]
    line = f"{found['head']}[{', '.join(elements)}]{found['tail']}"
    return line if len(line) <= _LINE_LENGTH else found[0]


def format_inp(mesh: Mesh) -> str:
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
    return text.getvalue().replace("TYPE=B31H", "TYPE=B31")  # the two-node beam element that Abaqus and CalculiX share
