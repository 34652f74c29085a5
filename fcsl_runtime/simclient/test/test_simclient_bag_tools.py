# SPDX-License-Identifier: Apache-2.0
"""`fcsl bag`: what it says of a bag, cuts out, finds different and exports is what the bag holds."""

from __future__ import annotations

import csv
import json
import math
import os
import random
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_bags import ROS2_FORMATS, header, imu, make, number
from foreign_bags import write as write_foreign
from hypothesis import example, given, settings
from hypothesis import strategies as st
from native import PROGRAM
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat
from rosbags.typesys import Stores, get_typestore

from simclient import AlgTwin, BagError
from simclient.bag import Bag, columns
from simclient.bag.compare import Tolerance
from simclient.bag.diff import diff
from simclient.bag.digest import digest
from simclient.bag.export import select, write
from simclient.bag.formats import open_bag
from simclient.bag.info import describe
from simclient.replay import replay
from simclient.replay.cut import cut

Fly = Callable[..., Path]
TICK_NS = 10_000_000


@pytest.fixture
def fly(probe: Path, tmp_path: Path) -> Fly:
    """Records one second of the probe; `poke` writes a value before a tick: {tick: (path, value)}."""

    def record(name: str = "run", poke: dict[int, tuple[str, object]] | None = None, ticks: int = 100) -> Path:
        with AlgTwin.from_library(probe) as twin:
            twin.record(tmp_path / name, "car")
            for k in range(ticks):
                twin.set("source.outputs.vec", [math.sin(k / 5), 0.0, math.nan])
                if k in (40, 70):
                    twin.set_state("ACTIVE" if k == 40 else "IDLE")
                if k in (poke or {}):
                    twin.set(*(poke or {})[k])
                twin.tick()
        return tmp_path / name

    return record


