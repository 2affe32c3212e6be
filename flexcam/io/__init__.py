"""Files: meshes in, results out.

May import `fem`, `response`, `linalg` and `checks`; owns h5py and meshio.
A new format is one file here with one read or write function.
"""

from flexcam.io.csv import write_csv
from flexcam.io.geometry import Geometry
from flexcam.io.mesh_file import read_mesh, write_mesh
from flexcam.io.modes_file import write_modes
from flexcam.io.pvd import write_pvd
from flexcam.io.result import Result, read_result
from flexcam.io.target import made_folder
from flexcam.io.vtkhdf import ResultFile

__all__ = [
    "Geometry",
    "Result",
    "ResultFile",
    "made_folder",
    "read_mesh",
    "read_result",
    "write_csv",
    "write_mesh",
    "write_modes",
    "write_pvd",
]
