"""Default stiffness of a lash: ten times EA/L of the softest member that ends there."""

import re
from pathlib import Path

import numpy as np
import pytest

from flexcam import InputError, build_model, read_case

CASES = Path(__file__).parents[2] / "cases"
ENGINE, BUCKET = CASES / "pushrod-engine" / "intake.toml", CASES / "direct-acting" / "bucket.toml"
TUBE = 207e9 * np.pi * (8e-3**2 - 5e-3**2) / 4.0 / 0.25
STEM = 207e9 * np.pi * 6e-3**2 / 4.0 / 0.1


def _read_without_stiffness(path, tmp_path, *others):
    text = path.read_text(encoding="utf-8")
    open_lash = re.sub(r'(?m)^(lash = .*?), stiffness = "[^"]*"', r"\1", text)
    assert open_lash != text
    for old, new in others:
        open_lash = open_lash.replace(old, new)
    path_without = tmp_path / "left.toml"
    path_without.write_text(open_lash, encoding="utf-8")
    return read_case(path_without)


def test_default_lash_stiffness_at_rocker(tmp_path):
    case = _read_without_stiffness(ENGINE, tmp_path)
    assert build_model(case).contacts["lash"].stiffness == pytest.approx(10.0 * TUBE / 1.6**2, rel=1e-9)


def test_default_lash_stiffness_between_nodes(tmp_path):
    case = _read_without_stiffness(BUCKET, tmp_path)
    assert build_model(case).contacts["lash"].stiffness == pytest.approx(10.0 * STEM, rel=1e-9)


def test_lash_without_member_requires_stiffness(tmp_path):
    weight = ("[materials.steel]", '[masses.loose]\nat = "loose"\nmass = "1 g"\n[materials.steel]')
    nodes = ("[nodes]", '[nodes]\nloose = ["0 mm", "9 mm", "0 mm"]\nother = ["0 mm", "5 mm", "0 mm"]')
    between = ('from = "bucket-pip", to = "stem-top"', 'from = "loose", to = "other"')
    case = _read_without_stiffness(BUCKET, tmp_path, between, weight, nodes)
    with pytest.raises(InputError, match=r"contacts\.lash.*stiffness.*missing.*No member ends"):
        build_model(case)
