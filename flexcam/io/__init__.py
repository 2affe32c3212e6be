"""Files: meshes, lift tables and profiles in, results out. Owns h5py and meshio.

May import `fem`, `cams`, `dynamics` and `core`. A new format is a file with one read or write function; datasets of
a result are laid out in `result_writer`.
"""

from flexcam.io.atomic_write import atomic_write_path, lock_file, temporary_folder
from flexcam.io.exports import macro_path, write_csv, write_macro, write_pvd, write_text
from flexcam.io.hdf5 import open_checked
from flexcam.io.integrity import digest_fault, write_digest
from flexcam.io.lift_file import LiftColumns, read_lift, write_lift_table
from flexcam.io.mesh_file import read_mesh, write_mesh
from flexcam.io.modes_file import write_law, write_lift, write_modes
from flexcam.io.paths import (
    check_folder_name,
    check_folder_writable,
    check_writable,
    create_folder,
    find_referenced_file,
    read_text,
    resolve_file,
)
from flexcam.io.profile_file import ProfileTable, read_profile, write_profile
from flexcam.io.result_reader import Result, VerificationSummary, read_result, verify_file
from flexcam.io.result_writer import VECTORS, ResultFile, count_output_points, partial_path, result_bytes
from flexcam.io.resume import PartialResult
from flexcam.io.text_files import format_toml
from flexcam.io.vtk_groups import RECOVERED_FIELDS, Geometry

__all__ = [
    "RECOVERED_FIELDS",
    "VECTORS",
    "Geometry",
    "LiftColumns",
    "PartialResult",
    "ProfileTable",
    "Result",
    "ResultFile",
    "VerificationSummary",
    "atomic_write_path",
    "check_folder_name",
    "check_folder_writable",
    "check_writable",
    "count_output_points",
    "create_folder",
    "digest_fault",
    "find_referenced_file",
    "format_toml",
    "lock_file",
    "macro_path",
    "open_checked",
    "partial_path",
    "read_lift",
    "read_mesh",
    "read_profile",
    "read_result",
    "read_text",
    "resolve_file",
    "result_bytes",
    "temporary_folder",
    "verify_file",
    "write_csv",
    "write_digest",
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
