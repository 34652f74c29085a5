# SPDX-License-Identifier: Apache-2.0
"""Live telemetry in the rerun viewer (docs/guide/monitoring.md); `cli` is the command fcsl view."""

#: Default port of the page for browsers; the data use the next port.
WEB_PORT = 9090
#: Address of viewers on this computer, and the port of a viewer window.
ADDRESS, WINDOW_PORT = "127.0.0.1", 9876
#: Prefix of a viewer's address.
SCHEMES = ("rerun+http://", "rerun+https://", "rerun://")


def proxy(port: int) -> str:
    """The address of a viewer, or of a server for viewers, on this computer."""
    return f"rerun+http://{ADDRESS}:{port}/proxy"
