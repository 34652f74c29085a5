# SPDX-License-Identifier: Apache-2.0
"""Simulated time, its vehicles and their topics."""
