"""Compiled code is run only from files and folders that only their owner can write."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from inverse_service.kernels.machine_code import code_store


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path / "cache"))
    code_store.store_entry("digest", {"k": 1}, b"code")
    return tmp_path / "cache"


def test_what_was_written_is_read_and_the_folder_is_the_users_alone(folder: Path) -> None:
    assert code_store.read("digest") == ({"k": 1}, b"code")
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("mode", [0o770, 0o702, 0o777])
def test_a_folder_that_others_may_write_is_not_read(folder: Path, mode: int) -> None:
    folder.chmod(mode)
    assert code_store.read("digest") is None


def test_links_are_not_followed(folder: Path) -> None:
    entry = folder / "digest.kernel"
    entry.rename(folder / "other")
    entry.symlink_to(folder / "other")
    assert code_store.read("digest") is None
    entry.unlink()
    (folder / "other").rename(entry)
    folder.rename(folder.with_name("moved"))
    folder.symlink_to(folder.with_name("moved"))
    assert code_store.read("digest") is None


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
@pytest.mark.parametrize("given", ["folder", "file"])
def test_what_belongs_to_another_user_is_not_read(folder: Path, given: str) -> None:
    os.chown(folder if given == "folder" else folder / "digest.kernel", 65534, -1)
    assert code_store.read("digest") is None
