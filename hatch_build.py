"""Build hook: compile the kernel ahead of time into the wheel if `FLEXCAM_COMPILE` is 1.

The wheel then belongs to one version of Python and one kind of processor; a first run needs no compiler. The code uses
the instructions that all processors of the kind have: others make it about 3 % faster.
"""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CompileHook(BuildHookInterface):
    """Hook of the builder of wheels."""

    def dependencies(self) -> list[str]:
        """Return the packages that the compilation needs."""
        if not _is_requested():
            return []
        run_time = self.metadata.core.dependencies
        return ["setuptools", *(name for name in run_time if name.startswith(("numpy", "numba")))]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the extension module to the wheel."""
        if version == "standard" and _is_requested():
            path = compile_program(Path(self.root), Path(self.root) / "build")
            build_data["force_include"][str(path)] = f"flexcam/dynamics/{path.name}"
            build_data["pure_python"], build_data["infer_tag"] = False, True


def _is_requested() -> bool:
    return os.environ.get("FLEXCAM_COMPILE", "0") == "1"


def compile_program(root: Path, folder: Path) -> Path:
    """Compile the kernel of a source tree into an extension module in a folder, and return its path."""
    warnings.filterwarnings("ignore", message="The 'pycc' module is pending deprecation")
    sys.path.insert(0, str(root))
    import numba
    from numba.pycc import CC

    from flexcam.dynamics.jit import INNER_OPTIONS, bind
    from flexcam.dynamics.kernel_step import PROGRAM

    compiler, functions = CC(PROGRAM.extension), bind(PROGRAM.functions, {}, numba.njit(**INNER_OPTIONS))
    compiler.output_dir = str(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, signature in PROGRAM.entries:
        names = ", ".join(f"a{i}" for i in range(len(signature.split())))
        namespace = {name: functions[name]}
        exec(f"def entry({names}): return {name}({names})", namespace)  # noqa: S102 - numba needs a fixed number of them
        compiler.export(name, PROGRAM.argument_types(name))(namespace["entry"])
    compiler.compile()
    return folder / compiler.output_file
