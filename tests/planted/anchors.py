"""Locate the code that a planted fault changes, by its symbol and its syntax tree.

`symbol` is the qualified name of a function, class, constant or import ("Scheme.step", "outer.inner"), in any file of
the package. `old` and `new` are both

- expressions, or
- headers of compound statements, written with the body "..." ("def f(x): ...", "for x in y: ..."), or
- statements; the new statement "pass" deletes the old ones.

`old` is compared as a syntax tree, so that layout and comments do not matter.
"""

from __future__ import annotations

import ast
import copy
import textwrap
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

PACKAGE = "flexcam"
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
NAMED = (*FUNCTIONS, ast.ClassDef)
COMPOUND = (*NAMED, ast.If, ast.For, ast.AsyncFor, ast.While, ast.With, ast.AsyncWith)
BLOCKS = ("body", "orelse", "finalbody")
MOST_CANDIDATES = 8

Fault = dict[str, str]


class AnchorError(ValueError):
    """Raised for a fault whose place is missing, ambiguous or not replaceable."""


@dataclass(frozen=True)
class Edit:
    """Replacement of the bytes `begin` to `end` of the file `path`, relative to the tree, by `new`."""

    path: str
    begin: int
    end: int
    new: str

    def replace_in(self, content: bytes) -> bytes:
        return content[: self.begin] + self.new.encode() + content[self.end :]

    def apply(self, tree: Path) -> None:
        path = tree / self.path
        path.write_bytes(self.replace_in(path.read_bytes()))


class Source:
    """A parsed Python file."""

    def __init__(self, tree: Path, path: Path) -> None:
        self.path = path.relative_to(tree).as_posix()
        self.content = path.read_bytes()
        self.tree = ast.parse(self.content)
        self.module = ".".join(path.relative_to(tree).with_suffix("").parts).removesuffix(".__init__")
        lengths = [len(line) for line in self.content.splitlines(keepends=True)]
        self._starts = [0, *accumulate(lengths)]

    def start(self, node: ast.AST) -> int:
        """Return the byte offset of the start of a node, without its decorators."""
        return self._starts[node.lineno - 1] + node.col_offset

    def begin(self, node: ast.AST) -> int:
        """Return the byte offset of the start of a node, with its decorators."""
        decorators = getattr(node, "decorator_list", [])
        return self.content.rindex(b"@", 0, self.start(decorators[0])) if decorators else self.start(node)

    def end(self, node: ast.AST) -> int:
        """Return the byte offset after a node."""
        return self._starts[node.end_lineno - 1] + node.end_col_offset

    def text(self, node: ast.AST) -> str:
        return self.content[self.begin(node) : self.end(node)].decode()

    def indent(self, node: ast.AST) -> str:
        """Return the indentation of a line that starts with the node."""
        return " " * node.col_offset


@dataclass(frozen=True)
class Definition:
    """A definition of a symbol; the definition of an assigned or imported name is the whole statement."""

    symbol: str
    source: Source
    node: ast.stmt

    def __str__(self) -> str:
        return f"{self.symbol} ({self.source.path}:{self.node.lineno})"


Finder = Callable[[Definition], Iterator[Edit]]
"""Yields the replacements of one fault in a definition."""


class Package:
    """All definitions of the package in a tree, by symbol."""

    def __init__(self, tree: Path) -> None:
        self.tree = tree
        self.symbols: dict[str, list[Definition]] = defaultdict(list)
        for path in sorted((tree / PACKAGE).rglob("*.py")):
            source = Source(tree, path)
            for symbol, node in _definitions(source.tree):
                self.symbols[symbol].append(Definition(symbol, source, node))

    def edit(self, fault: Fault) -> Edit:
        """Return the replacement that plants the fault."""
        edit = self._by_symbol(fault) if "symbol" in fault else self._by_text(fault)
        if edit.path.endswith(".py"):
            _check_syntax(fault, edit.replace_in((self.tree / edit.path).read_bytes()))
        return edit

    def _by_symbol(self, fault: Fault) -> Edit:
        find = finder(fault)
        suffix = "." + fault.get("module", PACKAGE)
        named = [
            one
            for one in self.symbols.get(fault["symbol"], [])
            if "module" not in fault or f".{one.source.module}".endswith(suffix)
        ]
        found = {edit: one for one in named for edit in find(one)}
        if len(found) == 1:
            return next(iter(found))
        raise AnchorError(self._describe_mismatch(fault, named, list(found.values()), find))

    def _by_text(self, fault: Fault) -> Edit:
        path = self.tree / fault["file"]
        content, old = path.read_bytes() if path.exists() else b"", fault["old"].encode()
        if content.count(old) != 1:
            message = f"{fault['name']}: {fault['old']!r} occurs {content.count(old)} times in {fault['file']}"
            raise AnchorError(message)
        begin = content.index(old)
        return Edit(fault["file"], begin, begin + len(old), fault["new"])

    def _describe_mismatch(self, fault: Fault, named: list[Definition], found: list[Definition], find: Finder) -> str:
        """Describe how often the anchor matches, and which definitions may be meant."""
        place = fault["symbol"] + (f" of {fault['module']}" if "module" in fault else "")
        text = f"{fault['name']}: {fault['old']!r} occurs {len(found)} times in {place}"
        if found:
            return f"{text}: {', '.join(map(str, found))}"
        text += f" (defined as {', '.join(map(str, named))})" if named else ", which is not defined"
        others = [str(one) for several in self.symbols.values() for one in several if any(find(one))]
        return f"{text}; it occurs in {', '.join(others[:MOST_CANDIDATES]) or 'no other definition'}"


