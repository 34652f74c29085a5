# SPDX-License-Identifier: Apache-2.0
"""`views` in bags: the recorder's one message, what reads it, and the tools that do not depend on it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from native import Refused, Run
from rosbags.highlevel import AnyReader

from simclient import AlgTwin, BagError
from simclient.bag import Bag
from simclient.bag.diff import diff
from simclient.bag.digest import digest
from simclient.bag.info import describe
from simclient.bag.repair import repair
from simclient.replay import replay
from simclient.replay.cut import cut

NAV = """class Nav:
    outputs = {"height": "f64 m"}
    def execute(self):
        self.height += 0.5
"""
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "algorithms": {"Nav": {"source": "nav.py"}},
    "instances": {"nav": {"algorithm": "Nav"}},
    "states": {"RUN": {"schedule": {"nav": 100}}},
}
VIEWS = {"panels": [{"title": "Höhe", "estimate": ["nav.outputs.height"]}]}
TEXT = '{"panels":[{"angles":false,"estimate":["nav.outputs.height"],"title":"H\\u00f6he"}]}'
TOPIC = "/craft/record/views"


def craft(folder: Path, views: Any = None) -> Path:
    """A machine JSON; two of them are of one source."""
    folder.mkdir(exist_ok=True)
    (folder / "nav.py").write_text(NAV)
    (folder / "craft.json").write_text(json.dumps(CONFIG if views is None else {**CONFIG, "views": views}))
    return folder / "craft.json"


def fly(config: Path, bag: Path, ticks: int = 20) -> Path:
    with AlgTwin.from_config(config) as twin:
        twin.record(bag)
        twin.tick(ticks)
    return bag


def text_of(bag: Path) -> str:
    opened = Bag(bag)
    return opened.views(opened.machine())


def with_message(bag: Path, target: Path, data: bytes) -> Path:
    """A copy whose message of views is this."""
    target.mkdir()
    channels: dict[int, int] = {}
    with next(bag.glob("*.mcap")).open("rb") as source, (target / "edited.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start()
        for schema, channel, message in make_reader(source).iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            told = data if channel.topic == TOPIC else message.data
            writer.add_message(channels[channel.id], message.log_time, told, message.publish_time)
        writer.finish()
    return target


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("craft")
    return fly(craft(folder / "source", VIEWS), folder / "flight")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plain")
    return fly(craft(folder / "source"), folder / "flight")


def test_a_bag_has_them_once_and_any_reader_reads_them(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        (topic,) = [c for c in reader.connections if c.topic == TOPIC]
        messages = [reader.deserialize(raw, topic.msgtype) for _, _, raw in reader.messages([topic])]
        first = next(connection.topic for connection, _, _ in reader.messages())
    assert topic.msgtype == "std_msgs/msg/String" and [m.data for m in messages] == [TEXT] and first == TOPIC
    assert text_of(bag) == TEXT and f"{TOPIC} std_msgs/msg/String 1" in " ".join(describe(Bag(bag)).split())


def test_a_machine_without_views_has_none(plain: Path) -> None:
    opened = Bag(plain)
    assert opened.views(opened.machine()) == "" and opened.topics[TOPIC].count == 0 and opened.notes == []


def test_a_bag_replays_after_an_edit_of_the_views(bag: Path, tmp_path: Path) -> None:
    for name, views in (("none", None), ("others", {**VIEWS, "panels": VIEWS["panels"] * 2})):
        verdict = replay(bag, config=str(craft(tmp_path / name, views)))
        assert verdict.identical and verdict.ticks == 20 and verdict.notes == [], str(verdict)


def test_digest_and_diff_do_not_depend_on_them(bag: Path, plain: Path) -> None:
    assert digest(bag) == digest(plain)
    assert diff(Bag(bag), Bag(plain)).same
    with pytest.raises(BagError, match="have no topic in common that could be compared"):
        diff(Bag(bag), Bag(plain), topics=[TOPIC])


def test_every_cut_keeps_them(bag: Path, plain: Path, tmp_path: Path) -> None:
    for begin, end in ((0, 10**9), (50_000_000, 10**9), (100_000_000, 120_000_000), (-(2**62), 0)):
        part = tmp_path / f"{begin}"
        cut(Bag(bag), part, begin, end)
        opened = Bag(part)
        assert opened.topics[TOPIC].count == 1 and opened.views(opened.machine()) == TEXT
        assert all(max(begin, 0) <= at <= end for _, at, _ in opened.messages())
    cut(Bag(plain), tmp_path / "plain", 50_000_000, 10**9)
    assert text_of(tmp_path / "plain") == ""


def test_a_repaired_bag_has_them(bag: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    broken.mkdir()
    data = next(bag.glob("*.mcap")).read_bytes()
    (broken / "broken_0.mcap").write_bytes(data[: len(data) // 2])
    repair(broken)
    assert text_of(broken) == TEXT


@pytest.mark.parametrize(
    "message",
    [
        b"\0\1\0\0" + (70_001).to_bytes(4, "little") + b"x" * 70_000 + b"\0",
        b"\0\1\0\0\xff\xff\xff\xff" + b"{}",
        b"\0\1\0\0\3\0\0\0\xff\xfe\0",
        b"\0",
    ],
)
def test_a_message_that_cannot_be_read_is_told_once_and_ignored(bag: Path, tmp_path: Path, message: bytes) -> None:
    opened = Bag(with_message(bag, tmp_path / "edited", message))
    assert [opened.views(opened.machine()) for _ in range(2)] == ["", ""]
    (note,) = opened.notes
    assert TOPIC in note and note.endswith("; it is ignored")


# ---- a host's own ---------------------------------------------------------------------------------------------------


def test_a_host_may_set_its_own(tmp_path: Path) -> None:
    run = Run()
    run.call("fcsl_run_set_views", b'{"panels":[1]}')
    run.call("fcsl_run_set_views", b'{"panels":[1,2]}')
    run.record(tmp_path / "own")
    with pytest.raises(Refused, match="views are set before recording begins"):
        run.call("fcsl_run_set_views", b"")
    run.step(3)
    run.call("fcsl_run_close")
    assert text_of(tmp_path / "own") == '{"panels":[1,2]}'


def test_the_largest_that_there_may_be(tmp_path: Path) -> None:
    run, text = Run(), "x" * 65_535
    run.call("fcsl_run_set_views", text.encode())
    with pytest.raises(Refused, match="the views have more than 65535 bytes"):
        run.call("fcsl_run_set_views", text.encode() + b"x")
    run.record(tmp_path / "large")
    run.step(3)
    run.call("fcsl_run_close")
    assert text_of(tmp_path / "large") == text
