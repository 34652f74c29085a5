# SPDX-License-Identifier: Apache-2.0
"""Reads machine JSON and Python as text with spans. Neither is executed."""
