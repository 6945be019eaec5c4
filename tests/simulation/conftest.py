"""Kernels of the tests are kept in a folder of the test session."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="session")
def kernel_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path_factory.mktemp("kernels")))
        yield
