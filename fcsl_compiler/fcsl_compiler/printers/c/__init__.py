# SPDX-License-Identifier: Apache-2.0
"""The printer for C11."""
