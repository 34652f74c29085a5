# SPDX-License-Identifier: Apache-2.0
"""Twins, which a test steps tick by tick; conditions, traces, snapshots and profiles of them; the pytest plugin."""
