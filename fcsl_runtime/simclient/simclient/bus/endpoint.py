# SPDX-License-Identifier: Apache-2.0
"""Where a session on the bus is."""

from __future__ import annotations

import re

from ..errors import BusError

_ENDPOINT = re.compile(r"tcp[:/]((?:\[[0-9a-fA-F:.%]+\]|[\w.-]+):[0-9]{1,5})")


def zenoh_locator(endpoint: str) -> str:
    """tcp:HOST:PORT as Zenoh writes it, tcp/HOST:PORT, which is accepted, too. Raises BusError."""
    found = _ENDPOINT.fullmatch(endpoint)
    if found is None:
        raise BusError(f"{endpoint} is no endpoint: write tcp:HOST:PORT, like tcp:127.0.0.1:7447")
    return f"tcp/{found[1]}"
