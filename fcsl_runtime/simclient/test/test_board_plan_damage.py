# SPDX-License-Identifier: Apache-2.0
"""A plan of a board that is damaged is refused, whatever has become of it: a digit more in a filter is another filter."""

from __future__ import annotations

from pathlib import Path

import pytest
from hal_rig import write_plan

from simclient.board.plan import read_plan
from simclient.errors import TwinError


def test_every_flipped_bit_and_every_cut_is_found(tmp_path: Path) -> None:
    plan = write_plan(tmp_path)
    good = plan.read_bytes()
    sensors = len(read_plan(plan).sensors)
    damaged = [good[:i] + bytes([good[i] ^ 1 << i % 7]) + good[i + 1 :] for i in range(len(good))]
    damaged += [good[:i] for i in range(0, len(good), 7)]
    for data in damaged:
        plan.write_bytes(data)
        with pytest.raises(TwinError):
            read_plan(plan)
    plan.write_bytes(good.replace(b"machine craft", b"machine draft"))
    with pytest.raises(TwinError, match="the plan is damaged, or edited: write it with `fcsl board board.json`"):
        read_plan(plan)
    # One that is written by hand has no checksum.
    plan.write_bytes(good[: good.rindex(b"end")] + b"end\n")
    assert len(read_plan(plan).sensors) == sensors
