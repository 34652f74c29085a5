# SPDX-License-Identifier: Apache-2.0
"""Base of all parts of the compiler: sources, spans, diagnostics and their codes, files."""
