# SPDX-License-Identifier: Apache-2.0
"""Bags of others: the tick grid, the map file, and what a machine makes of them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import MS, header, imu, make, number, write, write_mcap
from hypothesis import given, settings
from hypothesis import strategies as st

from simclient import MapError
from simclient.bag import Bag, columns
from simclient.bag.digest import digest
from simclient.cli import Progress
from simclient.replay import replay, replay_foreign
from simclient.replay.mapping import read_map
from simclient.replay.tick_alignment import align, first_tick_at, first_ticks_at, nearest_ticks, tick_count

START = 100 * 10**9

# ---- the grid ---------------------------------------------------------------------------------------------------------


def tick_ns(k: int, first_ns: int, hz: int) -> int:
    return first_ns + k * 1_000_000_000 // hz


@given(
    first=st.integers(0, 10**18),
    span=st.integers(0, 10**9),
    hz=st.sampled_from([1, 3, 7, 50, 60, 100, 333, 1000, 44100, 10**9]),
)
def test_grid_arithmetic_is_exact(first: int, span: int, hz: int) -> None:
    tick = first_tick_at(first + span, first, hz)
    assert tick_count(first, first + span, hz) == tick + 1
    assert tick_ns(tick, first, hz) >= first + span and (tick == 0 or tick_ns(tick - 1, first, hz) < first + span)
    times = np.array([first + span, first - 1], np.int64)
    assert first_ticks_at(times, first, hz).tolist() == [tick, 0]
    distances = {k: abs(tick_ns(k, first, hz) - first - span) for k in range(max(0, tick - 2), tick + 2)}
    assert nearest_ticks(times[:1], first, hz).tolist() == [min(distances, key=lambda k: (distances[k], k))]


@settings(max_examples=300)
@given(
    stamps=st.lists(st.tuples(st.integers(0, 200), st.sampled_from("ab")), min_size=1, max_size=30),
    hz=st.sampled_from([3, 7, 60, 1000]),
    first=st.integers(0, 50),
)
def test_placing_agrees_with_a_naive_search(stamps: list[tuple[int, str]], hz: int, first: int) -> None:
    samples = sorted((topic, i, time * 7 * MS) for i, (time, topic) in enumerate(stamps))
    times = [time for _, _, time in samples]
    first_ns = min(times) + first * MS
    ticks = tick_count(first_ns, max(times), hz)
    due, chosen, coverage = align(np.array(times, np.int64), first_ns, ticks, hz)

    naive: dict[int, int] = {}
    in_force, held, waiting = None, 0, 0
    for k in range(ticks):
        older = [i for i, time in enumerate(times) if time <= tick_ns(k, first_ns, hz)]
        newest = max(older, key=lambda i: (times[i], i), default=None)
        if newest is None:
            waiting += 1
        elif newest == in_force:
            held += 1
        else:
            naive[k] = in_force = newest
    assert dict(zip(due.tolist(), chosen.tolist(), strict=True)) == naive
    times.sort()
    assert coverage.used == len(naive) and coverage.superseded == len(samples) - len(naive)
    assert (coverage.held, coverage.waiting) == (held, waiting)
    assert coverage.largest_gap_ns == max((b - a for a, b in zip(times, times[1:], strict=False)), default=0)


# ---- bags and maps ----------------------------------------------------------------------------------------------------


def joints(time_ns: int, position: list[float]) -> Any:
    names = ["left", "middle", "right", "tail"][: len(position)]
    return make("sensor_msgs/msg/JointState", header=header(time_ns), name=names, position=np.array(position))


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """/imu every 20 ms with stamps 5 ms before their log time, /level every 50 ms, /joints once."""
    content = {
        "/imu": [(START + (20 * i + 5) * MS, imu(START + 20 * i * MS, (i, 2.0 * i, -1.0))) for i in range(6)],
        "/level": [(START + 50 * i * MS, number(i)) for i in range(3)],
        "/joints": [(START, joints(START, [1.0, 2.0, 3.0]))],
        "/text": [(START, make("std_msgs/msg/String", data="hello"))],
    }
    return write(tmp_path / "foreign", content)


MAP = """\
time: header
channels:
  imu.gyro: {topic: /imu, field: angular_velocity, scale: [1, 0.5, 1e0], offset: 1e3}
  imu.attitude:
    topic: /imu
    field: orientation
    quaternion: xyzw
