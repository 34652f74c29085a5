# SPDX-License-Identifier: Apache-2.0
"""Maps of a compiled machine with axes and `ros` blocks, and what a map expects of the run."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import MS, header, imu, make, number, quaternion, vector, write

from fcsl_compiler.cli.fcsl import main
from simclient import MapError
from simclient.bag import columns
from simclient.machine_build import build_config
from simclient.replay import replay_foreign
from simclient.replay.foreign import ForeignRun
from simclient.ros.frame_names import differing

START = 100 * 10**9
SENSORS = '''\
class Sensors:
    """What a vehicle senses, in its own axes."""

    outputs = {
        "rate": "f64[3] rad/s",
        "attitude": "f64[4]",
        "covariance": "f64[9]",
        "speed": "f64 m/s",
        "armed": "bool",
    }

    def execute(self):
        pass
'''
ADDER = """\
class Adder:
    inputs = {"speed": "f64 m/s"}
    outputs = {"total": "f64 m/s", "twice": "f64 m/s"}

    def execute(self):
        self.total = self.speed + self.speed
        self.twice = self.speed * 2.0
"""


def channel(number: int, name: str, **ros: str) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": name,
        "id": number,
        "field": "sensors.outputs." + name.rpartition(".")[2],
        "direction": "sensor",
        "max_age_ticks": 100,
    }
    return entry | ({"ros": ros} if ros else {})


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine at 100 Hz in NED and FRD."""
    folder = tmp_path_factory.mktemp("vehicle")
    (folder / "sensors.py").write_text(SENSORS)
    (folder / "adder.py").write_text(ADDER)
    imu_block = {"type": "sensor_msgs/Imu", "topic": "imu/data", "frame": "imu_link"}
    machine = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Sensors": {"source": "sensors.py"}, "Adder": {"source": "adder.py"}},
        "instances": {"sensors": {"algorithm": "Sensors"}, "adder": {"algorithm": "Adder"}},
        "connections": [{"from": "sensors.speed", "to": "adder.speed"}],
        "states": {"RUN": {"schedule": {"sensors": 100, "adder": 100}}},
        "transitions": [],
        "channels": [
            channel(1, "imu.rate", **imu_block, field="angular_velocity", axes="frd"),
            channel(2, "imu.attitude", **imu_block, field="orientation", axes="ned/frd"),
            channel(3, "imu.covariance", **imu_block, field="orientation_covariance", axes="frd"),
            channel(4, "speed"),
            channel(5, "armed"),
        ],
    }
    (folder / "vehicle.json").write_text(json.dumps(machine))
    return build_config(folder / "vehicle.json")[0]


Runs = Callable[..., tuple[ForeignRun, Path]]


@pytest.fixture
def run(vehicle: Path, tmp_path: Path) -> Runs:
    numbers = iter(range(100))

    def of(content: Any, chart: str) -> tuple[ForeignRun, Path]:
        n = next(numbers)
        (tmp_path / "map.yaml").write_text(chart)
        bag = write(tmp_path / f"bag{n}", content)
        return replay_foreign(bag, tmp_path / "map.yaml", library=str(vehicle), output=tmp_path / f"out{n}"), (
            tmp_path / f"out{n}"
        )

    return of


def every(period_ms: int, messages: Sequence[Any]) -> list[tuple[int, Any]]:
    return [(START + period_ms * i * MS, message) for i, message in enumerate(messages)]


def output(out: Path, name: str) -> Any:
    return columns(out, name)[1].tolist()


# ---- axes -------------------------------------------------------------------------------------------------------------

