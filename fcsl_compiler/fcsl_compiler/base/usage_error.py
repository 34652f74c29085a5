# SPDX-License-Identifier: Apache-2.0
"""Errors in command-line options."""


class UsageError(ValueError):
    """An option or argument that a command cannot accept. str() gives the reason. Exit status 2."""
