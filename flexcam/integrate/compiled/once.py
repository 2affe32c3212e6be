"""Functions that only machine code calls are made into machine code once: with what calls them.

By themselves nobody calls them, and the compiler would optimize each anew in every function around it: a quarter of
all its time.
"""

# The compiler has no types.
# pyright: reportMissingTypeStubs=false, reportUntypedBaseClass=false, reportUntypedFunctionDecorator=false
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.untyped_passes import IRProcessing


class _AsWritten(JITCodeLibrary):
    """Code that is optimized and made executable in the library it is linked into."""

    def _optimize_final_module(self) -> None: ...

    def _finalize_specific(self) -> None: ...


@register_pass(mutates_CFG=False, analysis_only=True)
class _KeptAsWritten(FunctionPass):
    """Lets a function's code be put into such a library."""

    _name = "kept_as_written"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:  # noqa: ANN401  # pyright: ignore[reportIncompatibleMethodOverride]
        state.library = _AsWritten(state.targetctx.codegen(), state.func_id.func_qualname)
        return False


class Inner(CompilerBase):
    """The compiler for functions that only machine code calls."""

    def define_pipelines(self) -> list[Any]:
        """Return the usual passes, and the one that keeps code as it is written."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_KeptAsWritten, IRProcessing)
        passes.finalize()
        return [passes]
