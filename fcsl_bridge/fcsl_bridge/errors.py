# SPDX-License-Identifier: Apache-2.0
"""The exceptions of the bridge."""

from __future__ import annotations


class BridgeError(ValueError):
    """An error that ends a node or an operation; str() is the complete message."""


class Stopped(Exception):
    """SIGINT or SIGTERM arrived while a node was waiting."""
