# SPDX-License-Identifier: Apache-2.0
"""Compiles a machine JSON to a library: passes, C compiler, cache."""
