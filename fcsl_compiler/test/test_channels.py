# SPDX-License-Identifier: Apache-2.0
"""Sensor channels, tick by tick: freshness, validity and age of samples."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine
from fcsl_test_tables import kind, machine

__all__ = ["kind"]  # runs all tests here on both kinds of machine


def channel_machine(
    tmp_path: Path, field: str = "source.outputs.value", every: int = 2, of_machine: Any = (), **channel: Any
) -> Machine:
    source = 'class Source:\n    inputs = {"raw": "f64"}\n    outputs = {"value": "f64"}\n    def execute(self): ...\n'
    config = {
        "instances": {"source": {"algorithm": "Source"}},
        "states": {"A": {"schedule": {"source": {"every": every}}}},
        "channels": [{"name": "x.y", "id": 7, "field": field, "direction": "sensor", **channel}],
        **dict(of_machine),
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
    m.sample("x.y")
    m.step(1001)
    assert m.get("channels.x.y.valid") is True and m.get("channels.x.y.age_ticks") == 1000


@pytest.mark.parametrize(
    ("own", "of_machine", "may_wait"),
    [
        ({"max_age_ticks": 2}, {}, 2),
        ({"max_age_ticks": 2, "start_grace_s": 0.005}, {}, 5),
        ({"max_age_ticks": 2}, {"start_grace_s": 0.004}, 4),
        ({"max_age_ticks": 2, "start_grace_s": 0}, {"start_grace_s": 0.004}, 0),
        ({"start_grace_s": 0.003}, {}, 3),
        ({}, {}, 9),
    ],
)
def test_a_channel_waits_for_its_first_sample(
    tmp_path: Path, own: dict[str, Any], of_machine: dict[str, Any], may_wait: int
) -> None:
    """It is never valid before it. Its instance is degraded as long as it may wait, then failed."""
    m = channel_machine(tmp_path, every=1, of_machine=of_machine, **own)
    columns = ["channels.x.y.valid", "channels.x.y.waiting", "source.outputs.health"]

    def step() -> list[Any]:
        m.step()
        return [m.get(c) for c in columns]

    assert step() == [True, True, "nominal"]  # nothing serves it
    m.byte(m.channels["x.y"].attached)[0] = 1
    for age in range(1, 10):
        assert step() == [False, True, "degraded" if age <= may_wait else "failed"], age
    saved = m.save()
    for _ in range(2):
        m.sample("x.y")
        assert step() == [True, False, "nominal"]
        after = [step() for _ in range(6)]  # then it grows old, and waits no more
        old = [False, False, "failed"] if "max_age_ticks" in own else [True, False, "nominal"]
        assert after[:2] == [[True, False, "nominal"]] * 2 and after[2:] == [old] * 4
        m.restore(saved)


def test_the_worst_channel_of_an_instance_counts(tmp_path: Path) -> None:
    source = 'class Source:\n    inputs = {"a": "f64", "b": "f64"}\n    def execute(self): ...\n'
    channels = [
        {"name": n, "id": i, "field": f"source.inputs.{n}", "direction": "sensor", "max_age_ticks": i}
        for i, n in enumerate(("a", "b"), 1)
    ]
    config = {"instances": {"source": {"algorithm": "Source"}}, "states": {"A": {"schedule": {"source": 1000}}}}
    m = machine(tmp_path, {**config, "channels": channels}, source=source)
    for name in ("a", "b"):
        m.byte(m.channels[name].attached)[0] = 1
    healths = []
    for sample in ("", "a", "", "", "b", "a"):
        if sample:
            m.sample(sample)
        m.step()
        healths.append(m.get("source.outputs.health"))
    # both wait, b waits, b waits no longer, and a is too old, b came, both
    assert healths == ["degraded", "degraded", "failed", "failed", "failed", "nominal"]
