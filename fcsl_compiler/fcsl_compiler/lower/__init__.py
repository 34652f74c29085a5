# SPDX-License-Identifier: Apache-2.0
"""Rewrites IR to a form that yields efficient C."""
