"""Entry point of the command line: signals, errors and exit codes.

Results go to standard output, messages to standard error. Exit codes: 0 success, 2 invalid input, 3 failed run,
130 interrupted, 143 terminated, 70 internal error of flexcam.
"""

from __future__ import annotations

import errno
import logging
import os
import re
import signal
import sys
import tempfile
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import import_module
from inspect import cleandoc
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

from cyclopts import CycloptsError, Group

from flexcam import __version__
from flexcam.cli.app import COMMAND_FILES, COMMANDS, app, run_state
from flexcam.core.errors import Fault, InputError, suggest_name, system_message
from flexcam.core.units import set_unit_system
from flexcam.dynamics import Cause, RunFailedError, Status
from flexcam.report.terminal import print_json, print_message

DONE, REFUSED, FAILED, FAULT, INTERRUPTED, TERMINATED = 0, 2, 3, 70, 130, 143
# SIGHUP reports a closed terminal; Windows has none, and nohup ignores it.
_HANGUP = [sig for sig in signal.Signals if sig.name == "SIGHUP" and signal.getsignal(sig) is not signal.SIG_IGN]

_STREAM_FAULTS = (errno.ENOSPC, errno.EPIPE, errno.EIO)  # errors of a standard output that is full or has no reader
_INTERRUPTED = Status(Cause.INTERRUPTED, "stopped before it was finished; nothing is kept")
_OUT_OF_MEMORY = Status(
    Cause.OUT_OF_MEMORY, "the memory is exhausted",
    "free memory, or use fewer elements; a run needs less with a larger output.field_every, a study with fewer "
    "--workers",
)  # fmt: skip
# Words of a library that cannot be loaded for lack of memory
_NO_MEMORY = re.compile("failed to map segment|cannot allocate memory", re.IGNORECASE)
# Words that a command is suggested for
_SYNONYMS = {
    "campbell": ("orders", "waterfall"), "cam": ("lift", "profile"), "law": ("laws",),
    "compare": ("divergence", "parting"), "new": ("init", "template"), "view": ("show",),
}  # fmt: skip


def load_commands(words: Sequence[str]) -> None:
    """Import the file of the given command; for an unknown one or the help, all files, and sort them into panels."""
    run_state.command = words[0] if words else ""
    if run_state.command in COMMAND_FILES:
        import_module(f"flexcam.cli.{COMMAND_FILES[run_state.command]}")
        if "--help" in words or "-h" in words:  # the lines of a docstring are joined, to fit any terminal
            app[run_state.command].help = re.sub(r"(?<!\n)\n(?!\n)", " ", cleandoc(app[run_state.command].help))
        return
    for number, (title, commands) in enumerate(COMMANDS.items()):
        panel = Group(title, sort_key=number)
        for place, (command, file) in enumerate(commands.items()):
            import_module(f"flexcam.cli.{file}")
            app[command].group, app[command].sort_key = panel, place
            app[command].synonym = _SYNONYMS.get(command, ())
    options = Group("Options", sort_key=len(COMMANDS))
    for option in ("--help", "--version", "--install-completion"):
        app[option].group = options


def _print_status(status: Status, *, as_json: bool = False) -> int:
    if as_json:
        print_json({"status": str(status.cause), "message": status.text, "remedy": status.remedy})
    if status.ok:
        return DONE
    print_message(str(status))
    return _signal_code() if status.cause is Cause.INTERRUPTED else FAILED


def _print_faults(faults: Sequence[Fault], as_json: bool) -> int:
    if as_json:
        print_json({"status": "refused", "errors": [fault.as_dict() for fault in faults]})
    else:
        for fault in faults:
            print_message(str(fault))
    return REFUSED


def _report_crash(words: Sequence[str], as_json: bool) -> int:
    with tempfile.NamedTemporaryFile(
        "w", prefix="flexcam-crash-", suffix=".txt", delete=False, encoding="utf-8"
    ) as file:
        file.write(f"flexcam {__version__}\n{' '.join(words)}\n\n{traceback.format_exc()}")
    message = f"internal error of flexcam; please report it with {file.name}"
    if as_json:
        print_json({"status": "fault", "message": message, "crash_file": file.name})
    print_message(message)
    return FAULT


def _command_line_fault(words: Sequence[str], fault: CycloptsError) -> Fault:
    command = [word for word in words[:1] if word in COMMAND_FILES]
    choices: Sequence[str] = list(COMMAND_FILES)
    if command == ["synthesize"]:
        choices = "harmonic", "law", "polydyne"
        command += [word for word in words[1:2] if word in choices]
    why, remedy = str(fault), f"see {' '.join(['flexcam', *command])} --help"
    if why.startswith("Unknown command"):
        why = why.partition(" Available commands: ")[0]
        remedy = f"choose one of {', '.join(choices)}, or {remedy}"
    elif match := re.match(r'Command "[^"]+" parameter -+(\S+) requires an argument', why):
        option = f"--{match[1]}"
        why = f"{match[1].upper()} ({option}) is missing"
        if option in words:
            why, remedy = f"{option} needs a value", f"write a value that begins with - as {option}=VALUE, or {remedy}"
    elif match := re.match(r"(Unknown option: -+(\S+)\.) Did you mean -+(\S+)\?$", why):
        why = why if suggest_name(match[2], [match[3]]) else match[1]
    elif match := re.match(r"Unused Tokens: \[(.*)\]", why):
        why = f"no argument or option accepts {match[1]}"
    return Fault("command line", " ".join(words), "", why, remedy)


