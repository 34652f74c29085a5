# SPDX-License-Identifier: Apache-2.0
"""The conversation in docs/reference/variables.md matches fcsl-fc's actual replies."""

import socket
import subprocess
import time
from pathlib import Path

from fcsl_compiler.base.packages import package_prefix

DOCUMENT = Path(__file__).resolve().parents[1] / "docs/reference/variables.md"


def test_conversation(tmp_path: Path) -> None:
    lines = [line for line in DOCUMENT.read_text().splitlines() if line.startswith(("> ", "< "))]
    requests = [line[2:] for line in lines if line[0] == ">"]
    replies = [line[2:] for line in lines if line[0] == "<"]
    assert len(requests) == len(replies) >= 16
    library = Path(package_prefix("minimal")) / "lib/minimal/libminimal_machines.so"
    path = tmp_path / "fc.sock"
    process = subprocess.Popen(
        ["fcsl-fc", str(library), "--socket", str(path), "--paused", "--checkpoints", str(tmp_path)],
        stdout=subprocess.PIPE,
    )
    try:
        assert process.stdout is not None and process.stdout.readline().startswith(b"fcsl-fc: machine 'minimal'")
        client = socket.socket(socket.AF_UNIX)
        client.settimeout(10)
        deadline = time.monotonic() + 10
        while client.connect_ex(str(path)) != 0:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        stream = client.makefile("rw")
        for request, reply in zip(requests, replies, strict=True):
            stream.write(request + "\n")
            stream.flush()
            assert stream.readline().rstrip("\n") == reply
    finally:
        process.terminate()
        assert process.wait(timeout=10) == 0
