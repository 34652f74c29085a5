# SPDX-License-Identifier: Apache-2.0
"""A step of a free-running machine that fails: only a record that cannot be written is given up for the flight."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fcsl_bridge.hosted import Hosted
from simclient.errors import TwinError

FAILED = TwinError("the step failed")


def hosted(recording: bool, said: list[str], closing: TwinError | None) -> Any:
    def record_stop() -> None:
        if closing is not None:
            raise closing

    made: Any = object.__new__(Hosted)
    made.run, made.bag, made._recording = SimpleNamespace(record_stop=record_stop), Path("bag"), recording
    made._node = SimpleNamespace(get_logger=lambda: SimpleNamespace(error=said.append))
    return made


def test_a_record_that_fails_is_given_up() -> None:
    said: list[str] = []
    one = hosted(True, said, FAILED)
    one.lose_record(FAILED)
    assert one.bag is None and said == ["the step failed; flying on without a record"]
    with pytest.raises(TwinError, match="the step failed"):
        one.lose_record(FAILED)  # there is none to lose any more


@pytest.mark.parametrize("recording", [True, False])
def test_another_failure_is_none_of_the_record(recording: bool) -> None:
    said: list[str] = []
    one = hosted(recording, said, None)
    with pytest.raises(TwinError, match="the step failed"):
        one.lose_record(FAILED)
    assert one.bag == Path("bag") and not said
