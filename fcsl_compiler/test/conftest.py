# SPDX-License-Identifier: Apache-2.0
"""Every run compiles into a cache of its own, so that no earlier build can make a test pass."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("cache")
    before = os.environ.get("FCSL_CACHE_DIR")
    os.environ["FCSL_CACHE_DIR"] = str(folder)
    yield folder
    if before is None:
        del os.environ["FCSL_CACHE_DIR"]
    else:
        os.environ["FCSL_CACHE_DIR"] = before
