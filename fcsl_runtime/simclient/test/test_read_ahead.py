# SPDX-License-Identifier: Apache-2.0
"""simclient.bag.read_ahead: an iterator goes on in a thread while its items are used."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest

from simclient.bag.read_ahead import ahead


def readers() -> int:
    return sum(thread.name == "read ahead" for thread in threading.enumerate())


@pytest.mark.parametrize("count", [0, 1, 2, 1000])
def test_the_items_come_in_order(count: int) -> None:
    assert list(ahead(iter(range(count)), lambda item: 1)) == list(range(count))
    assert readers() == 0


def test_it_waits_once_enough_is_made() -> None:
    made = []

    def items() -> Iterator[int]:
        for item in range(100):
            made.append(item)
            yield item

    taken = ahead(items(), lambda item: 8 << 20)
    assert next(taken) == 0
    while len(made) < 3:
        time.sleep(0.001)
    time.sleep(0.05)
    assert made == [0, 1, 2]  # two of them are 16 MiB
    assert list(taken) == list(range(1, 100))


def test_a_failure_comes_behind_the_items_before_it() -> None:
    def items() -> Iterator[int]:
        yield from range(3)
        raise ValueError("damaged")

    taken = []
    with pytest.raises(ValueError, match="damaged"):
        for item in ahead(items(), lambda item: 1):
            taken.append(item)
    assert taken == [0, 1, 2] and readers() == 0


def test_the_thread_ends_with_the_one_who_takes() -> None:
    taken = ahead(iter(range(100)), lambda item: 8 << 20)
    assert next(taken) == 0 and readers() == 1
    taken.close()
    assert readers() == 0
