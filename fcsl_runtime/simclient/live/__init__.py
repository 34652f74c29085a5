# SPDX-License-Identifier: Apache-2.0
"""Telemetry in the rerun viewer, as it comes (docs/live_view.md); `cli` is the command fcsl-view."""
