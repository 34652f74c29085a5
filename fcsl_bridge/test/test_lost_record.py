# SPDX-License-Identifier: Apache-2.0
"""A free-running machine continues without its record if it cannot be written, and reports this once."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from fcsl_bridge.loops.configured_machine import ConfiguredMachine
from simclient.errors import TwinError

FAILED = TwinError("the disk is full")


def configured(said: list[str], failure: TwinError | None) -> Any:
    def answer() -> None:
        if failure is not None:
            raise failure

    made: Any = object.__new__(ConfiguredMachine)
    made.run, made.bag, made._recording = SimpleNamespace(record_stop=answer, record_check=answer), Path("bag"), True
    made._node = SimpleNamespace(get_logger=lambda: SimpleNamespace(error=said.append))
    return made


def test_a_record_that_fails_is_given_up() -> None:
    said: list[str] = []
    one = configured(said, FAILED)
    one.check_record()
    one.check_record()  # there is no record any more
    assert one.bag is None and said == ["the disk is full; flying on without a record"]


def test_one_that_is_written_is_kept() -> None:
    said: list[str] = []
    one = configured(said, None)
    one.check_record()
    assert one.bag == Path("bag") and one._recording and not said
