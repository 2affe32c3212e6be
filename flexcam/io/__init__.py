"""Input and output files: meshes, lift tables, profiles, results and exports.

May import `fem`, `cams`, `dynamics`, `checkpoint` and `core`; only this package imports h5py and meshio.
Add a new format as one file here with one read or write function.
"""

from flexcam.io.atomic_write import hold, scratch, whole
from flexcam.io.exports import macro_of, write_csv, write_macro, write_pvd, write_text
from flexcam.io.hdf5 import guarded
from flexcam.io.integrity import seal, seal_fault
from flexcam.io.lift_file import LiftColumns, read_lift, write_lift_table
from flexcam.io.mesh_file import read_mesh, write_mesh
from flexcam.io.modes_file import write_law, write_lift, write_modes
from flexcam.io.paths import file_beside, free_to_write, made_folder, named_as_folder, named_file, takes_files, text_of
from flexcam.io.profile_file import ProfileTable, read_profile, write_profile
from flexcam.io.result_reader import Result, Verified, read_result, verified
from flexcam.io.result_writer import VECTORS, ResultFile, partial_of, points_drawn, result_bytes
from flexcam.io.resume import Unfinished
from flexcam.io.text_files import toml_text
from flexcam.io.vtk_groups import RECOVERED, Geometry

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
