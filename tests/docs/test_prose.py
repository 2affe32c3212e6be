"""The prose linter detects all patterns of its rules, and long sentences, in pages and Python texts."""

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RULES = json.loads((ROOT / "docs/prose/rules.json").read_text())
BAD = [sentence for rule in RULES for sentence in rule["bad"]]
GOOD = [sentence for rule in RULES for sentence in rule["good"]]


def test_rules_match_bad_and_no_good_sentences(tmp_path):
    linters = sorted(Path(sys.prefix).glob("textlint-*/node_modules/.bin/textlint"))
    if not linters:
        pytest.skip("textlint is installed by `make prose`")
    pages = {"bad": BAD, "good": GOOD, "long": ["word " * 41 + "end."], "short": ["word " * 39 + "end. Two words."]}
    for name, sentences in pages.items():
        (tmp_path / f"{name}.md").write_text("\n\n".join(sentences))
    command = [linters[-1], "--rulesdir", ROOT / "docs/prose", "--format", "json", *sorted(tmp_path.glob("*.md"))]
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "PATH": path})
    found = {Path(page["filePath"]).stem: page["messages"] for page in json.loads(done.stdout)}
    assert done.returncode == 1
    assert {message["line"] for message in found["bad"]} == {2 * i + 1 for i in range(len(BAD))}
    assert found["good"] == []
    assert found["short"] == []
    assert [message["message"] for message in found["long"]] == ["42 words: make it two sentences"]


def test_python_texts_keep_line_numbers():
    text = runpy.run_path(str(ROOT / "docs/prose/python_text.py"))["python_as_markdown"]
    source = 'def f(n):\n    """Return nothing at all.\n\n    >>> f(1)\n    """\n    return f"give {n} or more values"'
    assert text(source).split("\n") == ["", "- Return nothing at all.", "", "", "", "- give `x` or more values"]
