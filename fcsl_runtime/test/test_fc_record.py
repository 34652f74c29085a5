# SPDX-License-Identifier: Apache-2.0
"""Recordings that a client begins: ticks that it makes may wait for the disk, those that the clock makes may not."""

from __future__ import annotations

import time
from pathlib import Path

from native import flying
from test_record_faults import small_disk  # noqa: F401 (a fixture)


def test_a_full_disk_does_not_end_a_flight(small_disk: Path, tmp_path: Path) -> None:  # noqa: F811
    """Told once, counted, flown on; and the next recording, on a disk with room, is whole."""
    path = tmp_path / "s"
    with flying("--socket", path, "--paused") as fc:
        client = fc.client(path)
        client.ok("record", bag=str(small_disk / "bag"))
        with open(small_disk / "filler", "wb", buffering=0) as filler:
            try:
                while True:
                    filler.write(bytes(4096))
            except OSError:
                pass
        client.ok("resume")
        deadline = time.monotonic() + 60
        while client.ok("stats")["records_dropped"] == 0:
            assert time.monotonic() < deadline
        flown = client.ok("state")["tick"]
        while client.ok("state")["tick"] < flown + 50:
            assert time.monotonic() < deadline
        client.ok("pause")
        assert "No space left" in client.error("stop_recording")["message"]
        client.ok("record", bag=str(tmp_path / "bag"))
        client.ok("tick", count=20)
        client.ok("stop_recording")
        assert client.ok("stats")["records_dropped"] == 0 and (tmp_path / "bag/metadata.yaml").exists()
        client.close()
        status, _, said = fc.stop()
    assert status == 0 and said.count("No space left") == 1
