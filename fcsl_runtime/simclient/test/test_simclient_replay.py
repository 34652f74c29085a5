# SPDX-License-Identifier: Apache-2.0
"""Bags of ours: reading, digest, replay; and that nothing differing or missing passes for identical."""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import signal
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from simclient import AlgTwin, BagError
from simclient.bag import Bag, columns
from simclient.bag.digest import digest
from simclient.machine_build import build_config
from simclient.replay import replay
from simclient.replay.replaying import parameter_notes
from simclient.run import open_run

#: Where outputs lie in their messages: behind encapsulation, header and tick.
SUM_AT = VEC_AT = 28
#: The number of the message in which `fly` makes sum and copy[1] NaN.
NAN_AT = 11

ROOT = Path(__file__).resolve().parents[3]

Tool = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def tool(tmp_path: Path) -> Tool:
    """Runs `fcsl <name>`, as a user does."""

    def run(name: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        command = ["fcsl", name, *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert "Traceback" not in done.stderr, done.stderr
        return done

    return run


def fly(library: Path, bag: Path, name_space: str = "", gain: float = 2.0, ticks: int = 30) -> list[list[float]]:
    """Records a run in which every kind of write occurs; returns what `echo.outputs.copy` was after each tick."""
    seen = []
    with AlgTwin.from_library(library) as twin:
        twin.tick(5)  # the record need not start at tick 0
        twin.record(bag, name_space)
        twin.set("echo.parameters.gain", gain)
        for k in range(ticks):
            twin.set("source.outputs.vec", [math.sin(k), math.nan if k == NAN_AT else k / 7, -0.0])
            twin.set("source.outputs.grid[1][2]", k * 0.1)
            if k == 6:
                twin.set_state("ACTIVE")
            if k == 8:
                twin.overrun("echo")
            if k == 10:
                checkpoint = twin.save()
            if k == 14:
                twin.restore(checkpoint)
            twin.tick()
            seen.append(twin.get_value("echo.outputs.copy"))
    return seen


@pytest.fixture
def bag(probe: Path, tmp_path: Path) -> Path:
    fly(probe, tmp_path / "run")
    return tmp_path / "run"


def edited(bag: Path, target: Path, edit: Callable[[str, int, bytes], bytes | None]) -> Path:
    """A copy of the bag in which `edit` (topic, number in the topic, data) changed or dropped (None) messages."""
    target.mkdir()
    counts: dict[str, int] = {}
    channels: dict[int, int] = {}
    with (bag / f"{bag.name}_0.mcap").open("rb") as source, (target / "edited.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start()
        for schema, channel, message in make_reader(source).iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            index = counts[channel.topic] = counts.get(channel.topic, -1) + 1
            data = edit(channel.topic, index, message.data)
            if data is not None:
                writer.add_message(channels[channel.id], message.log_time, data, message.publish_time)
        writer.finish()
    return target


# ---- reading ----------------------------------------------------------------------------------------------------------


def test_columns_are_what_the_twin_said(probe: Path, tmp_path: Path) -> None:
    seen = fly(probe, tmp_path / "run", name_space="a/b")
    t_s, copy = columns(tmp_path / "run", "echo.outputs.copy")
    assert copy.shape == (30, 3) and np.array_equal(copy, np.array(seen), equal_nan=True)
    assert t_s[0] == 0.05 and t_s.dtype == np.float64
    _, states = columns(tmp_path / "run", "machine.state")
    assert list(states[:8]) == ["IDLE"] * 6 + ["ACTIVE"] * 2
    _, flag = columns(tmp_path / "run", "/a/b/probe/source:flag")
    assert flag.dtype == bool
    _, health = columns(tmp_path / "run", "echo.outputs.health")
    assert health[8] == 1 and health.sum() == 1


def test_every_output_is_in_the_bag_with_its_bits(probe: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run")
        twin.set("source.outputs.big", -(2**63))
        twin.set("source.outputs.long_word", 2**64 - 1)
        twin.set("source.outputs.grid", [[1, 2, 3], [4, 5, 6.5]])
        twin.tick()
        expected = {f.path: twin.get_value(f.path) for f in twin.fields() if f.role == "output"}
        names = {"nominal": 0, "degraded": 1, "failed": 2, "stale": 3, "": 0, "tr_GO": 1, "tr_STOP": 2}
    for path, value in expected.items():
        if path == "source.outputs.transition_request":
            continue  # a block that never requests has no such field in its message
        _, recorded = columns(tmp_path / "run", path)
        flat = np.ravel(np.array(names.get(value, value) if isinstance(value, str) else value))
        assert recorded[0].ravel().tolist() == flat.tolist(), path


def test_columns_name_what_there_is(bag: Path) -> None:
    for path, reason in (
        ("ehco.outputs.sum", "no instance `ehco`; it holds echo, source"),
        ("echo.outputs.sun", "no field `sun`; did you mean `sum`?"),
        ("echo.state.total", "write <instance>.outputs.<field>"),
        ("/probe/ech:sum", "no topic `/probe/ech`; did you mean `/probe/echo`?"),
    ):
        with pytest.raises(BagError) as caught:
            columns(bag, path)
        assert reason in str(caught.value)


def test_rosbags_reads_our_bags(bag: Path) -> None:
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        topics = {c.topic: c.msgtype for c in reader.connections}
        assert (
            topics["/probe/echo"] == "simclient/msg/ProbeEcho"
            and topics["/probe/state"] == "fcsl_msgs/msg/MachineState"
        )
        echo = [c for c in reader.connections if c.topic == "/probe/echo"]
        messages = [reader.deserialize(data, c.msgtype) for c, _, data in reader.messages(echo)]
    assert [m.tick for m in messages[:3]] == [5, 6, 7] and len(messages) == 30  # type: ignore[attr-defined]


def test_what_is_not_a_bag(tmp_path: Path, tool: Tool) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mcap").write_text("hello")
    for path, reason in (
        ("absent", "no such bag"),
        ("empty", "not a bag (no .mcap, .db3, .bag file in it)"),
        ("text.mcap", "not an MCAP file"),
    ):
        done = tool("bag", "digest", path)
        assert done.returncode == 2 and reason in done.stderr and done.stdout == ""


def test_a_bag_of_others_is_not_replayed_without_a_map(tmp_path: Path, probe: Path, tool: Tool) -> None:
    with (tmp_path / "other.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start()
        writer.finish()
    done = tool("replay", "other.mcap", "--library", probe)
    assert done.returncode == 2 and "not a recording of a machine" in done.stderr and "--map" in done.stderr


# ---- digest -----------------------------------------------------------------------------------------------------------


def test_digest_is_of_the_run_and_not_of_the_recording(probe: Path, tmp_path: Path, tool: Tool) -> None:
    fly(probe, tmp_path / "a")
    fly(probe, tmp_path / "b", name_space="elsewhere")
    fly(probe, tmp_path / "c", gain=math.nextafter(2.0, 3.0))
    assert digest(tmp_path / "a") == digest(tmp_path / "b") != digest(tmp_path / "c")
    done = tool("bag", "digest", "a")
    assert done.returncode == 0 and done.stdout == digest(tmp_path / "a") + "\n"
    reordered = edited(tmp_path / "a", tmp_path / "d", lambda topic, i, data: data)
    assert digest(reordered) == digest(tmp_path / "a")


def spelled_out(bag: Path) -> str:
    """The digest as its description says, from messages decoded one by one."""
    opened = Bag(bag)
    machine = opened.machine()
    samples: dict[str, list[bytes]] = {}
    for topic, _, data in opened.messages({machine.state, *machine.outputs.values()}):
        message = opened.decode(topic, data)
        tick = struct.pack("<Q", message.tick)
        if topic == machine.state:
            for name in ("state", "next_state"):
                text = getattr(message, name).encode()
                samples.setdefault(f"machine.{name}", []).append(tick + struct.pack("<I", len(text)) + text)
            continue
        for leaf in opened.fixed_layout(topic).leaves.values():
            if not leaf.path.startswith("header.") and leaf.path != "tick":
                value = np.array(getattr(message, leaf.path), leaf.dtype.base)
                if value.dtype.kind == "f":
                    value = np.where(np.isnan(value), np.array(math.nan, value.dtype), value)
                samples.setdefault(f"{topic[7:]}.outputs.{leaf.path}", []).append(tick + value.tobytes())
    whole = hashlib.sha256()
    for path, of in sorted(samples.items()):
        whole.update(path.encode() + b"\0" + struct.pack("<Q", len(of)) + hashlib.sha256(b"".join(of)).digest())
    return whole.hexdigest()


def test_digest_is_what_its_description_says(bag: Path, probe: Path, tmp_path: Path) -> None:
    assert digest(bag) == spelled_out(bag)
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "long")
        for k in range(30):
            twin.set_state(("ACTIVE", twin.machine.states[0])[k % 2])
            twin.tick(1 + 17 * k)
    assert digest(tmp_path / "long") == spelled_out(tmp_path / "long")
    file = next((tmp_path / "long").glob("*.mcap"))
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    assert digest(tmp_path / "long") == spelled_out(tmp_path / "long")


@pytest.mark.parametrize(
    ("topic", "change", "reason"),
    [
        ("/probe/echo", lambda data: data[:-1], r"a message of `/probe/echo` \(\d+ bytes\) does not match its schema"),
        ("/probe/echo", lambda data: b"", r"a message of `/probe/echo` \(0 bytes\) does not match its schema"),
        ("/probe/echo", lambda data: b"\0\0" + data[2:], r"a message of `/probe/echo` \(\d+ bytes\) does not match"),
        ("/probe/echo", lambda data: data[:12] + b"\2" + data[13:], r"a message of `/probe/echo` \(\d+ bytes\) does"),
        ("/probe/state", lambda data: data[:-3], "a message of `/probe/state` does not match its schema"),
        ("/probe/state", lambda data: data[:20], r"a message of `/probe/state` \(20 bytes\) does not match its schema"),
        ("/probe/state", lambda data: b"", r"a message of `/probe/state` \(0 bytes\) does not match its schema"),
    ],
)
def test_digest_names_a_message_that_is_damaged(
    topic: str, change: Callable[[bytes], bytes], reason: str, bag: Path, tmp_path: Path
) -> None:
    damaged = edited(bag, tmp_path / "damaged", lambda of, i, data: change(data) if (of, i) == (topic, 17) else data)
    with pytest.raises(BagError, match=reason):
        digest(damaged)


def flipped(bag: Path, wanted: tuple[str, int], at: int, bit: int = 0) -> Path:
    """A copy of the bag with one bit changed in one message (topic, number in the topic)."""

    def flip(topic: str, index: int, data: bytes) -> bytes:
        if (topic, index) != wanted:
            return data
        changed = bytearray(data)
        changed[at] ^= 1 << bit
        return bytes(changed)

    target = bag.parent / "flipped"
    shutil.rmtree(target, ignore_errors=True)
    return edited(bag, target, flip)


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(byte=st.integers(0, 31), bit=st.integers(0, 7), index=st.integers(0, 29).filter(lambda i: i != NAN_AT))
def test_digest_sees_every_bit_of_every_output(bag: Path, byte: int, bit: int, index: int) -> None:
    assert digest(flipped(bag, ("/probe/echo", index), SUM_AT + byte, bit)) != digest(bag)


def test_one_nan_is_as_good_as_another(bag: Path, probe: Path) -> None:
    copy = flipped(bag, ("/probe/echo", NAN_AT), SUM_AT)
    assert digest(copy) == digest(bag) and replay(copy, library=str(probe)).identical


# ---- replay -----------------------------------------------------------------------------------------------------------


def test_a_run_with_every_kind_of_write_is_identical(bag: Path, probe: Path, tool: Tool) -> None:
    verdict = replay(bag, library=str(probe))
    assert verdict.identical and verdict.ticks == 30 and verdict.values == 30 * (11 + 5 + 2)
    done = tool("replay", bag, "--library", probe)
    assert (done.returncode, done.stdout, done.stderr) == (0, "30 ticks, identical\n", "")


def test_sensor_frames_and_attachment_are_replayed(probe: Path, tmp_path: Path) -> None:
    run = open_run(probe, None)
    run.record(tmp_path / "run", "", True)
    run.attach()
    others = {1: struct.pack("<4d", 1, 0, 0, 0), 2: struct.pack("<i", -4), 3: b"\1"}
    run.write_channels({0: struct.pack("<3d", 1, 2, 3), **others})
    run.step(3)
    run.write_channels({0: struct.pack("<3d", 3, 2, 1), **others})
    run.step(9)  # the samples grow older than max_age_ticks: health becomes failed
    run.close()
    _, health = columns(tmp_path / "run", "source.outputs.health")
    assert health.tolist() == [0] * 9 + [2] * 3
    _, small = columns(tmp_path / "run", "source.outputs.small")
    assert set(small.tolist()) == {-4}
    assert replay(tmp_path / "run", library=str(probe)).identical


@pytest.mark.parametrize(
    ("topic", "index", "at", "report"),
    [
        (
            "/probe/echo",
            7,
            SUM_AT,
            "first divergence at tick 12 (t = 0.120000000 s)\n"
            "  path      echo.outputs.sum\n"
            "  recorded  0x400a830461368505  3.3139731974375786\n"
            "  replayed  0x400a830461368504  3.313973197437578\n",
        ),
        (
            "/probe/source",
            3,
            VEC_AT + 8,
            "first divergence at tick 8 (t = 0.080000000 s)\n"
            "  path      source.outputs.vec[1]\n"
            "  recorded  0x3fdb6db6db6db6da  0.4285714285714285\n"
            "  replayed  0x3fdb6db6db6db6db  0.42857142857142855\n",
        ),
        (
            "/probe/echo",
            29,
            -1,
            "first divergence at tick 30 (t = 0.300000000 s)\n"
            "  path      echo.outputs.health\n"
            "  recorded  0x01  'degraded'\n"
            "  replayed  0x00  'nominal'\n",
        ),
    ],
)
def test_one_flipped_bit_is_found_and_named(
    bag: Path, probe: Path, tool: Tool, topic: str, index: int, at: int, report: str
) -> None:
    copy = flipped(bag, (topic, index), at)
    done = tool("replay", copy, "--library", probe)
    assert (done.returncode, done.stdout, done.stderr) == (1, report, "")


@pytest.mark.parametrize("index", [3, NAN_AT])
def test_bits_are_compared_and_not_values(bag: Path, probe: Path, index: int) -> None:
    """0.0 == -0.0, and yet they divide differently; NaN != NaN, and yet nothing differs."""
    copy = flipped(bag, ("/probe/source", index), VEC_AT + 2 * 8 + 7, bit=7)
    found = replay(copy, library=str(probe)).divergence
    assert found is not None and (found.tick, found.path) == (5 + index, "source.outputs.vec[2]")
    assert (found.recorded, found.recorded_bits) == ("0.0", "0x0000000000000000")
    assert (found.replayed, found.replayed_bits) == ("-0.0", "0x8000000000000000")


def test_a_changed_write_or_state_is_found(bag: Path, probe: Path) -> None:
    def change(wanted: str, old: bytes, new: bytes) -> Callable[[str, int, bytes], bytes]:
        return lambda topic, i, data: data.replace(old, new, 1) if topic == wanted else data

    states = edited(bag, bag.parent / "states", change("/probe/state", b"ACTIVE\0", b"ACTIVF\0"))
    verdict = replay(states, library=str(probe))
    assert verdict.divergence is not None
    assert (verdict.divergence.tick, verdict.divergence.path) == (11, "machine.state")
    assert (verdict.divergence.recorded, verdict.divergence.replayed) == ("ACTIVF", "ACTIVE")

    names = edited(bag, bag.parent / "names", change("/probe/record/writes", b"parameters.gain", b"parameters.gaim"))
    with pytest.raises(BagError, match=r"SET `echo.parameters.gaim` at tick 5 cannot be applied: no `echo.*gaim`"):
        replay(names, library=str(probe))


@pytest.mark.parametrize("topic", ["/probe/echo", "/probe/source", "/probe/state"])
def test_a_lost_record_is_not_called_identical(bag: Path, probe: Path, tool: Tool, topic: str) -> None:
    copy = edited(bag, bag.parent / "lossy", lambda name, i, data: None if (name, i) == (topic, 20) else data)
    done = tool("replay", copy, "--library", probe)
    assert done.returncode == 1
    assert done.stdout == f"30 ticks, identical as far as the bag goes\n  `{topic}` has 29 of 30 messages\n"


def test_a_lost_checkpoint_or_whole_topic_is_said(bag: Path, probe: Path, tool: Tool) -> None:
    def without(lost: str) -> Callable[[str, int, bytes], bytes | None]:
        return lambda topic, i, data: None if topic == lost else data

    headless = edited(bag, bag.parent / "headless", without("/probe/record/checkpoint"))
    assert "the initial checkpoint is missing" in tool("replay", headless, "--library", probe).stderr
    silent = edited(bag, bag.parent / "silent", without("/probe/echo"))
    done = tool("replay", silent, "--library", probe)
    assert done.returncode == 1 and "`/probe/echo` has 0 of 30 messages" in done.stdout


def test_another_source_hash_is_refused_unless_told(bag: Path, probe: Path, renamed_probe: Path, tool: Tool) -> None:
    old_hash, new_hash = (open_run(library, None).machine.source_hash for library in (probe, renamed_probe))
    done = tool("replay", bag, "--library", renamed_probe)
    assert done.returncode == 2 and done.stdout == "" and old_hash != new_hash
    assert f"recorded  {old_hash}" in done.stderr and f"now       {new_hash}" in done.stderr
    assert "--ignore-source-hash" in done.stderr
    done = tool("replay", bag, "--library", renamed_probe, "--ignore-source-hash")
    assert done.stdout == "30 ticks, identical with the recorded parameters\n"
    assert done.stderr == (
        "fcsl replay: the sources differ: parameters come from the recorded checkpoint, not from the compiled machine\n"
    )


def test_recorded_parameters_that_are_compiled_otherwise_are_listed(
    probe: Path, renamed_probe: Path, tmp_path: Path, tool: Tool
) -> None:
    with AlgTwin.from_library(probe) as twin:
        twin.set("echo.parameters.gain", 2.5)
        twin.record(tmp_path / "run")
        twin.tick(3)
    done = tool("replay", "run", "--library", renamed_probe, "--ignore-source-hash")
    assert done.returncode == 0 and done.stdout == "3 ticks, identical with the recorded parameters\n"
    assert done.stderr.splitlines()[1:] == [
        "fcsl replay: parameters that differ: 1",
        "fcsl replay:   echo.parameters.gain  recorded 2.5, compiled 2.0",
    ]
    assert tool("replay", "run", "--library", probe).stderr == ""


def test_at_most_ten_differing_parameters_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    library, name = build_config("examples/lander/fc/lander_control.json")
    run = open_run(library, name)
    try:
        notes = parameter_notes(b"\x01" * run.machine.size, run)
    finally:
        run.close()
    listed = [note for note in notes if ", compiled " in note]
    assert len(notes) == 13 and len(listed) == 10
    assert int(notes[1].rsplit(" ", 1)[1]) == 10 + int(notes[-1].split()[2])


def test_another_layout_can_only_be_compared_from_tick_0(probe: Path, grown_probe: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "fresh")
        twin.tick(3)
    verdict = replay(tmp_path / "fresh", library=str(grown_probe), ignore_source_hash=True)
    assert verdict.divergence is not None and verdict.divergence.path == "echo.outputs.extra"
    assert verdict.divergence.recorded == "not recorded" and verdict.divergence.tick == 0
    fly(probe, tmp_path / "late")
    with pytest.raises(BagError, match="starts at tick 5 from a checkpoint of another layout"):
        replay(tmp_path / "late", library=str(grown_probe), ignore_source_hash=True)


# ---- incomplete bags --------------------------------------------------------------------------------------------------


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_truncated_bag_is_read_as_far_as_it_goes(bag: Path, probe: Path, data: st.DataObject) -> None:
    whole = (bag / "run_0.mcap").read_bytes()
    size = data.draw(st.integers(8, len(whole) - 1))
    cut = bag.parent / "cut.mcap"
    cut.write_bytes(whole[:size])
    opened = Bag(cut)
    assert opened.truncated
    try:
        verdict = replay(opened, library=str(probe))
    except BagError as error:
        assert (
            "before the first record" in str(error) or "checkpoint is missing" in str(error) or "no topic" in str(error)
        )
    else:
        assert verdict.divergence is None and not verdict.identical and 0 <= verdict.ticks <= 30


def test_a_recording_that_was_killed_can_be_replayed(probe: Path, tmp_path: Path, tool: Tool) -> None:
    code = (
        "import os, signal, sys, time; from simclient import AlgTwin\n"
        "twin = AlgTwin.from_library(sys.argv[1]); twin.record(sys.argv[2])\n"
        "for k in range(20000): twin.set('source.outputs.real', k * 0.1); twin.tick()\n"
        "time.sleep(2); os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(probe), str(tmp_path / "killed")], env=os.environ)
    assert done.returncode == -signal.SIGKILL
    replayed = tool("replay", "killed", "--library", probe)
    assert replayed.returncode == 1 and "identical as far as the bag goes" in replayed.stdout
    assert "the bag is incomplete: killed_0.mcap was not closed after" in replayed.stdout
    assert int(replayed.stdout.split()[0]) > 1000
    summed = tool("bag", "digest", "killed")
    assert summed.returncode == 1 and "incomplete" in summed.stderr


def test_a_tick_from_nowhere_does_not_run_for_ever(bag: Path, probe: Path) -> None:
    tick_at = VEC_AT - 8
    with pytest.raises(BagError, match="`/probe/source` is 281474976710657 ticks later than"):
        replay(flipped(bag, ("/probe/source", 5), tick_at + 6), library=str(probe))


def test_damage_inside_is_noticed(bag: Path, probe: Path, tool: Tool) -> None:
    file = bag / "run_0.mcap"
    whole = bytearray(file.read_bytes())
    whole[len(whole) // 4] ^= 0xFF
    file.write_bytes(whole)
    done = tool("replay", bag, "--library", probe)
    assert done.returncode != 0 and "incomplete" in done.stdout + done.stderr or "missing" in done.stderr


# ---- the command line -------------------------------------------------------------------------------------------------


def test_bad_command_lines(bag: Path, probe: Path, tool: Tool) -> None:
    cases: list[tuple[list[Any], str]] = [
        ([bag], "one of the arguments --config --library is required"),
        ([bag, "--library", probe, "-o", "x"], "-o needs --map"),
        ([bag, "--library", "absent.so"], "no such machine library"),
        ([bag, "--library", probe, "--machine", "other"], "no machine `other`; it holds /probe"),
        (["absent", "--library", probe], "no such bag"),
    ]
    for arguments, reason in cases:
        done = tool("replay", *arguments)
        assert done.returncode == 2 and reason in done.stderr, done.stderr
