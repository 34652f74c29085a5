# SPDX-License-Identifier: Apache-2.0
"""Telemetry in the rerun viewer, as it comes (docs/live_view.md); `cli` is the command fcsl-view."""

#: Of the page for browsers, where nothing else is asked for; the data come from the port after it.
WEB_PORT = 9090
#: Where viewers of this computer listen, and the port of a window.
ADDRESS, WINDOW_PORT = "127.0.0.1", 9876
#: What the address of a viewer begins with.
SCHEMES = ("rerun+http://", "rerun+https://", "rerun://")


def proxy(port: int) -> str:
    """The address of a viewer, or of a server for viewers, on this machine."""
    return f"rerun+http://{ADDRESS}:{port}/proxy"
