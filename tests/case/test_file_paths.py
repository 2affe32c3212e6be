"""Files that a case names, where the case is read through a symbolic link."""

from pathlib import Path

import pytest

from flexcam import InputError, read_case
from flexcam.case.reader import CaseFile
from flexcam.studies.plan import make_bundle

ROOT = Path(__file__).parents[2]
TAYEB = ROOT / "cases/tayeb/model-1-shm.toml"


@pytest.fixture
def link(tmp_path):
    """Return a link to a case."""
    folder = tmp_path / "a/b/c"
    folder.mkdir(parents=True)
    (folder / "link.toml").symlink_to(TAYEB)
    return folder / "link.toml"


def test_a_mesh_is_found_beside_the_real_file(link):
    """A compiler would not find it, a shell script would; nobody wants to copy meshes to run a case from elsewhere."""
    assert len(read_case(link).mesh.nodes) == len(read_case(TAYEB).mesh.nodes)
    assert "../../meshes/tayeb-1.msh" in make_bundle(CaseFile.open(link)).files


def test_a_link_opens_no_further_folders(link, monkeypatch):
    """Neither from the link nor from the real file may a name climb further than two folders."""
    monkeypatch.setenv("FLEXCAM_FILES", "")
    with pytest.raises(InputError, match="two folders above"):
        read_case(link, ["mesh=../../../pyproject.toml"])
