# SPDX-License-Identifier: Apache-2.0
"""The receiver of UDP telemetry (docs/guide/monitoring.md): `Telemetry`, and the `Window` and `Counts` that it returns."""