#: Level, nose to the east: in ENU and FLU no rotation, in NED and FRD one of 90 degrees about down.
EAST = (1.0, 0.0, 0.0, 0.0)
EAST_NED = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def test_a_map_may_leave_everything_to_the_machine(run: Runs) -> None:
    covariance = np.array([1.0, 0.1, 0.2, 0.3, 2.0, 0.4, 0.5, 0.6, 3.0])
    message = imu(START, (1, 2, 3), EAST)
    message.orientation_covariance[:] = covariance
    by_hand = """\
channels:
  imu.rate: {topic: /imu/data, field: angular_velocity, axes: frd}
  imu.attitude: {topic: /imu/data, field: orientation, axes: ned/frd}
  imu.covariance: {topic: /imu/data, field: orientation_covariance, axes: frd}
"""
    short = "channels: {imu.rate: /imu/data, imu.attitude: {topic: /imu/data}, imu.covariance: /imu/data}"
    digests = set()
    for chart in (by_hand, short, "channels: from machine"):
        done, out = run({"/imu/data": [(START, message)]}, chart)
        digests.add(done.digest)
        assert done.unmapped == ("speed", "armed")
        assert output(out, "sensors.outputs.rate") == [[1.0, -2.0, -3.0]]
        assert output(out, "sensors.outputs.attitude")[0] == pytest.approx(EAST_NED, abs=1e-15)
        # C → M C Mᵀ with M = diag(1, -1, -1).
        signs = np.outer((1, -1, -1), (1, -1, -1)).ravel()
        assert output(out, "sensors.outputs.covariance") == [(covariance * signs).tolist()]
    assert len(digests) == 1


def test_the_channels_frame_counts_where_the_map_takes_its_field(run: Runs) -> None:
    """As the running node does; a map that names the field itself takes every frame."""
    messages = [imu(START + 10 * i * MS, (i + 1, 0, 0)) for i in range(3)]
    messages[1].header.frame_id = "base_link"
    content = {"/imu/data": every(10, messages)}
    done, out = run(content, "channels: {imu.rate: /imu/data}")
    assert done.fates["imu.rate"].refused == {"frame": (1, 1)}
    told = "imu.rate: refused: 1 with another frame (first: message 1: 'base_link', not 'imu_link')"
    assert told in str(done)
    assert output(out, "sensors.outputs.rate") == [[1, 0, 0], [1, 0, 0], [3, 0, 0]]
    done, _ = run(content, "channels: {imu.rate: {topic: /imu/data, field: angular_velocity}}")
    assert done.fates["imu.rate"].refused == {}
    for message in messages:
        message.header.frame_id = "lidar_link"
    with pytest.raises(MapError, match=r"3 with another frame \(first: message 0: 'lidar_link', not 'imu_link'\)"):
        run(content, "channels: {imu.rate: /imu/data}")


def test_the_first_message_with_another_frame_is_named_wherever_the_file_has_it(run: Runs) -> None:
    messages = [imu(START + 10 * i * MS, (i + 1, 0, 0)) for i in range(4)]
    messages[1].header.frame_id, messages[2].header.frame_id = "first_link", "second_link"
    content = every(10, messages)
    for order in ((0, 1, 2, 3), (0, 2, 3, 1)):
        done, _ = run({"/imu/data": [content[i] for i in order]}, "channels: {imu.rate: /imu/data}")
        assert "2 with another frame (first: message 1: 'first_link', not 'imu_link')" in str(done)


def test_frames_in_texts() -> None:
    """Of a message that is cut, too; a long one is cut."""
    odometry = bytes(12) + b"\4\0\0\0map\0" + b"\5\0\0\0body\0"
    assert differing(odometry, "odom", "") == ("'map'", "'odom'")
    assert differing(odometry, "odom", "base") == ("'map' -> 'body'", "'odom' -> 'base'")
    assert differing(odometry, "", "base") == ("'body'", "'base'")
    assert differing(odometry[:22], "odom", "base") == ("'map' -> ''", "'odom' -> 'base'")
    assert differing(b"", "odom", "base") == ("'' -> ''", "'odom' -> 'base'")
    assert differing(bytes(12) + b"\xff\0\0\0" + 255 * b"a", "odom", "")[0] == repr(80 * "a")


def test_what_has_no_header_has_the_time_of_recording(run: Runs) -> None:
    content = {"/imu/data": [(START, imu(START))], "/speed": every(10, [number(1.0), number(2.0)])}
    done, out = run(content, "channels:\n  imu.rate: /imu/data\n  speed: {topic: /speed, field: data}")
    assert output(out, "sensors.outputs.speed") == [1.0, 2.0]
    assert done.oddities["/speed"].headerless == 2 and done.oddities["/imu/data"].headerless == 0
    assert "/speed: 2 without a header (placed by the time of recording)" in str(done)
    assert "t0 = 100.000000000 s" in str(done)


