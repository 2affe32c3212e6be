"""Files: meshes, lift tables and profiles in, results out. Owns h5py and meshio.

May import `fem`, `cams`, `dynamics` and `core`. A new format is a file with one read or write function; datasets of
a result are named in `result_schema`.
"""

from flexcam.io.cam_files import (
    ProfileTable,
    read_lift,
    read_profile,
    write_law,
    write_lift,
    write_lift_table,
    write_profile,
)
from flexcam.io.exports import macro_path, write_collection, write_csv, write_macro, write_modes, write_pvd
from flexcam.io.files import (
    atomic_write_path,
    check_folder,
    check_folder_name,
    check_writable,
    create_folder,
    find_referenced_file,
    format_toml,
    open_with_lock,
    read_text,
    resolve_file,
    temporary_folder,
    write_text,
)
from flexcam.io.hdf5 import open_hdf5, write_digest
from flexcam.io.matrix_file import NodalMatrix, read_matrix
from flexcam.io.mesh_file import read_mesh, write_mesh
from flexcam.io.result_reader import PartialResult, Result, read_result
from flexcam.io.result_schema import RECOVERED_FIELDS, VECTORS
from flexcam.io.result_writer import ResultFile, count_output_points, partial_path, result_bytes
from flexcam.io.vtk import Geometry, write_polydata

__all__ = [
    "RECOVERED_FIELDS", "VECTORS", "Geometry", "NodalMatrix", "PartialResult", "ProfileTable", "Result",
    "ResultFile", "atomic_write_path", "check_folder", "check_folder_name", "check_writable", "count_output_points",
    "create_folder", "find_referenced_file", "format_toml", "macro_path", "open_hdf5", "open_with_lock",
    "partial_path", "read_lift", "read_matrix", "read_mesh", "read_profile", "read_result", "read_text",
    "resolve_file", "result_bytes", "temporary_folder", "write_collection", "write_csv",
    "write_digest", "write_law", "write_lift", "write_lift_table", "write_macro", "write_mesh", "write_modes",
    "write_polydata", "write_profile", "write_pvd", "write_text",
]  # fmt: skip
