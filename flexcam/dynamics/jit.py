"""Compile the functions of the kernel with numba, or bind them as Python: both come from the same source text.

Every function is copied with globals in which the functions it calls are the compiled ones. A wheel may contain an
extension module with the compiled functions (`hatch_build.py`); without it numba compiles them at first use, and its
on-disk cache keeps the code. The extension module and the folder of the cache are named after a digest of the source
text.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

Functions = dict[str, Callable[..., Any]]
"""Functions by name."""

_OPTIONS: dict[str, Any] = {
    "nogil": True,  # not in an extension module, which runs one thread at a time
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract", "nsz"},  # sums in any order; NaN and infinity stay what they are
    "_nrt": False,  # no array is created in compiled code, so that references need no counting
}
INNER_OPTIONS: dict[str, Any] = {**_OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of numba for functions that only compiled code calls."""

_LOGGER = logging.getLogger(__name__)


@dataclass(frozen=True)
class Program:
    """Functions to compile; those that they call come first.

    Only entries may be called from Python and are cached; the other functions are compiled into them. The signature of
    an entry is a word per argument: ``f``, ``i`` or ``u`` for float64, int64 or uint32, and the number of dimensions of
    a C-contiguous array.
    """

    functions: tuple[FunctionType, ...]
    entries: tuple[tuple[str, str], ...]  #: names of the entries and their signatures

    @cached_property
    def digest(self) -> str:
        """Digest of the source text, with this module for its options, and of the signatures."""
        modules = dict.fromkeys((__name__, *(function.__module__ for function in self.functions)))
        text = b"".join(Path(sys.modules[name].__file__ or "").read_bytes() for name in modules)
        return hashlib.sha256(text + repr(self.entries).encode()).hexdigest()[:16]

    @property
    def extension(self) -> str:
        """Name of the extension module with the compiled functions, in the package of this module."""
        return f"_compiled_{self.digest}"

    def load_extension(self) -> ModuleType | None:
        """Return the extension module; None without it, or if compiled code is disabled."""
        return None if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0" else self._module

    @cached_property
    def _module(self) -> ModuleType | None:
        try:
            return import_module(f"{__package__}.{self.extension}")
        except ImportError:
            return None

    def is_available(self) -> bool:
        """Return whether the functions are compiled, or numba is installed and may compile them."""
        if self.load_extension() is not None:
            return True
        return find_spec("numba") is not None and not import_module("numba.core.config").DISABLE_JIT

    def compile(self) -> Functions:
        """Return the entries as compiled code."""
        extension = self.load_extension()
        return compile_functions(self) if extension is None else {n: getattr(extension, n) for n, _ in self.entries}

    def argument_types(self, entry: str) -> tuple[Any, ...]:
        """Return the types of the arguments of an entry, of numba."""
        types: Any = import_module("numba").types
        scalars = {"f": types.float64, "i": types.int64, "u": types.uint32}
        words = dict(self.entries)[entry].split()
        return tuple(types.Array(scalars[w[0]], int(w[1:]), "C") if w[1:] else scalars[w] for w in words)


@lru_cache
def compile_functions(program: Program, *, cached: bool = True) -> Functions:
    """Return the functions as numba compiles them; it compiles or loads an entry at its first call."""
    numba: Any = import_module("numba")
    entries = dict(program.entries)
    with _cache_folder(program.digest) as writable:
        use_cache = cached and writable
        inner = numba.njit(**INNER_OPTIONS)
        entry = numba.njit(cache=use_cache, **_OPTIONS)
        compiled = bind(
            program.functions, {}, lambda function: (entry if function.__name__ in entries else inner)(function)
        )
    if not (use_cache and any((cache_root() / program.digest).rglob("*.nbi"))):
        _LOGGER.info("compiling the time integration, once per installation: up to half a minute")
    for name in entries:
        uncached = partial(compile_functions, program, cached=False) if use_cache else None
        compiled[name] = _Entry(compiled[name], program.argument_types(name), uncached)
    return compiled


class _Entry:
    """An entry whose cached code may be damaged or impossible to write: then it is compiled without a cache."""

    def __init__(
        self, entry: Any, types: tuple[Any, ...], uncached: Callable[[], Functions] | None = None,  # noqa: ANN401
    ) -> None:  # fmt: skip
        self._entry: Any = entry
        self._types, self._uncached, self._called = types, uncached, False

    def __call__(self, *arguments: object) -> Any:  # noqa: ANN401 - what the entry returns
        if not self._called:
            try:  # numba loads or compiles before it runs: a failure has changed nothing
                with _delay_signals():
                    self._entry.compile(self._types)
            except (OSError, EOFError, ValueError, pickle.UnpicklingError):
                if self._uncached is None:
                    raise
                self._entry = self._uncached()[self._entry.__name__]
            self._called = True
        return self._entry(*arguments)


@contextmanager
def _delay_signals() -> Generator[None]:
    """Handle Ctrl-C and SIGTERM after the context: numba's callbacks would lose or misreport the exception."""
    if threading.current_thread() is not threading.main_thread():  # other threads handle no signals
        yield
        return
    received: list[int] = []
    numbers = [number for number in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(number) is not None]
    handlers = {number: signal.signal(number, lambda number, _: received.append(number)) for number in numbers}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in received:
            signal.raise_signal(number)


def bind(
    functions: Sequence[FunctionType], overrides: Functions,
    wrap: Callable[[FunctionType], Callable[..., Any]] = lambda function: function,
) -> Functions:  # fmt: skip
    """Return the functions, each wrapped, some of the functions that they call replaced by others."""
    namespace = dict(overrides)
    for function in functions:
        if function.__name__ not in namespace:
            copy = FunctionType(function.__code__, {**function.__globals__, **namespace}, function.__name__)
            copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
            namespace[function.__name__] = wrap(copy)
    return namespace


def cache_root() -> Path:
    """Return the folder of the user under which compiled code is kept."""
    folder = os.environ.get("FLEXCAM_CACHE") or os.environ.get("XDG_CACHE_HOME")
    return (Path(folder) if folder else Path.home() / ".cache") / "flexcam"


@contextmanager
def _cache_folder(name: str) -> Generator[bool]:
    """Set numba's cache to a separate folder within the context; yield whether it is writable."""
    settings: Any = import_module("numba.core.config")
    previous = settings.CACHE_DIR
    try:
        folder = cache_root() / name
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=folder):
            settings.CACHE_DIR = str(folder)
    except (OSError, RuntimeError):
        yield False
        return
    try:
        yield True
    finally:
        settings.CACHE_DIR = previous
