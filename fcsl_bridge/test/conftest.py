# SPDX-License-Identifier: Apache-2.0
"""A ROS 2 domain per test, on the loopback interface alone; in-process reference flights."""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import pytest

from fcsl_bridge.loopback import loopback_environment
from fcsl_compiler.base.packages import PackageNotFound, package_share

os.environ.update(loopback_environment(os.environ))
try:
    for example in ("ahrs", "lander"):
        package_share(example)
except PackageNotFound:
    raise pytest.UsageError(
        "the tests of fcsl_bridge fly the examples ahrs and lander: build these packages too"
    ) from None

from bridge_harness import SIM, Domain  # noqa: E402

from fcsl_bridge.domain import own_domain  # noqa: E402

_numbers = itertools.count(os.getpid())


@pytest.fixture
def domain(tmp_path: Path) -> Iterator[Domain]:
    with own_domain(next(_numbers)) as number:
        opened = Domain(number, tmp_path)
        yield opened
        opened.close()


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int, str], Path]:
    """The bag of an in-process flight with this seed and duration in seconds."""
    from fcsl_sim.config import load
    from fcsl_sim.runner import run

    @functools.cache
    def fly(seed: int, duration: str) -> Path:
        bag = tmp_path_factory.mktemp("reference") / "bag"
        run(load(SIM, seed=seed, duration_s=Fraction(duration)), bag=bag)
        return bag

    return fly
