# SPDX-License-Identifier: Apache-2.0
"""The printer for Nim 1.6."""