def test_a_bag_may_hold_other_axes_than_those_of_ros(run: Runs) -> None:
    """`from` says which: a bag in the machine's own axes is taken as it is."""
    messages = {"/imu/data": [(START, imu(START, (1, 2, 3), EAST_NED))]}
    _, out = run(
        messages,
        "channels:\n  imu.rate: {topic: /imu/data, from: frd}\n  imu.attitude: {topic: /imu/data, from: ned/frd}\n",
    )
    assert output(out, "sensors.outputs.rate") == [[1.0, 2.0, 3.0]]
    assert output(out, "sensors.outputs.attitude") == [list(EAST_NED)]


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_four_numbers_may_be_a_quaternion_of_either_order(order: str, run: Runs) -> None:
    q = dict(zip("wxyz", (0.5, 0.1, -0.7, 0.5), strict=True))
    array = make("std_msgs/msg/Float64MultiArray", data=np.array([q[letter] for letter in order]))
    chart = f"time: log\nchannels:\n  imu.attitude: {{topic: /q, field: data, axes: enu/flu, quaternion: {order}}}\n"
    _, out = run({"/q": [(START, array)]}, chart)
    assert output(out, "sensors.outputs.attitude") == [list(q.values())]


def test_another_message_than_that_of_the_channel_needs_a_field(run: Runs) -> None:
    bag = {"/twist": [(START, make("geometry_msgs/msg/TwistStamped", header=header(START)))]}
    with pytest.raises(MapError, match=r"`/twist` is geometry_msgs/msg/TwistStamped, channel `imu.rate` takes"):
        run(bag, "channels: {imu.rate: /twist}")
    bag["/twist"][0][1].twist.angular = vector(1, 2, 3)
    _, out = run(bag, "channels: {imu.rate: {topic: /twist, field: twist.angular}}")
    assert output(out, "sensors.outputs.rate") == [[1.0, -2.0, -3.0]]  # its axes are still the channel's


# ---- expectations -----------------------------------------------------------------------------------------------------

SPEED = "time: log\nchannels:\n  speed: {topic: /speed, field: data}\nexpect:\n"


def test_an_output_within_and_beyond_its_tolerance(run: Runs) -> None:
    speeds = [0.0, 1.0, 2.0, 3.0]
    bag = {
        "/speed": every(10, [number(v) for v in speeds]),
        "/double": every(10, [number(2 * v + error) for v, error in zip(speeds, (0, 0.1, -0.2, 0.1), strict=True)]),
    }

    def holds(tolerance: str) -> bool:
        done, _ = run(bag, SPEED + f"  adder.outputs.total: {{topic: /double, field: data, {tolerance}}}\n")
        (found,) = done.comparisons
        assert found.error.tolist() == pytest.approx([0, 0.1, 0.2, 0.1]) and found.t_s.tolist() == pytest.approx(
            [0, 0.01, 0.02, 0.03]
        )
        return found.holds

    assert holds("abs: 0.21") and not holds("abs: 0.19")
    assert holds("abs: 0, rel: 0.06") and not holds("rel: 0.05")  # 0.2 of 3.8, 0.1 of 2.1
    done, _ = run(bag, SPEED + "  adder.outputs.total: {topic: /double, field: data, abs: 0.15}\n")
    line = str(done).splitlines()[-2].split()
    assert line[:4] == ["adder.outputs.total", "values", "4", "0.2"] and line[-3:] == ["1", "0.020000", "s"]


def test_alignment_is_to_the_tick_at_or_after_or_to_the_nearest(run: Runs) -> None:
    """Speed steps at each tick; a message 4 ms behind tick 1 is held at tick 2, and nearest to tick 1."""
    bag = {
        "/speed": every(10, [number(i) for i in range(4)]),
        "/late": [(START + 14 * MS, number(2.0)), (START + 15 * MS, number(2.0)), (START + 16 * MS, number(4.0))],
    }
    chart = SPEED + "  adder.outputs.total: {topic: /late, field: data, align: %s}\n"
    (held,) = run(bag, chart % "held")[0].comparisons
    assert held.ours.tolist() == [[4.0]] and held.theirs.tolist() == [[4.0]] and held.holds
    (nearest,) = run(bag, chart % "nearest")[0].comparisons
    assert nearest.ours.tolist() == [[2.0], [2.0], [4.0]] and nearest.holds


