"""Paths in a case that is read through a symbolic link."""

from pathlib import Path

import pytest

from flexcam import InputError, read_case
from flexcam.case.reader import CaseFile
from flexcam.studies.plan import make_bundle

ROOT = Path(__file__).parents[2]
TAYEB = ROOT / "cases/tayeb/model-1-shm.toml"


@pytest.fixture
def link(tmp_path):
    """Return a symbolic link to a case."""
    folder = tmp_path / "a/b/c"
    folder.mkdir(parents=True)
    (folder / "link.toml").symlink_to(TAYEB)
    return folder / "link.toml"


def test_mesh_path_is_relative_to_link_target(link):
    """A case can be run from another folder without a copy of its mesh."""
    assert len(read_case(link).mesh.nodes) == len(read_case(TAYEB).mesh.nodes)
    assert "../../meshes/tayeb-1.msh" in make_bundle(CaseFile.open(link)).files


def test_link_allows_no_further_parent_folders(link, monkeypatch):
    """A path may go up two folders at most, from the link and from its target."""
    monkeypatch.setenv("FLEXCAM_FILES", "")
    with pytest.raises(InputError, match="two folders above"):
        read_case(link, ["mesh=../../../pyproject.toml"])
