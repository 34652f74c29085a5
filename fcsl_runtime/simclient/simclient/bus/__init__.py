# SPDX-License-Identifier: Apache-2.0
"""A tool's end of the bus (docs/reference/transports.md): machines by their descriptors, values by ticks, and the command fcsl bus."""
