# SPDX-License-Identifier: Apache-2.0
"""Telemetry in the rerun viewer, as it comes (docs/live_view.md); `cli` is the command fcsl-view."""

#: Of the page for browsers, where nothing else is asked for; the data come from the port after it.
WEB_PORT = 9090
#: What the address of a viewer begins with.
SCHEMES = ("rerun+http://", "rerun+https://", "rerun://")