def tool(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = ["fcsl", "bag", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert "Traceback" not in done.stderr, done.stderr
    return done


# ---- info ----------------------------------------------------------------------------------------------------------


def test_info_tells_topics_states_writes_and_hashes(fly: Fly) -> None:
    bag = fly()
    done = tool("info", bag)
    assert done.returncode == 0 and done.stderr == ""
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    assert "duration 1.000000000 s" in lines and "damage none" in lines
    assert any(line.startswith("/car/probe/echo ") and line.endswith(" 100 100.00 Hz") for line in lines)
    assert "writes 100 SET, 2 SET_STATE" in lines and "ticks 0 to 99" in lines
    assert lines[-3:] == [
        "IDLE 0.000000000 s 0.390000000 s 0 to 39",
        "ACTIVE 0.400000000 s 0.690000000 s 40 to 69",
        "IDLE 0.700000000 s 0.990000000 s 70 to 99",
    ]


def test_every_tool_tells_of_damage_after_it_did_what_could_be_done(fly: Fly, tmp_path: Path) -> None:
    bag = fly()
    file = bag / "run_0.mcap"
    file.write_bytes(file.read_bytes()[:-100])
    done = tool("info", bag)
    assert done.returncode == 1 and "damage     run_0.mcap" in done.stdout
    assert "the bag is incomplete: run_0.mcap" in done.stderr
    for arguments in (
        ("cut", bag, "-o", tmp_path / "part"),
        ("export", bag, "-o", tmp_path / "t.csv"),
        ("digest", bag),
    ):
        done = tool(*arguments)
        assert done.returncode == 1 and "the bag is incomplete: run_0.mcap" in done.stderr, arguments
    assert Bag(tmp_path / "part").truncated == ""


def foreign(path: Path, values: list[tuple[int, float]]) -> Path:
    """A bag of others: a temperature without a machine, stamps in ns, a frame_id that is not empty."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "sensor_msgs/msg/Temperature"
    header, time, message = (store.types[n] for n in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", kind))
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/engine/temperature", kind, typestore=store)
        for stamp, value in values:
            head = header(time(stamp // 10**9, stamp % 10**9), "engine")
            data = store.serialize_cdr(message(head, value, 0.5), kind)
            writer.write(connection, stamp + 5_000_000, data)
    return path


def test_bags_of_others_have_info_cuts_and_tables_too(tmp_path: Path) -> None:
    start = 1_700_000_000_000_000_000
    bag = foreign(tmp_path / "truck", [(start + k * 10**8, 20.0 + k) for k in range(10)])
    assert "from       1700000000.000000000 s" in tool("info", bag).stdout
    done = tool("cut", bag, "-o", tmp_path / "part", "--from", "1700000000.3", "--to", "1700000000.5")
    assert done.returncode == 0 and "3 messages" in done.stdout
    assert tool("export", tmp_path / "part", "-o", tmp_path / "part.csv").returncode == 0
    rows = list(csv.DictReader((tmp_path / "part.csv").open()))
    assert [row["time_s"] for row in rows] == [f"1700000000.{k}00000000" for k in (3, 4, 5)]
    assert [float(row["/engine/temperature:temperature"]) for row in rows] == [23.0, 24.0, 25.0]


def test_times_of_columns_are_stamps_and_without_them_of_the_log(tmp_path: Path) -> None:
    """Of messages of one layout, of those that are decoded one by one, and of those without a header."""
    stamps_ns = [1_250_000_000, 1_999_999_999, 3_000_000_000, 1_700_000_000_000_000_001]
    logs_ns = [stamp + 375_000_000 for stamp in stamps_ns]

    def stamped(kind: str, frames: list[str], **more: Any) -> list[tuple[int, Any]]:
        heads = [header(stamp, frame) for stamp, frame in zip(stamps_ns, frames, strict=True)]
        return [(log, make(kind, header=head, **more)) for log, head in zip(logs_ns, heads, strict=True)]

    one, several = [""] * 4, ["a", "ab", "", "abcdefghi"]
    content = {
        "/one_layout": stamped("sensor_msgs/msg/Temperature", one, temperature=3.0),
        "/any_layout": stamped("sensor_msgs/msg/Temperature", several, temperature=3.0),
        "/text": [(log, make("std_msgs/msg/String", data="x" * n)) for n, log in enumerate(logs_ns)],
        "/number": [(log, number(n)) for n, log in enumerate(logs_ns)],
    }
    bag = Bag(write_foreign(tmp_path / "bag", content))
    for path in ("/one_layout:temperature", "/any_layout:temperature", "/one_layout:header.stamp.nanosec"):
        assert columns(bag, path)[0] == pytest.approx(np.array(stamps_ns) / 1e9, rel=1e-15), path
    for path in ("/text:data", "/number:data"):
        assert columns(bag, path)[0] == pytest.approx(np.array(logs_ns) / 1e9, rel=1e-15), path
    assert list(columns(bag, "/any_layout:temperature")[1]) == [3.0] * 4
    assert list(columns(bag, "/text:data")[1]) == ["", "x", "xx", "xxx"]


# ---- cut -----------------------------------------------------------------------------------------------------------


def read_with_rosbags(path: Path) -> list[tuple[str, str, int, bytes]]:
    with AnyReader([path]) as reader:
        return [(c.topic, c.msgtype, time, bytes(data)) for c, time, data in reader.messages()]


@settings(max_examples=10)
@given(first=st.integers(0, 99), length=st.integers(0, 99))
def test_a_cut_holds_exactly_the_messages_of_its_time(
    first: int, length: int, probe: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    with AlgTwin.from_library(probe) as twin:
        twin.record(folder / "run")
        for k in range(100):
            twin.set("source.outputs.vec", [float(k), 0.0, 0.0])
            twin.tick()
    last = min(99, first + length)
    begin, end = first * TICK_NS, last * TICK_NS
    cut(Bag(folder / "run"), folder / "part", begin, end)
    whole = read_with_rosbags(folder / "run")
    assert sorted(read_with_rosbags(folder / "part")) == sorted(m for m in whole if begin <= m[2] <= end)
    assert columns(str(folder / "part"), "source.outputs.vec")[1][:, 0].tolist() == list(range(first, last + 1))


def test_a_cut_by_state_replays_with_the_machine_and_says_so_without(fly: Fly, probe: Path, tmp_path: Path) -> None:
    bag = fly()
    without = tool("cut", bag, "-o", tmp_path / "shown", "--state", "ACTIVE")
    assert without.returncode == 0 and "/car/probe: shows but does not reproduce" in without.stdout
    with pytest.raises(BagError, match="initial checkpoint is missing"):
        replay(tmp_path / "shown", library=str(probe))
    assert "no checkpoint" in tool("info", tmp_path / "shown").stdout

    done = tool("cut", bag, "-o", tmp_path / "part", "--state", "IDLE", "--visit", 2, "--library", probe)
    assert done.returncode == 0 and "/car/probe: replays" in done.stdout, done.stderr
    verdict = replay(tmp_path / "part", library=str(probe))
    assert verdict.identical and verdict.ticks == 30, str(verdict)
    assert set(columns(str(tmp_path / "part"), "machine.state")[1]) == {"IDLE"}


def test_a_cut_after_the_end_of_one_of_two_machines(probe: Path, tmp_path: Path) -> None:
    parts = {"bus": 20, "car": 100}
    for name, ticks in parts.items():
        with AlgTwin.from_library(probe) as twin:
            twin.record(tmp_path / name, name)
            twin.tick(ticks)
    whole = sorted((m for name in parts for m in read_with_rosbags(tmp_path / name)), key=lambda m: m[2])
    with Writer(tmp_path / "both", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        open_ = {}
        for bag in (Bag(tmp_path / name) for name in parts):
            for name, topic in bag.topics.items():
                type_hash = bag.store(name).hash_rihs01(topic.type)
                open_[name] = writer.add_connection(name, topic.type, msgdef=topic.schema, rihs01=type_hash)
        for name, _, time_ns, data in whole:
            writer.write(open_[name], time_ns, data)
    done = cut(Bag(tmp_path / "both"), tmp_path / "part", 50 * TICK_NS, 60 * TICK_NS)
    assert set(done.machines) == {"/bus/probe", "/car/probe"} and all(done.machines.values())
    expected = sorted(m for m in whole if 50 * TICK_NS <= m[2] <= 60 * TICK_NS)
    assert sorted(read_with_rosbags(tmp_path / "part")) == expected and len(expected) >= 22


def test_a_cut_from_the_start_replays_by_itself(fly: Fly, probe: Path, tmp_path: Path) -> None:
    done = tool("cut", fly(), "-o", tmp_path / "head", "--to", "0.5")
    assert done.returncode == 0 and "/car/probe: replays" in done.stdout
    assert replay(tmp_path / "head", library=str(probe)).ticks == 51


def test_a_cut_keeps_qualities_and_hashes_and_opens_in_rerun(fly: Fly, tmp_path: Path) -> None:
    import yaml

    bag = fly()
    cut(Bag(bag), tmp_path / "part", 0, 50 * TICK_NS)
    about = [
        {t["topic_metadata"]["name"]: t["topic_metadata"] for t in information["topics_with_message_count"]}
        for path in (bag, tmp_path / "part")
        for information in [yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]]
    ]
    assert about[0].keys() == about[1].keys()
    for name, was in about[0].items():
        assert was["type_description_hash"] == about[1][name]["type_description_hash"]
        assert len(was["offered_qos_profiles"]) == len(about[1][name]["offered_qos_profiles"])
        for old, new in zip(was["offered_qos_profiles"], about[1][name]["offered_qos_profiles"], strict=True):
            assert [old[k] for k in ("durability", "depth")] == [new[k] for k in ("durability", "depth")]
    rerun = [sys.executable, "-m", "rerun"]
    env = {**os.environ, "CI": "1"}  # otherwise rerun switches its usage statistics on, in the home directory
    out = tmp_path / "part.rrd"
    convert = [*rerun, "mcap", "convert", str(tmp_path / "part" / "part.mcap"), "-o", str(out)]
    converted = subprocess.run(convert, capture_output=True, text=True, env=env)
    assert converted.returncode == 0, converted.stderr
    printed = subprocess.run([*rerun, "rrd", "print", str(out)], capture_output=True, text=True, env=env)
    assert "/car/probe/echo" in printed.stdout


def test_a_cut_of_a_bag_without_metadata_has_the_hashes_of_its_types(fly: Fly, tmp_path: Path) -> None:
    import yaml

    def hashes(bag: Path) -> dict[str, str]:
        about = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        topics = [t["topic_metadata"] for t in about["topics_with_message_count"]]
        return {t["name"]: t["type_description_hash"] for t in topics}

    bag = fly()
    expected = hashes(bag)
    (bag / "metadata.yaml").unlink()
    cut(Bag(bag), tmp_path / "part", 0, 50 * TICK_NS)
    found = hashes(tmp_path / "part")
    assert found and found == {name: expected[name] for name in found}


@pytest.mark.parametrize("form", ["sqlite3", "sqlite3-message", "mcap-file"])
def test_a_record_in_another_format_is_the_same_run(form: str, fly: Fly, probe: Path, tmp_path: Path) -> None:
    """As `ros2 bag convert` leaves it."""
    run, other = Bag(fly()), tmp_path / "other"
    plugin, mode = ROS2_FORMATS[form]
    writer = Writer(other, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {
            t.name: writer.add_connection(t.name, t.type, msgdef=t.schema, rihs01="x") for t in run.topics.values()
        }
        for topic, log_ns, data in run.messages():
            writer.write(connections[topic], log_ns, data)
    assert digest(other) == digest(run)
    assert replay(other, library=str(probe)).identical
    assert diff(run, open_bag(other)).same
    assert np.array_equal(*(columns(bag, "source.outputs.big")[1] for bag in (run, str(other))))
    for verb, file in (("plot", "x.png"), ("rerun", "x.rrd")):
        done = subprocess.run(["fcsl", verb, other, "-o", tmp_path / file])
        assert done.returncode == 0 and (tmp_path / file).stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--state", "ACTVE"], "was never in state `ACTVE`; did you mean `ACTIVE`?; it was in IDLE, ACTIVE"),
        (["--state", "ACTIVE", "--visit", "2"], "was in `ACTIVE` once; there is no visit 2"),
        (["--from", "5"], "no message from 5.000000000 s"),
        (["--from", "2", "--to", "1"], "the cut ends before it begins"),
        (["--to", "soon"], "`soon` is not a number of seconds"),
        (["--from", "0.5", "--library", "absent.so"], "absent.so: no such machine library"),
    ],
)
def test_a_cut_that_cannot_be_leaves_nothing(arguments: list[str], reason: str, fly: Fly, tmp_path: Path) -> None:
    done = tool("cut", fly(), "-o", tmp_path / "part", *arguments)
    assert done.returncode == 2 and reason in done.stderr, done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["run"]
    assert tool("cut", tmp_path / "run", "-o", tmp_path / "run").returncode == 2


# ---- diff ----------------------------------------------------------------------------------------------------------


def test_equal_runs_are_the_same_even_with_nans(fly: Fly) -> None:
    done = tool("diff", fly("one"), fly("two"))
    assert done.returncode == 0 and done.stdout.endswith("the bags are the same\n"), done.stdout


def test_the_first_difference_is_found_with_values_and_context(fly: Fly, tmp_path: Path) -> None:
    poke = {57: ("source.outputs.vec[1]", 0.125)}
    done = tool("diff", fly("one"), fly("two", poke), "--topics", "/car/probe/source", "/car/probe/echo")
    assert done.returncode == 1
    assert "first difference at tick 57, t = 0.570000000 s, state ACTIVE\n  /car/probe/source  vec[1]" in done.stdout
    assert "    A  0.0\n    B  0.125\n" in done.stdout
    assert "vec: 1 from t = 0.570000000 s on, by at most 0.125" in done.stdout
    for said in (done, tool("diff", tmp_path / "two", tmp_path / "one", "--topics", "/car/probe/source")):
        around = said.stdout.splitlines()[4:10]
        first, second = around[0].index("A"), around[0].rindex("B")
        assert [line[:first].split() for line in around] == [[], ["55"], ["56"], [">", "57"], ["58"], ["59"]]
        assert all(line[at - 2 : at] == "  " and line[at] != " " for line in around for at in (first, second)), around
    alone = tool("diff", fly("three"), fly("four", poke))
    assert "/car/probe/record/writes" in alone.stdout.splitlines()[1]  # the cause comes before its effect
    assert (
        tool("diff", fly("five"), fly("six", poke), "--absolute", 0.2, "--topics", "/car/probe/source").returncode == 0
    )


@pytest.mark.parametrize("tick", [39, 40, 41, 69, 70, 71])
def test_the_state_of_a_difference_is_the_one_of_its_tick(tick: int, fly: Fly) -> None:
    one = Bag(fly("one"))
    found = str(diff(one, Bag(fly("two", {tick: ("source.outputs.vec[1]", 0.125)})), topics=["/car/probe/source"]))
    *_, state = [s for t, s in zip(*columns(one, "machine.state"), strict=True) if round(t * 100) <= tick]
    assert f"at tick {tick}, t = {tick / 100:.9f} s, state {state}\n" in found


def test_missing_messages_and_topics_are_differences(fly: Fly, tmp_path: Path) -> None:
    bag = fly()
    cut(Bag(bag), tmp_path / "part", 0, 98 * TICK_NS)
    found = diff(Bag(bag), Bag(tmp_path / "part"))
    assert not found.same and "t = 0.990000000 s, state IDLE" in str(found) and "1 only in A" in str(found)
    other = foreign(tmp_path / "truck", [(0, 1.0)])
    done = tool("diff", bag, other)
    assert done.returncode == 2 and "no topic in common" in done.stderr


floats = st.floats(allow_nan=True, allow_infinity=True)


@given(a=floats, b=floats, absolute=st.sampled_from([0.0, 1e-9, 1.0]), relative=st.sampled_from([0.0, 1e-6]))
@example(a=1.0, b=1.9, absolute=0.0, relative=0.5)  # near enough for the larger of the two alone
@example(a=-1.9, b=-1.0, absolute=0.0, relative=0.5)
@example(a=1.0, b=2.1, absolute=0.0, relative=0.5)
def test_tolerances_are_those_of_math_isclose(a: float, b: float, absolute: float, relative: float) -> None:
    differs = bool(Tolerance(absolute, relative).differ(np.array([a]), np.array([b]))[0])
    if math.isnan(a) or math.isnan(b):
        assert differs == (math.isnan(a) != math.isnan(b))
    elif not (absolute or relative):
        assert differs == (struct.pack("d", a) != struct.pack("d", b))
    elif math.isfinite(a) and math.isfinite(b):
        assert differs == (not abs(a - b) <= absolute + relative * max(abs(a), abs(b)))
    else:
        assert differs == (a != b)


# ---- export --------------------------------------------------------------------------------------------------------


def test_tables_hold_what_the_bag_holds(fly: Fly, tmp_path: Path) -> None:
    import pyarrow.parquet

    bag = Bag(fly())
    t_s, vec = columns(bag, "source.outputs.vec")
    states = columns(bag, "machine.state")[1]
    for suffix in (".csv", ".parquet", ".npz"):
        assert write(select(bag), tmp_path / f"run{suffix}") == 100
    rows = list(csv.DictReader((tmp_path / "run.csv").open()))
    assert [float(row["time_s"]) for row in rows] == pytest.approx(t_s.tolist(), abs=1e-12)
    assert [float(row["source.outputs.vec[0]"]) for row in rows] == vec[:, 0].tolist()
    assert {row["source.outputs.vec[2]"] for row in rows} == {"nan"}
    assert [row["machine.state"] for row in rows] == states.tolist()
    table = pyarrow.parquet.read_table(tmp_path / "run.parquet").to_pydict()
    assert table["source.outputs.vec[0]"] == vec[:, 0].tolist() and table["machine.state"] == states.tolist()
    assert table["time_ns"] == [k * TICK_NS for k in range(100)]
    with np.load(tmp_path / "run.npz") as arrays:
        assert np.array_equal(arrays["source.outputs.vec"], vec, equal_nan=True)
        assert arrays["source.time_ns"].tolist() == [k * TICK_NS for k in range(100)]


def test_columns_are_chosen_by_pattern_and_gaps_stay_empty(tmp_path: Path, fly: Fly) -> None:
    out = tmp_path / "x.csv"
    done = tool(
        "export", fly(), "-o", out, "--columns", "echo.outputs.*", "/car/probe/transitions", "source.outputs.vec"
    )
    assert done.returncode == 0, done.stderr
    names = next(csv.reader(out.open()))
    assert names[0] == "time_s" and "source.outputs.vec[2]" in names and "machine.state" not in names
    assert not any(name.startswith("source.outputs.quat") for name in names)
    done = tool("export", tmp_path / "run", "-o", out, "--columns", "ecko.outputs.sum")
    assert done.returncode == 2 and "nothing to export" in done.stderr
    out.unlink()
    done = tool("export", tmp_path / "run", "-o", out, "--columns", "echo.outputs.sum", "probe.outputs.none")
    assert done.returncode == 2 and "no column or topic matches `probe.outputs.none`" in done.stderr
    assert not out.exists()  # rather than a table without what was asked for
    done = tool("export", tmp_path / "run", "-o", tmp_path / "x.xls")
    assert done.returncode == 2 and "ends in .csv, .parquet, .npz" in done.stderr
    bag = foreign(tmp_path / "truck", [(5, 1.0), (7, 2.0), (7, 3.0)])
    write(select(Bag(bag)), out)
    assert [(r["time_s"], r["/engine/temperature:temperature"]) for r in csv.DictReader(out.open())] == [
        ("0.000000005", "1.0"), ("0.000000007", "2.0"), ("0.000000007", "3.0")
    ]  # fmt: skip


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_large_arrays_have_no_columns_without_being_named(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A column for each byte of an image would fill the memory; so would many images that wait to be converted."""
    monkeypatch.setattr("simclient.bag.export._STACK_BYTES", 100_000)
    pixels = np.arange(48_000) % 251
    image = make("sensor_msgs/msg/Image", header=header(10**9), height=120, width=400, data=pixels.astype(np.uint8))
    poses = [make("geometry_msgs/msg/PoseStamped", header=header(10**9)) for _ in range(1200)]
    path = make("nav_msgs/msg/Path", header=header(10**9), poses=poses)
    messages = {
        "/image": [(10**9 + i, image) for i in range(5)],
        "/path": [(10**9, path)],
        "/imu": [(10**9, imu(10**9))],
    }
    bag, target = write_foreign(tmp_path / "bag", messages), tmp_path / f"x{suffix}"
    done = tool("export", bag, "-o", target)
    assert done.returncode == 0, done.stderr
    assert (
        "left out, as arrays of over 1000 elements (--columns NAME takes one): /image:data, /path:poses" in done.stdout
    )
    assert target.stat().st_size < 100_000
    found = select(open_bag(bag), ["/image:data"])
    assert found.series[0].columns["/image:data"].shape == (5, 48_000) and not found.too_large
    assert (found.series[0].columns["/image:data"][4] == pixels).all()
    with pytest.raises(BagError, match="nothing to export but arrays of over 1000 elements.*: /path:poses"):
        select(open_bag(bag), ["/path:poses*"])


def test_parquet_without_pyarrow_is_a_message(fly: Fly, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(BagError, match="pip install pyarrow"):
        write(select(Bag(fly())), tmp_path / "x.parquet")
    assert not (tmp_path / "x.parquet").exists()


# ---- damage --------------------------------------------------------------------------------------------------------


def test_damage_anywhere_is_a_message_or_a_result(fly: Fly, tmp_path: Path) -> None:
    whole, bag = fly("whole"), fly()
    file = bag / "run_0.mcap"
    content = file.read_bytes()
    random_of = random.Random(4)
    outcomes = dict.fromkeys(("read", "refused"), 0)
    for variant in range(40):
        damaged = bytearray(content)
        if variant % 3 == 0:
            del damaged[random_of.randrange(len(content)) :]
        else:
            for _ in range(random_of.choice((1, 3, 50))):
                damaged[random_of.randrange(len(content))] ^= 1 << random_of.randrange(8)
        file.write_bytes(damaged)
        for work in (
            lambda: describe(open_bag(bag)),
            lambda n=variant: cut(open_bag(bag), tmp_path / f"part{n}", 0, 50 * TICK_NS),
            lambda: str(diff(open_bag(whole), open_bag(bag))),
            lambda n=variant: write(select(open_bag(bag)), tmp_path / f"{n}.npz"),
        ):
            try:
                work()
                outcomes["read"] += 1
            except BagError:
                outcomes["refused"] += 1
    assert all(outcomes.values()), outcomes
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_outputs_with_capitals_are_found_by_their_own_names(tmp_path: Path) -> None:
    """A bag has them in lower case."""
    (tmp_path / "law.py").write_text(
        'class Law:\n    outputs = {"P": "f64[2]", "qDot": "f64"}\n\n    def execute(self):\n'
        "        self.P[1] = self.P[1] + 1.0\n        self.qDot = self.P[1] * 2.0\n"
    )
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law"}},
        "states": {"RUN": {"schedule": {"law": 100}}},
    }
    (tmp_path / "m.json").write_text(json.dumps(config))
    subprocess.run(["fcslc", "build", tmp_path / "m.json", "-o", tmp_path], check=True, capture_output=True)
    line = [PROGRAM, tmp_path / "libm.so", "--ticks", "3", "--record", tmp_path / "bag"]
    subprocess.run(line, check=True, capture_output=True)
    bag = Bag(tmp_path / "bag")
    found = {name: list(column) for one in select(bag, ["law.outputs.P", "law.outputs.qDot"]).series
             for name, column in one.columns.items()}  # fmt: skip
    assert found["law.outputs.qdot"] == [2.0, 4.0, 6.0] and len(found) == 2
