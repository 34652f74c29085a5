# SPDX-License-Identifier: Apache-2.0
"""Sensor channels, tick by tick: freshness, validity and age of samples."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine
from fcsl_test_tables import kind, machine

__all__ = ["kind"]  # runs all tests here on both kinds of machine


def channel_machine(tmp_path: Path, field: str = "source.outputs.value", **channel: Any) -> Machine:
    source = 'class Source:\n    inputs = {"raw": "f64"}\n    outputs = {"value": "f64"}\n    def execute(self): ...\n'
    config = {
        "instances": {"source": {"algorithm": "Source"}},
        "states": {"A": {"schedule": {"source": {"every": 2}}}},
        "channels": [{"name": "x.y", "id": 7, "field": field, "direction": "sensor", **channel}],
    }
    return machine(tmp_path, config, source=source)


def test_a_sample_may_be_old_already(tmp_path: Path) -> None:
    """A sample is taken with its age, is valid while the age is at most 2, and ages further."""
    m = channel_machine(tmp_path, max_age_ticks=2)
    columns = ["channels.x.y.valid", "channels.x.y.age_ticks", "channels.x.y.stamp_ns"]
    m.byte(m.channels["x.y"].attached)[0] = 1
    seen = []
    young, old = [(1, 500), None, None, (3, 700), (2, -1)], [(2**31 - 1, 800), None, (2**32 - 2, 900), None, None]
    for sample in (*young, *old, (0, 0)):
        if sample is not None:
            m.sample("x.y", *sample)
        m.step()
        seen.append([m.get(c) for c in columns])
    assert seen == [
        [True, 1, 500],
        [True, 2, 500],
        [False, 3, 500],
        [False, 3, 700],
        [True, 2, -1],
        [False, 2**31 - 1, 800],
        [False, 2**31, 800],
        [False, 2**32 - 2, 900],
        [False, 2**32 - 1, 900],
        [False, 2**32 - 1, 900],  # the age saturates
        [True, 0, 0],
    ]


def test_old_samples_without_a_limit_are_valid(tmp_path: Path) -> None:
    m = channel_machine(tmp_path)
    m.sample("x.y", 1_000_000, 1)
    m.step()
    assert (m.get("channels.x.y.valid"), m.get("channels.x.y.age_ticks")) == (True, 1_000_000)


@pytest.mark.parametrize("field", ["source.outputs.value", "source.inputs.raw"])
def test_channel_freshness(tmp_path: Path, field: str) -> None:
    """Valid while the age is at most 2 ticks. An invalid channel makes the instance failed on the ticks when it runs
    (even ones)."""
    m = channel_machine(tmp_path, field, max_age_ticks=2)
    ch = m.channels["x.y"]
    attached, fresh = m.byte(ch.attached), m.byte(ch.fresh)
    columns = ["channels.x.y.valid", "channels.x.y.age_ticks", "source.outputs.health"]
    m.step(4)
    assert [m.get(c) for c in columns] == [True, 0, "nominal"]  # not attached: no age is counted
    attached[0] = 1
    table = [
        (True, [True, 0, "nominal"]),  # tick 4
        (False, [True, 1, "nominal"]),
        (False, [True, 2, "nominal"]),
        (False, [False, 3, "nominal"]),  # tick 7: too old, but the instance does not run
        (False, [False, 4, "failed"]),  # tick 8
        (True, [True, 0, "failed"]),  # tick 9: a sample; the health is still of tick 8
        (False, [True, 1, "nominal"]),
    ]
    for sample, expected in table:
        fresh[0] = int(sample)
        m.step()
        assert fresh[0] == 0
        assert [m.get(c) for c in columns] == expected, f"tick {m.get('machine.tick') - 1}"


def test_a_channel_without_max_age_never_becomes_invalid(tmp_path: Path) -> None:
    m = channel_machine(tmp_path)
    m.byte(m.channels["x.y"].attached)[0] = 1
    m.step(1000)
    assert m.get("channels.x.y.valid") is True and m.get("channels.x.y.age_ticks") == 1000
