"""Fixtures for invalid cases: texts of valid cases, substitutions in them, and the reported faults."""

from pathlib import Path

import pytest

from flexcam import InputError, prepare, read_case

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="session")
def text():
    """Return the text of the inline case, which needs no mesh file."""
    return (DATA / "inline.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def mesh_case():
    """Return the text of the case of published model 1, with the full path of its mesh."""
    cases = Path(__file__).parents[2] / "cases/tayeb"
    return (
        (cases / "model-1-shm.toml")
        .read_text(encoding="utf-8")
        .replace("../../meshes", str(cases.parents[1] / "meshes"))
    )


@pytest.fixture(scope="session")
def substitute():
    """Return a function that replaces parts of a text; each old part must be in it."""

    def change(text, *pairs):
        for old, new in pairs:
            assert text.count(old) >= 1, f"{old!r} is not in the case"
            text = text.replace(old, new, 1)
        return text

    return change


@pytest.fixture
def faults_of(tmp_path):
    """Return a function that writes, reads and prepares a case text and returns its faults."""

    def find(text, overrides=()):
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as refusal:
            prepare(read_case(path, overrides))
        return refusal.value.faults

    return find
