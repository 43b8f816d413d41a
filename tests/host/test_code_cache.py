"""Compiled code is kept for the next process, also where nobody said where."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from truing.model import code_cache


@pytest.fixture(autouse=True)
def _forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test finds the folder anew, on a system whose caches lie in XDG_CACHE_HOME."""
    monkeypatch.setattr(sys, "platform", "linux")
    code_cache._users_folder.cache_clear()


def test_it_goes_where_the_user_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "said"))
    assert code_cache.code_folder() == tmp_path / "said"


def test_it_goes_to_the_users_cache_otherwise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = code_cache.code_folder()
    assert folder == tmp_path / "truing"
    assert folder.is_dir()


def test_without_a_place_to_write_it_ends_with_the_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = tmp_path / "a_file"
    taken.write_text("")
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(taken))
    folder = code_cache.code_folder()
    assert not folder.is_relative_to(tmp_path / "a_file")
    assert os.access(folder, os.W_OK)


def test_a_mac_keeps_it_in_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    assert code_cache.code_folder() == tmp_path / "Library" / "Caches" / "truing"
