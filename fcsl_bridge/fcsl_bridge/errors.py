# SPDX-License-Identifier: Apache-2.0
"""What the bridge raises."""

from __future__ import annotations


class BridgeError(ValueError):
    """Something a node cannot go on with; str() is the whole message."""


class Stopped(Exception):
    """SIGINT or SIGTERM arrived while a node was waiting."""
