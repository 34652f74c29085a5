# SPDX-License-Identifier: Apache-2.0
"""What the passes hand on: types, operations, the typed IR, programs and machines."""
