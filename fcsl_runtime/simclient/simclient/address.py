# SPDX-License-Identifier: Apache-2.0
"""Addresses as every command of FCSL writes them: udp:HOST:PORT, tcp:HOST:PORT; an IPv6 address stands in brackets."""

from __future__ import annotations

import re


def host_and_port(text: str, kind: str) -> tuple[str, int]:
    """Of an address of this kind (`udp`, `tcp`). Raises ValueError, whose text says what to write."""
    found = re.fullmatch(rf"{kind}:(?:\[(?P<v6>[0-9A-Fa-f:.%\w]+)\]|(?P<host>[^\[\]:/\s]+)):(?P<port>\d{{1,5}})", text)
    if found is None or int(found["port"]) > 65535:
        raise ValueError(f"`{text[:80]}` is not an address; write {kind}:HOST:PORT, such as {kind}:127.0.0.1:7000")
    return found["v6"] or found["host"], int(found["port"])
