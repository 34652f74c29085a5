# SPDX-License-Identifier: Apache-2.0
"""What real bags have besides good messages: each has a defined effect, and is counted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import MS, header, imu, make, number, vector, write
from hypothesis import given, settings
from hypothesis import strategies as st

from simclient import MapError
from simclient.bag import Bag, columns
from simclient.machine_build import build_config
from simclient.replay import replay, replay_foreign
from simclient.replay.foreign import ForeignRun
from simclient.replay.reproduce import Replay
from simclient.replay.tick_alignment import JUMP_NS, Oddities, screen
from simclient.run import open_run

START = 100 * 10**9
GYRO = "channels:\n  imu.gyro: {topic: /imu, field: angular_velocity}\n"

Runs = Callable[..., tuple[ForeignRun, Path]]


@pytest.fixture
def run(probe: Path, tmp_path: Path) -> Runs:
    """Runs the probe (100 Hz) on messages of /imu, or of several topics, and checks that its record replays."""
    numbers = iter(range(100))

    def of(messages: Any, chart: str = GYRO, library: Path = probe) -> tuple[ForeignRun, Path]:
        n = next(numbers)
        content = messages if isinstance(messages, dict) else {"/imu": messages}
        (tmp_path / "map.yaml").write_text(chart)
        bag = write(tmp_path / f"bag{n}", content, ordered=False)
        done = replay_foreign(bag, tmp_path / "map.yaml", library=str(library), output=tmp_path / f"out{n}")
        assert replay(tmp_path / f"out{n}", library=str(library)).identical
        return done, tmp_path / f"out{n}"

    return of


def stamped(stamps_ms: Sequence[float], logs_ms: Sequence[float] | None = None) -> list[tuple[int, Any]]:
    """Messages of /imu whose gyro tells their number; recorded at `logs_ms`, or every 10 ms."""
    logs = logs_ms if logs_ms is not None else [10 * i for i in range(len(stamps_ms))]
    stamps = [0 if ms is None else START + int(ms * MS) for ms in stamps_ms]
    return [(START + int(log * MS), imu(t, (i + 1, 0, 0))) for i, (t, log) in enumerate(zip(stamps, logs, strict=True))]


def seen(out: Path) -> list[int]:
    """The number of the message in force at each tick; 0 before the first."""
    return [int(x) for x in columns(out, "source.outputs.vec")[1][:, 0]]


def refused(done: ForeignRun, channel: str = "imu.gyro") -> dict[str, int]:
    return {reason: count for reason, (count, _) in done.fates[channel].refused.items()}


# ---- times ------------------------------------------------------------------------------------------------------------


def test_out_of_order_is_sorted_in_and_a_repeated_time_gives_the_later_message(run: Runs) -> None:
    done, out = run(stamped([0, 30, 10, 20, 20, 40]))
    assert seen(out) == [1, 3, 5, 2, 6]
    assert done.oddities["/imu"] == Oddities(repeated=1, late=3)
    assert done.fates["imu.gyro"].coverage.superseded == 1
    assert "/imu: 1 with the time of the message before, 3 out of order (sorted in)" in str(done)


def test_two_messages_in_a_tick(run: Runs) -> None:
    done, out = run(stamped([0, 11, 15, 19, 30]))
    assert seen(out) == [1, 1, 4, 5] and done.fates["imu.gyro"].coverage.superseded == 2
    assert done.oddities["/imu"] == Oddities()


def test_a_quaternion_of_length_zero_is_no_sample(run: Runs) -> None:
    """Here, as in a live node; the other values of its message are taken."""
    attitudes = [(1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), (math.inf, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0)]
    messages = [(START + i * 10 * MS, imu(START + i * 10 * MS, (i, 0, 0), q)) for i, q in enumerate(attitudes)]
    done, out = run(messages, GYRO + "  imu.attitude: {topic: /imu, field: orientation}\n")
    assert refused(done, "imu.attitude") == {"rotation": 2, "nan": 1} and refused(done) == {}
    assert done.fates["imu.attitude"].coverage.used == 1 and done.fates["imu.gyro"].coverage.used == 4
    assert columns(out, "source.outputs.quat")[1].tolist() == [[1.0, 0.0, 0.0, 0.0]] * 4
    assert "2 with a rotation of length zero or infinity (first: message 1)" in str(done)


@pytest.mark.parametrize(
    ("ahead_s", "told"),
    [
        (18, "/imu: stamps 18.000 s ahead of the times of recording, the offset of GPS and UTC (18 s)"),
        (-18, "/imu: stamps 18.000 s behind the times of recording, the offset of GPS and UTC (18 s)"),
        (37, "/imu: stamps 37.000 s ahead of the times of recording, the offset of TAI and UTC (37 s)"),
        (
            50,
            "/imu: stamps 50.000 s ahead of the times of recording; those of other topics are not: is it another clock?",
        ),
        (0.1, ""),
    ],
)
def test_stamps_of_another_clock(ahead_s: float, told: str, run: Runs) -> None:
    ahead_ns = int(ahead_s * 10**9)
    content = {
        "/imu": [(START + i * 20 * MS, imu(START + i * 20 * MS + ahead_ns)) for i in range(9)],
        "/other": [(START + i * 20 * MS, imu(START + i * 20 * MS)) for i in range(9)],
    }
    chart = GYRO + "  imu.attitude: {topic: /other, field: orientation}\n"
    done, _ = run(content, chart)
    lines = [line.strip() for line in str(done).splitlines() if "times of recording" in line]
    assert lines == ([told] if told else [])
    by_log, _ = run(content, "time: log\n" + chart)
    assert "times of recording" not in str(by_log)


def test_stamps_that_are_all_of_one_other_clock_are_as_good(run: Runs) -> None:
    """A bag of a simulation, recorded by the clock on the wall."""
    done, _ = run([(10**18 + i * 20 * MS, imu(START + i * 20 * MS)) for i in range(9)])
    assert "times of recording" not in str(done)


def test_stamps_of_zero_are_no_times(run: Runs) -> None:
    done, out = run(stamped([0, None, 20, None]))
    assert seen(out) == [1, 1, 3]
    assert refused(done) == {"unset": 2} and done.oddities["/imu"] == Oddities(unset=2)
    with pytest.raises(MapError, match="no message can be used: 2 with the stamp zero"):
        run(stamped([None, None]))
    # By the time of recording they are as good as any.
    done, out = run(stamped([0, None, 20, None]), "time: log\n" + GYRO)
    assert seen(out) == [1, 2, 3, 4] and not refused(done)


def test_a_clock_that_jumps_back_is_waited_for(run: Runs) -> None:
    """Messages behind the jump are refused until the clock has passed where it was."""
    back = [0, 10, 2000, 2010, 500, 1500, 2009, 2020, 2030]
    done, out = run(stamped(back))
    assert refused(done) == {"stuck": 3}
    assert done.oddities["/imu"] == Oddities(jumps_back=1, stuck=3, jumps_ahead=1)
    assert seen(out)[:3] == [1, 2, 2] and seen(out)[-5:] == [2, 3, 4, 8, 9]
    assert done.fates["imu.gyro"].coverage.largest_gap_ns == 1990 * MS
    text = str(done)
    assert "imu.gyro: refused: 3 after a backward jump of the clock (first: message 4)" in text
    assert (
        "/imu: 1 jumps back of more than 1 s, 3 until the clock had caught up, 1 jumps ahead of more than 1 s" in text
    )


def test_a_clock_that_jumps_ahead_is_told_from_silence(run: Runs) -> None:
    jump, _ = run(stamped([0, 10, 5000, 5010]))
    silence, _ = run(stamped([0, 10, 5000, 5010], [0, 10, 5000, 5010]))
    assert jump.oddities["/imu"] == Oddities(jumps_ahead=1) and silence.oddities["/imu"] == Oddities()
    for done in (jump, silence):
        fate = done.fates["imu.gyro"]
        assert fate.coverage.largest_gap_ns == 4990 * MS
        # Tick 1 has the sample before the gap, tick 500 the one behind it; the channel allows an age of 5 ticks.
        assert fate.invalid == 500 - (1 + 5 + 1)


@settings(max_examples=200)
@given(
    times=st.lists(st.integers(-3, 3).map(lambda s: s * JUMP_NS // 2), min_size=1, max_size=40), stamps=st.booleans()
)
def test_screening_agrees_with_a_walk(times: list[int], stamps: bool) -> None:
    times_ns = np.cumsum(np.array(times, np.int64)) + (0 if stamps else 5)
    usable, oddities = screen(times_ns, np.arange(len(times), dtype=np.int64), stamps)
    newest, last, stuck = None, None, False
    expected, counts = [], dict.fromkeys(vars(Oddities()), 0)
    for time in times_ns.tolist():
        if stamps and time == 0:
            counts["unset"] += 1
            expected.append(False)
            continue
        step = 0 if last is None else time - last
        counts["repeated"] += last is not None and step == 0
        counts["jumps_back"] += step < -JUMP_NS
        counts["jumps_ahead"] += stamps and step > JUMP_NS
        behind = 0 if newest is None else newest - time
        stuck = (stuck or behind > JUMP_NS) and behind >= 0
        counts["stuck"] += stuck
        counts["late"] += behind > 0 and not stuck
        expected.append(not stuck)
        newest, last = max(time, time if newest is None else newest), time
    assert usable.tolist() == expected
    assert oddities == Oddities(**counts)


# ---- values -----------------------------------------------------------------------------------------------------------


def test_a_nan_is_refused_and_infinity_is_a_value(run: Runs) -> None:
    messages = [
        (START + 10 * i * MS, imu(START + 10 * i * MS, (x, 0, 0))) for i, x in enumerate((1, math.nan, math.inf, 4))
    ]
    done, out = run(messages)
    assert refused(done) == {"nan": 1} and "imu.gyro: refused: 1 with a NaN (first: message 1)" in str(done)
    assert columns(out, "source.outputs.vec")[1][:, 0].tolist() == [1.0, 1.0, math.inf, 4.0]


def test_a_sequence_of_another_length_is_refused(run: Runs) -> None:
    def joints(i: int, count: int) -> tuple[int, Any]:
        names, time_ns = [f"j{k}" for k in range(count)], START + 10 * i * MS
        position = np.arange(count) + 10.0 * i
        return time_ns, make("sensor_msgs/msg/JointState", header=header(time_ns), name=names, position=position)

    bag = {"/joints": [joints(0, 3), joints(1, 2), joints(2, 4), joints(3, 0), joints(4, 3)]}
    done, out = run(bag, "channels:\n  imu.gyro: {topic: /joints, field: position}\n")
    assert refused(done) == {"shape": 3}
    assert columns(out, "source.outputs.vec")[1][:, 2].tolist() == [2.0] * 4 + [42.0]
    # An element, by number or by the joint's name, needs that one only.
    chart = "channels:\n  imu.gyro: {topic: /joints, field: ['position[1]', 'position[j2]', 'position[j0]']}\n"
    done, out = run(bag, chart)
    assert refused(done) == {"shape": 2}
    assert columns(out, "source.outputs.vec")[1][2].tolist() == [21.0, 22.0, 20.0]


@pytest.mark.parametrize(
    ("channel", "conversion", "values", "taken"),
    [
        ("level", "", (0.0, 1.0, -3.0, 2147483647.0, 2147483648.0, 0.5, math.inf), (0, 1, -3, 2147483647)),
        ("level", "scale: 1000, offset: 0.0", (0.001, 0.0015, -2e6), (1, -2000000000)),
        ("switch", "", (0.0, 1.0, 2.0, 0.5, -1.0), (0, 1)),
    ],
)
def test_integers_and_bools_are_checked(
    channel: str, conversion: str, values: Sequence[float], taken: Sequence[int], run: Runs
) -> None:
    messages = {"/level": [(START + 10 * i * MS, number(value)) for i, value in enumerate(values)]}
    keys = f", {conversion}" if conversion else ""
    done, out = run(messages, f"time: log\nchannels:\n  {channel}: {{topic: /level, field: data{keys}}}\n")
    assert refused(done, channel) == {"range": len(values) - len(taken)}
    _, found = columns(out, "source.outputs." + {"level": "small", "switch": "flag"}[channel])
    assert list(dict.fromkeys(int(x) for x in found)) == list(taken)


def test_bools_become_numbers_and_integers_bools(run: Runs) -> None:
    bag = {
        "/on": [(START + 10 * i * MS, make("std_msgs/msg/Bool", data=i % 2 == 1)) for i in range(4)],
        "/count": [(START + 10 * i * MS, make("std_msgs/msg/UInt8", data=i % 2)) for i in range(4)],
    }
    chart = (
        "time: log\nchannels:\n  level: {topic: /on, field: data, scale: 5}\n  switch: {topic: /count, field: data}\n"
    )
    _, out = run(bag, chart)
    assert columns(out, "source.outputs.small")[1].tolist() == [0, 5, 0, 5]
    assert columns(out, "source.outputs.flag")[1].tolist() == [False, True, False, True]


# ---- silence ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def compiled() -> Path:
    """The probe as the compiler makes it: it shows what its channels are like."""
    return build_config(Path(__file__).parent / "machines/probe.json")[0]


def watched(out: Path, library: Path, path: str) -> list[int]:
    """A field of the machine behind each tick, by replaying the record."""
    run = open_run(library, None)
    field = run.machine.fields[path]
    found: list[int] = []
    step = run.step

    def watch(ticks: int) -> None:
        for _ in range(ticks):
            step(1)
            found.append(int.from_bytes(run.read(field.offset, field.size), "little", signed=True))

    run.step = watch  # type: ignore[method-assign]
    bag = Bag(out)
    Replay(bag, bag.machine(), run).run()
    run.close()
    return found


@pytest.mark.parametrize("time", ["header", "log"])
def test_a_sample_keeps_its_stamp_and_ages_from_its_delivery(time: str, run: Runs, compiled: Path) -> None:
    messages = stamped([1, 21, 44], [5, 26, 45])
    done, out = run(messages, f"time: {time}\n{GYRO}", compiled)
    # On the grid that begins with the first message: header at 0, 20 and 43 ms; log at 0, 21 and 40 ms.
    behind = [1, 1, 2, 2, 2, 3] if time == "header" else [1, 1, 1, 2, 3]
    ages = [0, 1, 0, 1, 2, 0] if time == "header" else [0, 1, 2, 0, 0]
    stamps = [START + ms * MS for ms in (1, 21, 44)]
    assert seen(out) == behind
    assert watched(out, compiled, "channels.imu.gyro.age_ticks") == ages
    assert watched(out, compiled, "channels.imu.gyro.stamp_ns") == [stamps[i - 1] for i in behind]


@pytest.mark.parametrize(
    ("timeout_ms", "valid_for"),
    [
        (None, 6),  # max_age_ticks is 5: the sample's own tick and 5 more
        ("35", 4),  # t - stamp of 40 ms is more than 35 ms
        ("40", 5),  # 40 ms is not more than 40 ms
        ("39.999999", 4),
        ("0.5", 1),
        ("500", 6),  # the machine itself is stricter
    ],
)
def test_a_channel_without_samples_becomes_invalid(
    timeout_ms: str | None, valid_for: int, run: Runs, compiled: Path
) -> None:
    keys = f", timeout_ms: {timeout_ms}" if timeout_ms else ""
    chart = f"channels:\n  imu.gyro: {{topic: /imu, field: angular_velocity{keys}}}\n"
    done, out = run(stamped([0, 300, 310, 500]), chart, compiled)
    valid = [value == 1 for value in watched(out, compiled, "channels.imu.gyro.valid")]
    expected = [True] * valid_for + [False] * (30 - valid_for)
    expected += [True] + [True] * valid_for + [False] * (50 - 31 - valid_for) + [True]
    assert valid == expected
    assert done.fates["imu.gyro"].invalid == valid.count(False)
    # The value is held all the while.
    assert seen(out) == [1] * 30 + [2] + [3] * 19 + [4]


def test_a_timeout_needs_a_channel_that_can_be_too_old(tmp_path: Path) -> None:
    bag = write(tmp_path / "bag", {"/imu": stamped([0, 10])})
    chart = "channels:\n  reference.orientation: {topic: /imu, field: orientation, timeout_ms: 50}\n"
    (tmp_path / "map.yaml").write_text(chart)
    config = Path(__file__).parents[3] / "examples/ahrs/ahrs.json"
    with pytest.raises(MapError, match="give `reference.orientation` a `max_age_ticks`"):
        replay_foreign(bag, tmp_path / "map.yaml", config=str(config))


def test_vector_of_another_message(run: Runs) -> None:
    """A message of numbers in the middle of another."""
    bag = {
        "/twist": [(START + 10 * i * MS, make("geometry_msgs/msg/Twist", angular=vector(i, 2, 3))) for i in range(3)]
    }
    _, out = run(bag, "time: log\nchannels:\n  imu.gyro: {topic: /twist, field: angular}\n")
    assert columns(out, "source.outputs.vec")[1][:, 0].tolist() == [0.0, 1.0, 2.0]
