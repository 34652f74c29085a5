# SPDX-License-Identifier: Apache-2.0
"""Statuses of /diagnostics: of a machine and of a board."""
