"""Faults of Gmsh files name the numbers of nodes, elements and groups in the file."""

import struct
import time
from contextlib import suppress

import numpy as np
import pytest

from flexcam import InputError, read_mesh

NODES = {10: "0 0 0", 20: "1 0 0", 30: "2 0 0", 40: "1 1 0", 50: "1 2 0"}
NAMES = {(1, 1): "bar", (1, 2): "rod", (0, 3): "tip"}


def msh(*elements, nodes=NODES, names=NAMES, count=None, node_count=None):
    """Return a file of format 2.2; each element is a text of its number and the rest of its line."""
    head = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    head += [f'{dimension} {number} "{name}"' for (dimension, number), name in names.items()]
    rows = nodes.items() if isinstance(nodes, dict) else nodes
    body = ["$EndPhysicalNames", "$Nodes", str(len(nodes) if node_count is None else node_count)]
    body += [f"{number} {place}" for number, place in rows]
    tail = ["$EndNodes", "$Elements", str(len(elements) if count is None else count)]
    return "\n".join([*head, *body, *tail, *elements, "$EndElements", ""])


GOOD = ("7 1 2 1 1 10 20", "8 1 2 1 1 20 30", "9 1 2 2 1 20 40", "11 15 2 3 1 40")

FAULTS = {
    "nodes at one place": (msh(*GOOD, nodes={**NODES, 50: "1 0 0"}), ["nodes 20 and 50", "1, 0, 0", "Merge"]),
    "nodes apart by rounding": (msh(*GOOD, nodes={**NODES, 50: "1.0000000000000002 0 0"}), ["nodes 20 and 50"]),
    "an element without length": (msh(*GOOD, nodes={**NODES, 30: "1 0 0"}), ["element 8", "nodes 20 and 30", "length"]),
    "a coordinate that is no number": (msh(*GOOD, nodes={**NODES, 40: "1 nan 0"}), ["node 40", "1, nan, 0", "finite"]),
    "an infinite coordinate": (msh(*GOOD, nodes={**NODES, 40: "1 1e999 0"}), ["node 40", "inf", "finite"]),
    "a coordinate beyond any length": (msh(*GOOD, nodes={**NODES, 40: "1 1e308 0"}), ["node 40", "1e+308", "up to"]),
    "two nodes of one number": (msh(*GOOD, nodes=[*NODES.items(), (20, "5 5 5")]), ["node 20", "several"]),
    "a node that is not there": (msh(*GOOD, "12 1 2 2 1 40 99"), ["element 12", "node 99", "no such node"]),
    "node zero": (msh(*GOOD, "12 1 2 2 1 40 0"), ["element 12", "node 0"]),
    "a triangle": (msh(*GOOD, "12 2 2 1 1 10 20 40"), ["an element of 3 nodes (element 12)", "Members are beams"]),
    "a line of three nodes": (msh(*GOOD, "12 8 2 1 1 10 30 20"), ["an element of 3 nodes (element 12)", "order 1"]),
    "a line in no group": (msh(*GOOD, "12 1 2 0 1 40 50"), ["elements (12)", "in no named group"]),
    "a line in a group without a name": (msh(*GOOD, "12 1 2 5 1 40 50"), ["elements (12)", "in no named group"]),
    "a branch": (msh(*GOOD, "12 1 2 1 1 20 40"), ["'bar'", "elements (7, 8, 12)", "node 20 has 3 lines"]),
    "a gap": (msh(*GOOD, "12 1 2 1 1 40 50"), ["'bar'", "ends at nodes 10, 30, 40, 50"]),
    "a loop": (msh(*GOOD, "12 1 2 1 1 30 10"), ["'bar'", "loop"]),
    "a member named as a path": (msh(*GOOD, names={**NAMES, (1, 1): "a/b"}), ["'a/b'", "letters A to Z", "Rename"]),
    "a point named as a path": (msh(*GOOD, names={**NAMES, (0, 3): "a/b"}), ["'a/b'", "letters A to Z", "Rename"]),
    "a point named as a folder": (msh(*GOOD, names={**NAMES, (0, 3): "."}), ["'.'", "letters A to Z"]),
    "a point named as the root": (msh(*GOOD, names={**NAMES, (0, 3): "/"}), ["'/'", "letters A to Z"]),
    "a point with a dot": (msh(*GOOD, names={**NAMES, (0, 3): "valve.tip"}), ["'valve.tip'", "letters A to Z"]),
    "a line with too few numbers": (msh("7 1 2 1 1 10", *GOOD[1:]), ["27 numbers in $Elements", "31 or more"]),
    "more elements announced": (msh(*GOOD, count=5), ["$Elements", "Entries or numbers are missing"]),
    "fewer elements announced": (msh(*GOOD, count=3), ["28 numbers in $Elements, expected 22 by"]),
    "more nodes announced": (msh(*GOOD, node_count=10**15), ["$Nodes", "4000000000000001 or more"]),
    "words for numbers": (msh(*GOOD, nodes={**NODES, 40: "one 1 0"}), ["'one' in $Nodes, expected a number"]),
    "a half node": (msh(*GOOD, nodes={**NODES, 40.5: "7 7 7"}), ["not whole"]),
    "an unknown element": (msh(*GOOD, "12 77 2 1 1 10 20"), ["type 77"]),
    "another version": (msh(*GOOD).replace("2.2 0 8", "4.0 0 8"), ["format 4.0", "4.1"]),
    "no elements": (msh(*GOOD).replace("$Elements", "$Other"), ["without $Elements"]),
    "no end": (msh(*GOOD).replace("$EndElements", ""), ["without $EndElements", "cut off"]),
}  # fmt: skip


