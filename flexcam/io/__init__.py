"""Files: meshes in, results out.

May import `fem`, `motion`, `response`, `checkpoint`, `linalg` and `checks`; owns h5py and meshio.
A new format is one file here with one read or write function.
"""

from flexcam.io.csv import write_csv, write_text
from flexcam.io.geometry import RECOVERED, Geometry
from flexcam.io.guard import guarded
from flexcam.io.lift_file import LiftColumns, read_lift, write_lift_table
from flexcam.io.lock import hold
from flexcam.io.mesh_file import read_mesh, write_mesh
from flexcam.io.modes_file import write_modes
from flexcam.io.motion_file import write_law, write_lift
from flexcam.io.named import file_beside, named_file
from flexcam.io.paraview_macro import macro_of, write_macro
from flexcam.io.profile_file import ProfileTable, write_profile
from flexcam.io.profile_points import read_profile
from flexcam.io.pvd import write_pvd
from flexcam.io.regular import text_of
from flexcam.io.result import Result, read_result
from flexcam.io.result_size import points_drawn, result_bytes
from flexcam.io.scratch import scratch
from flexcam.io.sealed import seal, seal_fault
from flexcam.io.target import free_to_write, made_folder, named_as_folder, takes_files
from flexcam.io.toml_text import toml_text
from flexcam.io.unfinished import Unfinished
from flexcam.io.verify import Verified, verified
from flexcam.io.vtkhdf import VECTORS, ResultFile, partial_of
from flexcam.io.whole import whole

__all__ = [
    "RECOVERED",
    "VECTORS",
    "Geometry",
    "LiftColumns",
    "ProfileTable",
    "Result",
    "ResultFile",
    "Unfinished",
    "Verified",
    "file_beside",
    "free_to_write",
    "guarded",
    "hold",
    "macro_of",
    "made_folder",
    "named_as_folder",
    "named_file",
    "partial_of",
    "points_drawn",
    "read_lift",
    "read_mesh",
    "read_profile",
    "read_result",
    "result_bytes",
    "scratch",
    "seal",
    "seal_fault",
    "takes_files",
    "text_of",
    "toml_text",
    "verified",
    "whole",
    "write_csv",
    "write_law",
    "write_lift",
    "write_lift_table",
    "write_macro",
    "write_mesh",
    "write_modes",
    "write_profile",
    "write_pvd",
    "write_text",
]
