"""Random changes of texts and bytes, reproducible by the state of the generator."""

from __future__ import annotations

# ruff: noqa: E501 - tables, a row to a line
import re
from collections.abc import Callable
from random import Random

NUMBERS = (
    "0", "-1", "-0.0", "1", "3.5", "1e308", "-1e308", "5e-324", "nan", "-inf", "inf", "9" * 30, "-" + "9" * 30,
    "2147483648", "1e-30", "1e30", "0x10", "1_0", "true", '"6 kg"', '"1e400 m"', '"6e3 mm"', '"-6 mm"', '"1 GPa"', '"nan mm"',
)  # fmt: skip
VALUES = (
    *NUMBERS, '""', "[]", "{}", "[[]]", "[{}]", "[1, 2, 3]", "[true, 0, 0]", '["a", "b", "c"]', "{ x = 1 }", "2024-05-01",
    "07:30:00", '"\\u0000"', '"ä & <b>"', '"\\U0001F600"', '"steel"', '"valve"', '"cam"', '"uy"', '"-rx"', '"tube"', '"hertz"',
    '{ at = "cam" }', '{ shape = "tube" }', '{ id = "polynomial", exponents = [3, 4, 5] }', '"../../../etc/passwd"',
    '"/etc/passwd"', '"no.toml"', '{ file = "/dev/zero" }', '"%s%n"', '"__import__(\'os\')"', "[" * 40 + "]" * 40,
)  # fmt: skip
WORDS = (
    "[[", "]]", "{", "}", "=", '"', "'''", "#", "\n", ",", ".", "\\", "\x00", "\ufeff", "\u202e", "𝟞", "[run]",
    "[members]", "[cams.intake]", "geometric_stiffness = true", "start = 'equilibrium'", "link = true",
)  # fmt: skip
TOKEN = re.compile(r'"[^"\n]*"|[-+]?\d[\d.eE+-]*|[A-Za-z_][\w-]*|[^\sA-Za-z0-9]')
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")


def _replace_token(text: str, random: Random) -> str:
    found = list(TOKEN.finditer(text))
    one = random.choice(found)
    other = random.choice((random.choice(found)[0], random.choice(VALUES), random.choice(WORDS)))
    return text[: one.start()] + other + text[one.end() :]


def _replace_number(text: str, random: Random) -> str:
    """Scale a number and keep its unit, as a typing error would."""
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    one = random.choice(found)
    scaled = f"{float(one[0]) * 10.0 ** random.randint(-12, 9):g}"
    return text[: one.start()] + random.choice((scaled, f"-{one[0]}", "0", random.choice(NUMBERS))) + text[one.end() :]


def _replace_value(text: str, random: Random) -> str:
    lines = text.split("\n")
    keyed = [i for i, line in enumerate(lines) if "=" in line]
    if not keyed:
        return text
    i = random.choice(keyed)
    lines[i] = lines[i].partition("=")[0] + "= " + random.choice(VALUES)
    return "\n".join(lines)


def _delete_line(text: str, random: Random) -> str:
    lines = text.split("\n")
    del lines[random.randrange(len(lines))]
    return "\n".join(lines)


def _repeat_line(text: str, random: Random) -> str:
    lines = text.split("\n")
    lines.insert(random.randrange(len(lines) + 1), random.choice(lines))
    return "\n".join(lines)


def _swap_lines(text: str, random: Random) -> str:
    lines = text.split("\n")
    i, j = random.randrange(len(lines)), random.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return "\n".join(lines)


def _swap_values(text: str, random: Random) -> str:
    lines = text.split("\n")
    keyed = [i for i, line in enumerate(lines) if "=" in line]
    if not keyed:
        return text
    i, j = random.choice(keyed), random.choice(keyed)
    lines[i] = lines[i].partition("=")[0] + "=" + lines[j].partition("=")[2]
    return "\n".join(lines)


def _cut(text: str, random: Random) -> str:
    a = random.randrange(len(text) + 1)
    return text[:a] + text[a + random.choice((1, 3, 20, len(text))) :]


def _insert(text: str, random: Random) -> str:
    a = random.randrange(len(text) + 1)
    return text[:a] + random.choice((*WORDS, *VALUES)) + text[a:]


def _swell(text: str, random: Random) -> str:
    """Insert a huge text, list, nested brackets or number of many digits."""
    a, many = random.randrange(len(text) + 1), random.choice((2_000, 50_000))
    huge = random.choice(
        ('"' + "x" * many + '"', "[" + "1," * many + "]", "[" * many, "9" * many, "a." * many, "\n" * many, "é" * many)
    )
    return text[:a] + huge + text[a:]


TEXT: tuple[Callable[[str, Random], str], ...] = (
    _replace_token, _replace_token, _replace_number, _replace_number, _replace_number, _replace_value, _replace_value, _delete_line,
    _repeat_line, _swap_lines, _swap_values, _cut, _insert,
)  # fmt: skip


def text(seed: str, random: Random) -> str:
    """Return a text with one to four changes, rarely with a huge insertion."""
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 4))):
        seed = random.choice(TEXT)(seed, random) if seed else seed
    return _swell(seed, random) if random.random() < 0.02 else seed


def raw(seed: bytes, random: Random) -> bytes:
    """Return bytes of which a few are flipped, cut, repeated or zeroed."""
    data = bytearray(seed)
    for _ in range(random.choice((1, 1, 1, 2, 4, 8))):
        a, length = random.randrange(len(data) + 1), random.choice((1, 4, 8, 64, 512))
        match random.randrange(8):
            case 0:
                del data[a:]
            case 1:
                del data[a : a + length]
            case 2:
                data[a:a] = data[: random.randrange(len(data) + 1)][:length]
            case 3:
                data[a : a + length] = bytes(len(data[a : a + length]))
            case 4:
                data[a : a + length] = random.randbytes(len(data[a : a + length]))
            case _ if a < len(data):
                data[a] ^= 1 << random.randrange(8)
            case _:
                pass
    return bytes(data)
