# SPDX-License-Identifier: Apache-2.0
"""Data that passes hand to one another: types, operations, the typed IR, programs and machines."""
