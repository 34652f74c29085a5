# SPDX-License-Identifier: Apache-2.0
"""The switch of mutants in Python, as fcsl_mutants.c is in C; and a plugin of pytest (`-p fcsl_mutants`) that notes what each test reaches.

Mutated sources import it from wherever they run, so it imports nothing of this project.
"""

from __future__ import annotations

import json
import mmap
import os
import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

#: As fcsl_mutants.c.
SIZE = 65536
_REACHED = "FCSL_MUTANTS_REACHED"
_active = int(os.environ.get("FCSL_MUTANT", "0"))
_opened: dict[str, mmap.mmap] = {}


def _map() -> mmap.mmap | None:
    path = os.environ.get(_REACHED)
    if path is None:
        return None
    if path not in _opened:
        with open(path, "r+b") as file:
            _opened[path] = mmap.mmap(file.fileno(), SIZE)
    return _opened[path]


def mutant(number: int) -> bool:
    """Whether to execute this mutant. Notes that it was reached."""
    reached = _map()
    if reached is not None:
        reached[number] = 1
    return number == _active


# ---- the plugin: active where $FCSL_MUTANTS_REACHED names a file -----------------------------------------------------


def pytest_configure(config: Any) -> None:
    """Each worker of xdist, and what it starts, notes into a file of its own."""
    worker = getattr(config, "workerinput", {}).get("workerid")
    if worker is not None and _REACHED in os.environ:
        own = Path(f"{os.environ[_REACHED]}.{worker}")
        own.write_bytes(bytes(SIZE))
        os.environ[_REACHED] = str(own)


class _Now:
    """The test that runs."""

    failed = False


def pytest_runtest_logreport(report: Any) -> None:
    _Now.failed = _Now.failed or not report.passed  # a skipped test shows nothing either


def _protocol(item: Any) -> Generator[None, None, None]:
    reached = _map()
    if reached is None:
        yield
        return
    reached[:] = bytes(SIZE)
    _Now.failed = False
    begun = time.monotonic()
    yield
    fact = {
        "test": item.nodeid,
        "seconds": time.monotonic() - begun,
        "passed": not _Now.failed,
        "mutants": [number for number, byte in enumerate(reached[:]) if byte],
    }
    with open(f"{os.environ[_REACHED]}.tests", "a", encoding="utf-8") as file:
        file.write(json.dumps(fact) + "\n")


try:
    import pytest
except ImportError:  # a mutated program where no pytest is
    pass
else:

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(item: Any) -> Generator[None, Any, Any]:
        yield from _protocol(item)
        return True
