# SPDX-License-Identifier: Apache-2.0
"""Text with spans: machine JSON and Python, read without executing either."""
