"""Schema of a result file: the name of every group, dataset and attribute, shared by writer and reader.

Names are paths from the root; docs/result-format.md describes the contents.
"""

from __future__ import annotations

from typing import Any

FORMAT = 3
TABLE_FORMAT = 3
"""Version of the file; since version 3 one digest covers names, attributes, texts and numbers."""

RESULT_SUFFIX, PARTIAL_SUFFIX = ".vtkhdf", ".partial.vtkhdf"
WRITING_SUFFIX, COPYING_SUFFIX = ".writing", ".copying"
"""Suffixes of a complete and of a partial result, of the file that a run writes, and of a copy that is not complete."""

# Attributes.
DIGEST = "seal"
UNITS = "units"
STEPS = "steps"
SIZE = "size"
COMPONENTS = "components"
MEMBER_NAMES = "names"
VTK_VERSION, VTK_TYPE, VTK_STEPS = "Version", "Type", "NSteps"

# Histories: a row per step.
HISTORY = "history"
TIME = "history/time"
CAM_ANGLE = "history/cam_angle"
PROBES = "history/probes"
CHANNELS = "history/channels"
TIME_SCALE = "time"

# Texts, status, mesh and checkpoint.
ABOUT = "about"
ABOUT_FORMAT = "format"
ABOUT_FILES = "files"  # of a case that names some
ABOUT_CASE: dict[str, Any] = {
    "case": str, "case_file": str, "overrides": list[str], "resolved": dict[str, Any], ABOUT_FILES: dict[str, str],
}  # fmt: skip
"""Texts that restore the case of a result, and the types of their JSON; a text is stored unchanged."""

MODES_KIND, MODES_FREQUENCIES = "kind", "frequencies_hz"
"""Texts about a file of modes."""

STATUS = "status"
CAUSE, TEXT, REMEDY, WARNINGS = "cause", "text", "remedy", "warnings"
MESH_NODES = "mesh/nodes"
MESH_POINTS = "mesh/points"
CHECKPOINT = "checkpoint"
CHECKPOINT_STEPS, CHECKPOINT_PROBLEM = "steps", "problem"
"""Arrays in the checkpoint in addition to those of the engine."""

FIELD_CAM_ANGLE = "fields/cam_angle"

# Fields, as VTK's file format names them.
VTK = "VTKHDF"
VTK_TYPE_NAME = b"PolyData"
POINT_COUNT = "VTKHDF/NumberOfPoints"
POINTS = "VTKHDF/Points"
TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
CELL_COUNT, CONNECTIVITY_COUNT, CONNECTIVITY, OFFSETS = (
    "NumberOfCells", "NumberOfConnectivityIds", "Connectivity", "Offsets",
)  # fmt: skip
LINE_OFFSETS = "VTKHDF/Lines/Offsets"
MEMBER = "VTKHDF/CellData/member"
POINT_DATA = "VTKHDF/PointData"
FIELD_STEPS = "VTKHDF/Steps"
FIELD_TIME = "VTKHDF/Steps/Values"
PART_COUNT = "NumberOfParts"
PART_OFFSETS, POINT_OFFSETS, MEMBER_OFFSETS = "PartOffsets", "PointOffsets", "CellDataOffsets/member"
CELL_OFFSETS, CONNECTIVITY_OFFSETS = "CellOffsets", "ConnectivityIdOffsets"
POINT_DATA_OFFSETS = "PointDataOffsets"

VECTORS = {
    "displacement": ("displacement", 0, "m"),
    "rotation": ("displacement", 3, "rad"),
    "velocity": ("velocity", 0, "m/s"),
    "angular_velocity": ("velocity", 3, "rad/s"),
    "acceleration": ("acceleration", 0, "m/s^2"),
    "angular_acceleration": ("acceleration", 3, "rad/s^2"),
}
"""Point vectors: name to source series, first component and unit."""

RECOVERED_FIELDS = {
    "section_force": ("N", 3),
    "section_moment": ("N m", 3),
    "stress_axial": ("Pa", 1),
    "stress_bending": ("Pa", 1),
    "stress_torsion": ("Pa", 1),
    "stress_von_mises": ("Pa", 1),
}
"""Point data computed from displacements: unit and width. Forces are N, Vy, Vz and T, My, Mz in local axes."""

FIELDS = {**{name: (unit, 3) for name, (*_, unit) in VECTORS.items()}, **RECOVERED_FIELDS}
"""All point data of an instant: unit and width."""

RADIUS, NODE, AXES = "radius", "node", ("axis_x", "axis_y", "axis_z")
CONSTANT_DATA = {RADIUS: ("f8", 1), NODE: ("i8", 1), **dict.fromkeys(AXES, ("f8", 3))}
"""Constant point data: type and width."""