@pytest.mark.parametrize("what", FAULTS)
def test_fault_names_numbers_of_nodes_and_elements(what, tmp_path, tried):
    text, parts = FAULTS[what]
    (tmp_path / "bad.msh").write_text(text)
    with pytest.raises(InputError) as refusal:
        read_mesh(tmp_path / "bad.msh")
    message = str(refusal.value)
    assert not [part for part in parts if part not in message], message
    tried("planted", f"mesh: {what}", 1, "refused")


def test_negative_dimension_of_node_block_is_refused(tmp_path):
    """A negative dimension would give rows of fewer than three coordinates."""
    text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 0\n$EndEntities\n$Nodes\n1 1 1 1\n-3 1 1 1\n1\n"
    (tmp_path / "bad.msh").write_text(text + "$EndNodes\n$Elements\n0 0 0 0\n$EndElements\n")
    with pytest.raises(InputError, match="nodes of dimension -3"):
        read_mesh(tmp_path / "bad.msh")


LONG = {
    "comments": "$Comments $EndComments " * 40 + "x",
    "blank lines": msh(*GOOD).replace("$PhysicalNames\n", "$PhysicalNames\n" + 60_000 * "\n"),
    "blanks in a name": msh(*GOOD).replace("$PhysicalNames\n", "$PhysicalNames\n1 1" + 60_000 * " " + "\n"),
}


@pytest.mark.parametrize("what", LONG)
def test_reading_time_is_proportional_to_length(what, tmp_path):
    """Regular expressions with backtracking would take minutes."""
    (tmp_path / "long.msh").write_text(LONG[what])
    start = time.process_time()
    with suppress(InputError):
        read_mesh(tmp_path / "long.msh")
    assert time.process_time() - start < 30.0


def test_valid_mesh_is_read(tmp_path):
    """The numbers do not start at one and are not consecutive, and one node is on no member."""
    (tmp_path / "good.msh").write_text(msh(*GOOD))
    mesh = read_mesh(tmp_path / "good.msh")
    assert mesh.nodes[mesh.lines["bar"]][:, 0].tolist() == [0.0, 1.0, 2.0]
    assert mesh.nodes[mesh.node("tip")].tolist() == [1.0, 1.0, 0.0]


def test_report_contains_all_faults(tmp_path):
    nodes = {**NODES, 40: "1 nan 0"}
    (tmp_path / "bad.msh").write_text(msh(*GOOD, "12 2 2 1 1 10 20 40", "13 1 2 0 1 40 50", nodes=nodes))
    with pytest.raises(InputError) as refusal:
        read_mesh(tmp_path / "bad.msh")
    assert len(refusal.value.faults) == 3


def test_binary_file_with_excessive_counts_is_refused(tmp_path):
    """No memory is allocated for data that the file does not contain."""
    head = b"$MeshFormat\n4.1 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n$Entities\n"
    entities = struct.pack("<4Q", 0, 0, 0, 0) + b"\n$EndEntities\n$Nodes\n"
    for count in (10**6, 10**12, 2**63 - 1, 2**64 - 1):
        nodes = struct.pack("<4Q", 1, count, 1, count) + struct.pack("<3i", 1, 1, 0) + struct.pack("<Q", count)
        (tmp_path / "huge.msh").write_bytes(head + entities + nodes + np.zeros(30).tobytes() + b"\n$EndNodes\n")
        with pytest.raises(InputError, match="Nodes"):
            read_mesh(tmp_path / "huge.msh")
