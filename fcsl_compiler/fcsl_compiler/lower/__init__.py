# SPDX-License-Identifier: Apache-2.0
"""IR nearer to good C."""
