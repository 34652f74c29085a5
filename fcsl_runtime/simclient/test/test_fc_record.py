# SPDX-License-Identifier: Apache-2.0
"""Recordings that a client begins: ticks that it makes may wait for the disk, those that the clock makes may not."""

from __future__ import annotations

import time
from pathlib import Path

from native import flying
from test_record_faults import small_disk  # noqa: F401 (a fixture)


def test_a_client_that_makes_ticks_hears_of_its_recording(small_disk: Path, tmp_path: Path) -> None:  # noqa: F811
    """Its ticks fail as a twin's do, until it stops the recording; then it goes on."""
    path = tmp_path / "s"
    with flying("--socket", path, "--paused") as fc:
        client = fc.client(path)
        client.ok("record", bag=str(small_disk / "bag"))
        reply = client("tick", count=1000)
        while reply["ok"]:
            reply = client("tick", count=1000)
        assert reply["error"]["code"] == "failed" and "No space left" in reply["error"]["message"]
        ticks = client.ok("state")["tick"]
        assert client.error("tick")["message"] == reply["error"]["message"] and client.ok("state")["tick"] == ticks
        assert "No space left" in client.error("stop_recording")["message"]
        assert client.ok("tick", count=5)["tick"] == ticks + 5
        client.close()
        assert fc.stop()[0] == 0


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
