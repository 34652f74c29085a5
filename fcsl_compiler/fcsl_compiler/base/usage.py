# SPDX-License-Identifier: Apache-2.0
"""Options that cannot be honoured."""


class UsageError(ValueError):
    """An option or argument that no command can honour; str() says why. Exit status 2."""