"""


@pytest.fixture
def write_map(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        (tmp_path / "map.yaml").write_text(text)
        return tmp_path / "map.yaml"

    return write


def command(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(["fcsl", "replay", *map(str, arguments)], capture_output=True, text=True)
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_a_mapped_bag_becomes_one_of_ours(
    foreign: Path, probe: Path, write_map: Callable[[str], Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = command(foreign, "--library", probe, "--map", write_map(MAP), "-o", out)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (
        "11 ticks (0.110 s at 100 Hz) from t0 = 100.000000000 s, header stamps\n"
        "  channel       messages  used  superseded  refused  held ticks  waiting ticks  invalid ticks  largest gap\n"
        "  imu.gyro             6     6           0        0           5              0              0    20.000 ms\n"
        "  imu.attitude         6     6           0        0           5              0              0    20.000 ms\n"
        "  not mapped: level, switch; without samples, these instances are failed: source\n"
        f"  digest {digest(out)}\n"
    )
    _, gyro = columns(out, "source.outputs.vec")
    expected = [[1000.0 + k // 2, 1000.0 + k // 2, 999.0] for k in range(11)]
    assert gyro.tolist() == expected
    _, attitude = columns(out, "source.outputs.quat")
    assert attitude.tolist() == [[0.9, 0.1, 0.2, 0.3]] * 11
    assert replay(out, library=str(probe)).identical
    assert sorted(p.name for p in tmp_path.iterdir()) == ["foreign", "map.yaml", "out"]
    again = command(foreign, "--library", probe, "--map", tmp_path / "map.yaml", "-o", out)
    assert again.returncode == 2 and "exists already" in again.stderr
    missing = command(tmp_path / "none", "--library", probe, "--map", tmp_path / "none.yaml", "-o", out)
    assert missing.returncode == 2 and "exists already" in missing.stderr  # told before any work


def test_log_time_several_fields_indices_and_conversions(
    foreign: Path, probe: Path, write_map: Callable[[str], Path], tmp_path: Path
) -> None:
    chart = write_map(
        "time: log\n"
        "channels:\n"
        "  imu.gyro: {topic: /imu, field: [angular_velocity.z, 'orientation_covariance[4]', linear_acceleration.z]}\n"
        "  level: {topic: /level, field: data, scale: 10}\n"
        "  switch: {topic: /level, field: data, scale: 0, offset: 1}\n"
    )
    done = replay_foreign(foreign, chart, library=str(probe), output=tmp_path / "out", name_space="car")
    # From the first message of /level at 100.000 s to the tick that sees the last of /imu, at 100.105 s.
    coverage = done.fates["imu.gyro"].coverage
    assert done.grid.ticks == 12 and coverage.waiting == 1 and coverage.superseded == 0
    _, vec = columns(tmp_path / "out", "source.outputs.vec")
    assert vec.tolist() == [[0.0, 0.0, 0.0]] + [[-1.0, 4.0, 9.81]] * 11
    _, small = columns(tmp_path / "out", "source.outputs.small")
    assert small.tolist() == [0] * 5 + [10] * 5 + [20] * 2
    _, flag = columns(tmp_path / "out", "source.outputs.flag")
    assert flag.tolist() == [True] * 12


def test_two_topics_may_feed_one_channel(
    foreign: Path, probe: Path, write_map: Callable[[str], Path], tmp_path: Path
) -> None:
    chart = write_map(
        "channels:\n  imu.gyro:\n"
        "    - {topic: /joints, field: position}\n"
        "    - {topic: /imu, field: angular_velocity}\n"
    )
    done = replay_foreign(foreign, chart, library=str(probe), output=tmp_path / "out")
    # At the same time stamp the topic later in the alphabet is the newer one.
    assert done.fates["imu.gyro"].messages == 7 and done.fates["imu.gyro"].coverage.superseded == 1
    _, vec = columns(tmp_path / "out", "source.outputs.vec")
    assert vec[0].tolist() == [1.0, 2.0, 3.0] and vec[2].tolist() == [1.0, 2.0, -1.0]


TURNS = {
    "roll_90": [1.0, -3.0, 2.0],
    "roll_180": [1.0, -2.0, -3.0],
    "yaw_90": [-2.0, 1.0, 3.0],
    "roll_90_yaw_90": [3.0, 1.0, 2.0],
    "[[0, 0, 1], [1, 0, 0], [0, 1, 0]]": [3.0, 1.0, 2.0],
}


@pytest.mark.parametrize(("rotation", "vector"), TURNS.items())
def test_a_sensor_that_is_mounted_turned(
    rotation: str, vector: list[float], probe: Path, write_map: Callable[[str], Path], tmp_path: Path
) -> None:
    """Its vectors come in the body's axes, and its orientation is the body's: both name the same direction in the world."""
    attitude = np.array([0.9, 0.1, 0.2, 0.3]) / np.linalg.norm([0.9, 0.1, 0.2, 0.3])
    bag = write(tmp_path / "bag", {"/imu": [(10**11, imu(10**11, (1, 2, 3), attitude))]})
    chart = write_map(
        "channels:\n"
        f"  imu.gyro: {{topic: /imu, field: angular_velocity, rotation: {rotation}}}\n"
        f"  imu.attitude: {{topic: /imu, field: orientation, rotation: {rotation}}}\n"
    )
    replay_foreign(bag, chart, library=str(probe), output=tmp_path / "out")
    assert columns(tmp_path / "out", "source.outputs.vec")[1].tolist() == [vector]
    body = columns(tmp_path / "out", "source.outputs.quat")[1][0]
    assert np.linalg.norm(body) == pytest.approx(1.0, abs=1e-12)
    assert rotated(body, vector) == pytest.approx(rotated(attitude, [1.0, 2.0, 3.0]), abs=1e-12)


def rotated(q: np.ndarray[Any, Any], v: Sequence[float]) -> Any:
    """q v q*, scalar first."""
    return np.asarray(v) + 2 * np.cross(q[1:], np.cross(q[1:], v) + q[0] * np.asarray(v))


REFUSALS = [
    (
        "channels:\n  imu.gyro: {topic: /imu, field: angular_velocity, rotation: rol_90}",
        "map.yaml:2:62: no rotation `rol_90`; did you mean `roll_90`?; angles are multiples of 45",
    ),
    (
        "channels:\n  imu.gyro: {topic: /imu, field: angular_velocity, rotation: [1, 2, 3]}",
        "map.yaml:2:62: `rotation` must be a name, such as roll_180_yaw_90, or a matrix",
    ),
    (
        "channels:\n  imu.gyro: {topic: /imu, field: angular_velocity, rotation: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}",
        "map.yaml:2:62: the matrix is no rotation: its determinant is -1",
    ),
    (
        "channels:\n  level: {topic: /level, field: data, rotation: roll_90}",
        "map.yaml:2:10: `level`: a `rotation` of numbers: they have no axes",
    ),
    ("", "map.yaml: empty; a map has `channels`"),
    ("channels: [", "map.yaml:1:12: expected the node content, but found '<stream end>'"),
    ("channels:\n\t- x", "map.yaml:2:1: found character '\\t' that cannot start any token"),
    ("time: header", "map.yaml:1:1: `channels` is missing"),
    ("channels: {}", "map.yaml:1:11: `channels` maps nothing"),
    ("channels: 3", "map.yaml:1:11: `channels` must be a mapping"),
    ("chanels: {}", "map.yaml:1:1: unknown key `chanels`; did you mean `channels`?"),
    ("time: heeder\nchannels: {}", "map.yaml:1:7: `time` is `heeder`; did you mean `header`?; one of header, log"),
    ("channels:\n  level: {topic: /level}", "map.yaml:2:10: channel `level`: `field` is missing"),
    ("channels:\n  level: {topic: /level, feeld: data}", "2:26: unknown key `feeld`; did you mean `field`?"),
    ("channels:\n  level: {topic: /level, field: data, scale: two}", "2:46: `scale` must be a number"),
    ("channels:\n  level: {topic: /level, field: data, scale: .nan}", "`scale` must be a number"),
    ("channels:\n  level: {topic: /level, field: data, scale: nan}", "`scale` must be finite"),
    ("channels:\n  level: {topic: /level, field: data}\n  level: {}", "map.yaml:3:3: `level` is given twice"),
    ("time: log\nchannels:\n  levl: {topic: /level, field: data}", "3:9: machine `probe` has no sensor channel `levl`"),
    (
        "time: log\nchannels:\n  level: {topic: /levl, field: data}",
        "no topic `/levl`; did you mean `/level`?; it holds:",
    ),
    (
        "time: log\nchannels:\n  level: {topic: /level, field: date}",
        "`std_msgs/Float64` has no field `date`; did you mean `data`?",
    ),
    ("channels:\n  imu.gyro: {topic: /imu, field: orientation, quaternion: xyzw}", "has 4 numbers, not 3"),
    ("channels:\n  imu.attitude: {topic: /imu, field: orientation, quaternion: zyxw}", "one of xyzw, wxyz"),
    ("channels:\n  imu.gyro: {topic: /imu, field: orientation_covariance}", "has 9 numbers, not 3"),
    ("channels:\n  imu.gyro: {topic: /imu, field: header}", "`header` contains a string"),
    ("channels:\n  imu.gyro: {topic: /joints, field: 'position[3]'}", "`position[3]` has 1 numbers, not 3"),
    ("channels:\n  imu.gyro: {topic: /imu, field: angular_velocity, scale: [1, 2]}", "`scale` has 2 numbers"),
    ("channels:\n  imu.gyro: {topic: /imu, field: angular_velocity, axes: enu/flu}", "axes `enu/flu` of a vector"),
    ("channels:\n  imu.gyro: {topic: /imu, field: angular_velocity, axes: frd, from: ned}", "only an orientation"),
    ("channels:\n  imu.gyro: {topic: /imu, field: angular_velocity, axes: fdr}", "did you mean `frd`?"),
    (
        "time: log\nchannels:\n  switch: {topic: /level, field: data, offset: 2}",
        "no message can be used: 3 out of range",
    ),
    ("channels:\n  imu.gyro: {topic: /joints, field: velocity}", "no message can be used: 1 with another length"),
    ("time: log\nchannels:\n  level: {topic: /text, field: data}", "`data` is text, not a number"),
    ("channels:\n  imu.gyro: [{topic: /imu, field: a}, {topic: /imu, field: b}]", "is mapped from `/imu` twice"),
    ("channels:\n  level: /level", "`field` is missing, and the channel has no `ros` block"),
    ("channels: from machine", "no sensor channel of `probe` has `ros`"),
    ("channels:\n  level: {topic: /level, field: data, timeout_ms: -1}", "`timeout_ms` must be a positive number"),
    ("channels:\n  level: {topic: /level, field: data, timeout_ms: 1e-7}", "to the nanosecond at most"),
    ("channels:\n  level: {topic: /level, field: data, timeout_ms: soon}", "`timeout_ms` must be a number"),
]


@pytest.mark.parametrize(("text", "reason"), REFUSALS, ids=[str(i) for i in range(len(REFUSALS))])
def test_maps_that_do_not_fit_say_where(
    text: str, reason: str, foreign: Path, probe: Path, write_map: Callable[[str], Path], tmp_path: Path
) -> None:
    with pytest.raises(MapError) as caught:
        replay_foreign(foreign, write_map(text), library=str(probe), output=tmp_path / "out")
    assert reason in str(caught.value) and "map.yaml:" in str(caught.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["foreign", "map.yaml"]  # nothing half-written


def test_bad_files_end_the_command_with_one_message(
    foreign: Path, probe: Path, write_map: Callable[[str], Path], tmp_path: Path
) -> None:
    chart = write_map(MAP)
    cases = [
        ((foreign, "--library", probe, "--map", tmp_path / "absent.yaml"), "absent.yaml: No such file"),
        ((tmp_path / "absent", "--library", probe, "--map", chart), "no such bag"),
        ((foreign, "--library", probe, "--map", chart, "-o", tmp_path / "no/where"), "no such directory"),
    ]
    chart_text = (tmp_path / "map.yaml").read_bytes()
    for arguments, reason in cases:
        done = command(*arguments)
        assert done.returncode == 2 and reason in done.stderr and done.stderr.startswith("fcsl replay: error: ")
    (tmp_path / "map.yaml").write_bytes(b"\xff\xfe" + chart_text)
    with pytest.raises(MapError, match="not UTF-8"):
        read_map(tmp_path / "map.yaml")
    (tmp_path / "map.yaml").write_bytes(chart_text + b" " * ((1 << 20) - len(chart_text)))
    read_map(tmp_path / "map.yaml")
    (tmp_path / "map.yaml").write_bytes(chart_text + b" " * ((1 << 20) + 1 - len(chart_text)))
    with pytest.raises(MapError, match="larger than 1048576 bytes"):
        read_map(tmp_path / "map.yaml")


def test_stamps_that_cannot_be_right_are_refused(probe: Path, write_map: Callable[[str], Path], tmp_path: Path) -> None:
    times = (10**9, 1_700_000_000 * 10**9)
    wild = write(tmp_path / "wild", {"/imu": [(time_ns, imu(time_ns)) for time_ns in times]})
    with pytest.raises(MapError, match="stamps from 1.000 s to 1700000000.000 s would make 169999999901 ticks"):
        replay_foreign(wild, write_map(MAP), library=str(probe))


@pytest.mark.parametrize("chunk", [0, 2000])
def test_a_truncated_bag_is_run_as_far_as_it_goes(
    chunk: int, probe: Path, write_map: Callable[[str], Path], tmp_path: Path
) -> None:
    times = [START + 20 * i * MS for i in range(50)]
    file = write_mcap(tmp_path / "cut.mcap", [(time_ns, "/imu", imu(time_ns)) for time_ns in times], chunk_bytes=chunk)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    assert Bag(file).truncated
    done = command(file, "--library", probe, "--map", write_map(MAP), "-o", tmp_path / "out")
    assert done.returncode == 1 and "the bag is incomplete: cut.mcap breaks off after" in done.stderr
    there = int(done.stderr.split("breaks off after ")[1].split()[0])
    assert 5 < there < 50 and columns(tmp_path / "out", "source.outputs.vec")[1].shape[0] == 2 * there - 1


@pytest.mark.parametrize("terminal", [True, False])
def test_progress(terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A bar that goes away on a terminal, elsewhere lines; nothing of a quick job."""
    now = [100.0]
    monkeypatch.setattr("simclient.cli.time.monotonic", lambda: now[0])
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    shown = Progress("running", 200)
    shown.at(0)
    assert capsys.readouterr().err == ""
    now[0] += 3
    shown.at(50)
    shown.at(51)
    err = capsys.readouterr().err
    if terminal:
        assert err == "\rrunning: [" + "#" * 7 + " " * 23 + "] 25 % (50 of 200)"
    else:
        assert err == "running: 25 % (50 of 200)\n"
    now[0] += 3
    shown.at(200)
    assert capsys.readouterr().err == ("\r\x1b[K" if terminal else "")
