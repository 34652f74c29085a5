# SPDX-License-Identifier: Apache-2.0
"""What is said of a controller in another process (--external)."""

#: Behind an address on the bus: neither side waits for the other.
FREE_RUNNING = ",free-running"
#: Default timeout for an external controller.
TIMEOUT_MS = 30_000
