# SPDX-License-Identifier: Apache-2.0
"""The MCAP writer behind fcsl_mcap_writer.h, read back by two independent readers."""

import resource
import signal
import subprocess
from pathlib import Path

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from native import MCAP_WRITE
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

COUNT = 10_000


def write(path: Path, end: str, *, limit_bytes: int | None = None) -> subprocess.CompletedProcess[str]:
    def limit() -> None:
        if limit_bytes is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # the write then fails with EFBIG, much like a full disk
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    return subprocess.run(
        [MCAP_WRITE, path, str(COUNT), end], capture_output=True, text=True, timeout=60, preexec_fn=limit, check=False
    )


def whole_messages(path: Path) -> int:
    """Messages that stand in the file before it breaks off."""
    count = 0
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                count += type(record).__name__ == "Message"
        except Exception:  # the reader has many ways to say that the file ends too soon
            pass
    return count


def rosbags_messages(path: Path) -> int:
    """Messages that rosbags finds; it refuses a file that does not end as MCAP does."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        return sum(1 for _ in reader.messages())


def test_mcap_reader(tmp_path: Path) -> None:
    bag = tmp_path / "a.mcap"
    assert write(bag, "close").returncode == 0
    with bag.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        assert reader.get_header().library.startswith("fcsl")
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == COUNT
        assert summary.statistics.chunk_count >= 4
        (channel,) = summary.channels.values()
        assert channel.topic == "/text" and channel.metadata == {"offered_qos_profiles": "", "topic_type_hash": "none"}
        messages = list(reader.iter_messages())
        assert [m.sequence for _, _, m in messages] == list(range(COUNT))
        assert [m.log_time for _, _, m in messages] == [i * 1_000_000 for i in range(COUNT)]
        assert all(m.publish_time == m.log_time + 1 for _, _, m in messages)
        (metadata,) = reader.iter_metadata()
        assert metadata.name == "fcsl" and metadata.metadata == {"source_hash": "00ff"}


def test_rosbags(tmp_path: Path) -> None:
    bag = tmp_path / "a.mcap"
    assert write(bag, "close").returncode == 0
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        texts = [reader.deserialize(raw, c.msgtype).data for c, _, raw in reader.messages()]
    assert len(texts) == COUNT and all(len(text) == 99 for text in texts)


def test_what_was_flushed_survives_kill(tmp_path: Path) -> None:
    bag = tmp_path / "a.mcap"
    assert write(bag, "kill").returncode == -signal.SIGKILL
    assert whole_messages(bag) == rosbags_messages(bag) == COUNT


def test_never_overwrites(tmp_path: Path) -> None:
    bag = tmp_path / "a.mcap"
    bag.write_text("precious", encoding="utf-8")
    result = write(bag, "close")
    assert (result.returncode, result.stdout) == (1, "opening: File exists\n")
    assert bag.read_text(encoding="utf-8") == "precious"


def test_missing_folder(tmp_path: Path) -> None:
    result = write(tmp_path / "no" / "a.mcap", "close")
    assert (result.returncode, result.stdout) == (1, "opening: No such file or directory\n")


def test_full_disk_is_an_error_and_keeps_what_was_written(tmp_path: Path) -> None:
    bag = tmp_path / "a.mcap"
    result = write(bag, "close", limit_bytes=500_000)
    assert (result.returncode, result.stdout) == (1, "writing: File too large\n")
    assert 1000 < whole_messages(bag) == rosbags_messages(bag) < COUNT