def finder(fault: Fault) -> Finder:
    """Return the function that yields the replacements of `old` by `new` in a definition."""
    old, new = (textwrap.dedent(fault[key]).strip() for key in ("old", "new"))
    for read, replacements in ((_expression, _expressions), (_header, _headers), (_block, _blocks)):
        before, after = read(old), read(new)
        if before is not None and after is not None:
            if is_equal_tree(before, after):
                message = f"{fault['name']}: `new` says the same as `old`"
                raise AnchorError(message)
            return lambda one: replacements(one, before, new)
    message = f"{fault['name']}: `old` and `new` are not both expressions, headers or statements"
    raise AnchorError(message)


def is_equal_tree(one: object, other: object) -> bool:
    """Return whether two syntax trees are equal, independent of their positions."""
    if type(one) is not type(other):
        return False
    if isinstance(one, ast.AST):
        return all(is_equal_tree(value, getattr(other, field, None)) for field, value in ast.iter_fields(one))
    if isinstance(one, list):
        return len(one) == len(other) and all(map(is_equal_tree, one, other))
    return one == other


def _expression(text: str) -> ast.expr | None:
    try:
        return ast.parse(f"({text}\n)", mode="eval").body if text else None
    except SyntaxError:
        return None


def _block(text: str) -> list[ast.stmt] | None:
    try:
        return ast.parse(text).body or None
    except SyntaxError:
        return None


def _header(text: str) -> ast.stmt | None:
    """Return a compound statement without its body, if the text is one with the body "..."."""
    block = _block(text)
    if block is None or len(block) != 1 or not isinstance(block[0], COMPOUND):
        return None
    (node,) = block
    return _without_body(node) if text.endswith("...") and is_equal_tree(node.body, _block("...")) else None


def _without_body(node: ast.stmt) -> ast.stmt:
    node = copy.copy(node)
    for field in {*BLOCKS, "decorator_list"}.intersection(node._fields):
        setattr(node, field, [])
    return node


def _expressions(place: Definition, old: ast.expr, new: str) -> Iterator[Edit]:
    """Yield the replacements of an expression; parentheses group the new one."""
    source = place.source
    for node in ast.walk(place.node):
        if is_equal_tree(node, old) and is_equal_tree(
            _expression(source.text(node)), old
        ):  # positions inside f-strings may be wrong
            yield Edit(source.path, source.begin(node), source.end(node), f"({new})")


def _headers(place: Definition, old: ast.stmt, new: str) -> Iterator[Edit]:
    """Yield the replacements of everything before the body of a compound statement."""
    source = place.source
    for node in ast.walk(place.node):
        if isinstance(node, COMPOUND) and is_equal_tree(_without_body(node), old):
            header = textwrap.indent(new.removesuffix("...").rstrip(), source.indent(node)).lstrip()
            first = node.body[0]
            yield Edit(source.path, source.start(node), source.begin(first), f"{header}\n{source.indent(first)}")


def _blocks(place: Definition, old: list[ast.stmt], new: str) -> Iterator[Edit]:
    """Yield the replacements of consecutive statements."""
    source, count = place.source, len(old)
    for block in ([place.node], *_blocks_in(place.node)):
        for i in range(len(block) - count + 1):
            if is_equal_tree(block[i : i + count], old):
                text = textwrap.indent(new, source.indent(block[i])).lstrip()
                yield Edit(source.path, source.begin(block[i]), source.end(block[i + count - 1]), text)


def _blocks_in(node: ast.AST) -> Iterator[list[ast.stmt]]:
    return (
        getattr(one, field) for one in ast.walk(node) for field in BLOCKS if isinstance(getattr(one, field, None), list)
    )


def _check_syntax(fault: Fault, replace_in: bytes) -> None:
    """Raise an error for a replacement that is a syntax error."""
    try:
        compile(replace_in, fault["name"], "exec", dont_inherit=True)
    except SyntaxError as error:
        message = f"{fault['name']}: the file with the fault is not Python: {error}"
        raise AnchorError(message) from error


def _definitions(owner: ast.AST, prefix: str = "") -> Iterator[tuple[str, ast.stmt]]:
    """Yield the qualified name and the statement of every definition, except names assigned inside functions."""
    for node in _statements(owner):
        if isinstance(node, NAMED):
            yield f"{prefix}{node.name}", node
            yield from _definitions(node, f"{prefix}{node.name}.")
        elif not isinstance(owner, FUNCTIONS):
            yield from ((f"{prefix}{name}", node) for name in _bound_names(node))


def _statements(owner: ast.AST) -> Iterator[ast.stmt]:
    """Yield the statements of a definition, but not those of definitions inside it."""
    for node in ast.iter_child_nodes(owner):
        if isinstance(node, ast.stmt):
            yield node
        if isinstance(node, (ast.stmt, ast.excepthandler, ast.match_case)) and not isinstance(node, NAMED):
            yield from _statements(node)


def _bound_names(node: ast.stmt) -> Iterator[str]:
    """Yield the names that an assignment or import binds."""
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        yield from (alias.asname or alias.name.partition(".")[0] for alias in node.names)
    elif isinstance(node, (ast.Assign, ast.AnnAssign)):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = (one for target in targets for one in ast.walk(target) if isinstance(one, ast.Name))
        yield from (one.id for one in names if isinstance(one.ctx, ast.Store))