def _name_options(faults: Sequence[Fault], words: Sequence[str]) -> list[Fault]:
    """Return faults at the options that were typed, instead of at parameters of Python."""
    if not any(fault.where.isidentifier() for fault in faults):  # none names a parameter
        return list(faults)
    typed = {word.partition("=")[0] for word in words if word.startswith("--")}
    arguments = app.parse_commands(words)[1][-1].assemble_argument_collection()
    options = {argument.field_info.name: name for argument in arguments for name in argument.names if name in typed}
    options |= {name.removeprefix("--").replace("-", "_"): name for name in typed}
    return [replace(fault, where=options.get(fault.where, fault.where)) for fault in faults]


def _handle_signal(signum: int, frame: FrameType | None) -> None:
    """End a run at its next step; end other operations immediately."""
    del frame
    run_state.signals.append(signum)
    if not run_state.solving or len(run_state.signals) > 1:
        raise KeyboardInterrupt


def _signal_code() -> int:
    return INTERRUPTED if set(run_state.signals) <= {signal.SIGINT} else TERMINATED


def _word_faults(words: Sequence[str]) -> Iterator[Fault]:
    """Yield a fault for every empty value, which may mean the current folder, and for every word not in UTF-8."""
    for before, word in pairwise(["", *words]):
        if not word or (word.startswith("-") and word.endswith("=")):
            option = word.removesuffix("=") or (before if before.startswith("-") else "command line")
            why, remedy = "it is empty, perhaps from a shell variable that is not set", "give a value, or omit it"
            yield Fault(option, "nothing", "a value", why, remedy)
        if any("\ud800" <= letter <= "\udfff" for letter in word):
            why, remedy = "results and reports name their files", "rename the file or folder"
            yield Fault("command line", ascii(word), "words and file names in UTF-8", why, remedy)


def _dispatch(words: Sequence[str]) -> int:
    as_json = "--json" in words
    set_unit_system("metric")
    if faults := [*_word_faults(words)]:
        return _print_faults(faults, as_json)
    try:
        load_commands(words)
        status = app(words, exit_on_error=False, print_error=False, result_action="return_value")
        code = _print_status(status) if isinstance(status, Status) else DONE
    except CycloptsError as fault:
        code = _print_faults([_command_line_fault(words, fault)], as_json)
    except InputError as refusal:
        code = _print_faults(_name_options(refusal.faults, words), as_json)
    except RunFailedError as failure:
        code = _print_status(failure.status, as_json=as_json)
    except KeyboardInterrupt:
        code = _print_status(_INTERRUPTED, as_json=as_json)
    except SystemExit:  # raised by rich if the reader of a help text closed the pipe
        code = DONE
    except Exception as fault:
        if isinstance(fault, MemoryError) or _NO_MEMORY.search(str(fault)):
            code = _print_status(_OUT_OF_MEMORY, as_json=as_json)
        elif isinstance(fault, OSError) and fault.filename is not None:
            what = Fault("file", str(fault.filename), "a file or folder that can be used", system_message(fault), "")
            code = _print_faults([what], as_json)
        elif isinstance(fault, BrokenPipeError) or (isinstance(fault, OSError) and fault.errno in _STREAM_FAULTS):
            raise
        else:
            code = _report_crash(words, as_json)
    # A signal that arrived inside a finalizer was ignored there; it still counts.
    return _signal_code() if run_state.signals and code == DONE else code


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its exit code."""
    for number in (signal.SIGINT, signal.SIGTERM, *_HANGUP):
        signal.signal(number, _handle_signal)
    for name in ("stdout", "stderr"):  # of a process started without them, for example by a daemon
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 - for the life of the process
    if sys.stderr.isatty():
        logging.basicConfig(format="%(message)s")
        logging.getLogger("flexcam").setLevel(logging.INFO)
    stream: Any = sys.stdout
    if hasattr(stream, "reconfigure"):
        stream.reconfigure(errors="backslashreplace")  # a terminal without the letters of a title
    try:
        code = _dispatch(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()
    except BrokenPipeError:  # the reader closed the pipe
        code = DONE
        _discard(sys.stdout)
    except OSError as fault:
        print_message(f"output could not be written: {fault.strerror}; free space")
        code = FAILED
        _discard(sys.stdout)
    try:
        sys.stderr.flush()
    except OSError:  # the exit code remains
        _discard(sys.stderr)
    raise SystemExit(code)


def _discard(stream: TextIO) -> None:
    """Redirect a standard stream to null: Python would report an error again when closing it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