def turned(degrees: float, axis: int, q: Sequence[float] = (1, 0, 0, 0)) -> tuple[float, float, float, float]:
    """`q` turned about a body axis."""
    half = math.radians(degrees) / 2
    w, x, y, z = q
    r = [math.cos(half), 0.0, 0.0, 0.0]
    r[axis + 1] = math.sin(half)
    return (
        w * r[0] - x * r[1] - y * r[2] - z * r[3],
        w * r[1] + x * r[0] + y * r[3] - z * r[2],
        w * r[2] - x * r[3] + y * r[0] + z * r[1],
        w * r[3] + x * r[2] - y * r[1] + z * r[0],
    )


@pytest.mark.parametrize(
    ("degrees", "axis", "angle", "tilt"),
    [(0.0, 0, 0.0, 0.0), (3.0, 0, 3.0, 3.0), (170.0, 1, 170.0, 170.0), (40.0, 2, 40.0, 0.0)],
)
def test_quaternions_are_compared_by_angle(degrees: float, axis: int, angle: float, tilt: float, run: Runs) -> None:
    base = turned(50.0, 2)
    other = [2.0 * x for x in turned(degrees, axis, base)]  # neither length nor sign matters
    bag = {
        "/imu/data": [(START, imu(START, attitude=base))],
        "/truth": [
            (
                START,
                make(
                    "geometry_msgs/msg/QuaternionStamped",
                    header=header(START),
                    quaternion=quaternion(*(-x for x in other)),
                ),
            )
        ],
    }
    chart = """\
channels:
  imu.attitude: {topic: /imu/data, field: orientation}
expect:
  sensors.outputs.attitude: {topic: /truth, field: quaternion, axes: ned/frd, abs: 0.01%s}
"""
    for extra, expected in (("", angle), (", compare: tilt", tilt)):
        (found,) = run(bag, chart % extra)[0].comparisons
        assert found.target.measure == ("tilt" if extra else "angle") and found.target.unit == "rad"
        assert np.degrees(found.error[0]) == pytest.approx(expected, abs=1e-6)
        assert found.holds == (expected < 0.5)


def test_expected_quaternions_of_length_zero_are_refused(run: Runs) -> None:
    """They are no orientation: an error of NaN would hide all others."""
    attitudes = [(1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)]
    bag = {
        "/imu/data": every(10, [imu(START, attitude=(1, 0, 0, 0))] * 3),
        "/truth": every(10, [quaternion(*q) for q in attitudes]),
    }
    chart = """\
time: log
channels:
  imu.attitude: {topic: /imu/data, field: orientation}
expect:
  sensors.outputs.attitude: {topic: /truth, field: [w, x, y, z], quaternion: wxyz, axes: ned/frd, abs: 4%s}
"""
    done, _ = run(bag, chart % "")
    (found,) = done.comparisons
    assert found.refused == 1 and len(found.error) == 2 and np.isfinite(found.error).all() and found.holds
    assert (
        "  sensors.outputs.attitude: refused: 1 expected quaternions of length zero or infinity"
        in str(done).splitlines()
    )
    done, _ = run(bag, chart % ", from_s: 0.01, until_s: 0.01")
    assert "nothing to compare: of 3 messages, from 0.000 s to 0.020 s, all that count are quaternions of" in str(done)
    assert not done.comparisons[0].holds


