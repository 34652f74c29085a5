# SPDX-License-Identifier: Apache-2.0
"""Where simulator and controller meet: on the bus, or on a Unix socket (docs/reference/transports.md)."""

from __future__ import annotations

import os

from ..errors import BridgeError
from .node_main import Option

#: One for each ROS domain (0 to 232), all below the ports that Linux gives to outgoing connections.
_FIRST_PORT = 7500
_LAST_DOMAIN = 232
_UNIX = "unix:"

OPTION = Option(
    "bus",
    str,
    "",
    "lockstep: where the nodes meet, tcp:HOST:PORT, by default a port of 127.0.0.1 by ROS domain; or unix:PATH, faster",
)


def endpoint(given: str) -> str:
    """The parameter's value, or tcp:127.0.0.1:PORT, which differs from domain to domain. Raises BridgeError."""
    if given:
        return given
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal() or int(text) > _LAST_DOMAIN:
        raise BridgeError(f"ROS_DOMAIN_ID is `{text}`; it is a number from 0 to {_LAST_DOMAIN}")
    return f"tcp:127.0.0.1:{_FIRST_PORT + int(text)}"


def peer_address(where: str, name_space: str, is_client: bool = False) -> str:
    """The same for native code. Each vehicle has a socket of its own: behind the path stands its namespace, as in
    /tmp/lander-one. On the bus all share one port, and those behind the first are its clients."""
    if where.startswith(_UNIX):
        return f"wire:{where}" + "".join(f"-{part}" for part in name_space.split("/") if part)
    return f"zenoh-client:{where}" if is_client else f"zenoh:{where}"
