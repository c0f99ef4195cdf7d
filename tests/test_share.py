"""Data files are found in a checkout and in an installed package."""

import tomllib

import pytest

from dembench import share as module
from dembench.share import share


def test_the_published_numbers_are_there():
    assert tomllib.loads(share("data", "published", "common.toml").read_text())["doi"] == "10.1016/j.cpc.2023.109066"


def test_an_installed_package_has_its_own_copy(tmp_path, monkeypatch):
    own = tmp_path / "site-packages" / "dembench" / "share" / "data"
    own.mkdir(parents=True)
    (own / "x.toml").write_text("a = 1")
    monkeypatch.setattr(module, "_PACKAGE", tmp_path / "site-packages" / "dembench")
    assert share("data", "x.toml") == own / "x.toml"


def test_a_missing_file_is_named():
    with pytest.raises(FileNotFoundError, match=r"data/none\.toml"):
        share("data", "none.toml")