def test_an_expectation_of_a_part_of_the_time(run: Runs) -> None:
    speeds = [0.0, 1.0, 2.0, 3.0]
    bag = {
        "/speed": every(10, [number(v) for v in speeds]),
        "/double": every(10, [number(2 * v + error) for v, error in zip(speeds, (9, 0, 0, 9), strict=True)]),
        "/nan": every(10, [number(math.nan)]),
        "/behind": [(START + 10**9, number(1.0))],
    }
    chart = SPEED + "  adder.outputs.total: {topic: /%s, field: data, abs: 0.1%s}\n"
    assert not run(bag, chart % ("double", ""))[0].comparisons[0].holds
    (found,) = run(bag, chart % ("double", ", from_s: 0.01, until_s: 0.02"))[0].comparisons
    assert found.holds and found.t_s.tolist() == pytest.approx([0.01, 0.02])
    for topic, window, reason in (
        ("double", ", from_s: 5", "of 4 messages, from 0.000 s to 0.030 s, none is within `from_s` and `until_s`"),
        ("nan", "", "1 with a NaN (first: message 0)"),
        (
            "behind",
            "",
            "of 1 messages, from 1.000 s to 1.000 s, none that counts is within the run, which ends at 0.040 s",
        ),
    ):
        done, _ = run(bag, chart % (topic, window))
        assert f"  adder.outputs.total: nothing to compare: {reason}" in str(done).splitlines()
        assert not done.comparisons[0].holds
    with pytest.raises(MapError, match="`until_s` is before `from_s`"):
        run(bag, chart % ("double", ", from_s: 2, until_s: 1"))


def test_states_are_compared_as_text(run: Runs) -> None:
    def text(word: str) -> Any:
        return make("std_msgs/msg/String", data=word)

    bag = {"/speed": every(10, [number(1.0)] * 5), "/state": every(20, [text("RUN"), text("RUN"), text("STOP")])}
    done, _ = run(bag, SPEED + "  machine.state: {topic: /state, field: data}\n")
    (found,) = done.comparisons
    assert found.ours.tolist() == ["RUN"] * 3 and found.exceeded.tolist() == [False, False, True]
    assert str(done).splitlines()[-2].split()[:3] == ["machine.state", "state", "3"]


def test_the_command_says_and_draws_it(vehicle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = write(
        tmp_path / "bag",
        {
            "/speed": every(10, [number(v) for v in range(50)]),
            "/double": every(30, [number(6.0 * v) for v in range(16)]),
        },
    )
    (tmp_path / "map.yaml").write_text(SPEED.removesuffix("expect:\n"))
    expect = tmp_path / "expect.yaml"

    def command(*more: str | Path) -> tuple[int | str | None, str, str]:
        """Status, output and errors of `fcsl replay`."""
        line = ["replay", bag, "--library", vehicle, "--map", tmp_path / "map.yaml"]
        try:
            status: int | str | None = main([*map(str, [*line, *more])])
        except SystemExit as end:
            status = end.code
        return (status, *capsys.readouterr())

    entry = "expect:\n  adder.outputs.%s: {topic: /double, field: data, abs: 0.5}\n"
    expect.write_text(entry % "total")
    status, out, err = command("--expect", expect, "--plot", tmp_path / "p.png")
    assert (status, err) == (0, "") and "adder.outputs.total" in out
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"
    expect.write_text(entry.replace("abs", "scale: 2, abs") % "twice")
    status, out, _ = command("--expect", expect)
    assert status == 1 and out.splitlines()[-2].split()[-3:] == ["15", "0.030000", "s"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bag", "expect.yaml", "map.yaml", "p.png"]

    for text, reason in {
        "channels: {}": "unknown key `channels`",
        "{}": "`expect` is missing",
        entry % "totel": "no output `adder.outputs.totel`; did you mean `adder.outputs.total`?",
        (entry % "total").replace("abs: 0.5", "abs: -1"): "`abs` must not be negative",
        (entry % "total").replace("abs: 0.5", "compare: angle"): "`compare: angle` is for quaternions",
        (entry % "total").replace("/double", "/duble"): "no topic `/duble`; did you mean `/double`?",
        (entry % "total").replace("field: data, ", ""): "`field` is missing",
        "expect:\n  machine.state: {topic: /double, field: data}": "`data` of `/double` is not text",
        "expect:\n  machine.state: {topic: /double, field: date}": "has no field `date`",
        "expect:\n  machine.state: {topic: /double, field: data, abs: 1}": "states are compared as text",
    }.items():
        expect.write_text(text)
        status, _, err = command("--expect", expect)
        assert status == 2 and reason in err, (text, err)
    status, _, err = command("--plot", tmp_path / "p.png")
    assert status == 2 and "nothing is expected" in err
    status, _, err = command("--plot", tmp_path / "p.txt")
    assert status == 2 and "ends in .png" in err
