# SPDX-License-Identifier: Apache-2.0
"""The machine JSON: resolves all names, orders the schedule, rejects what is inconsistent."""
