# SPDX-License-Identifier: Apache-2.0
"""Every test run uses a separate, empty build cache, so that an earlier build cannot make a test pass."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("fcsl", "generated programs (test_generated.py)")
    group.addoption("--programs", type=int, default=50, help="how many programs and machines (default 50)")
    group.addoption("--program-seed", type=int, default=1, help="which ones: a failure names its seed (default 1)")
    fuzz = parser.getgroup("fcsl-fuzz", "broken input (test_fuzz.py)")
    fuzz.addoption("--fuzz", type=int, default=80, help="how many inputs of each kind (default 80)")
    fuzz.addoption("--fuzz-seed", type=int, default=1, help="which ones: a failure names its seed (default 1)")


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
