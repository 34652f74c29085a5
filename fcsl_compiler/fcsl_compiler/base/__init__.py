# SPDX-License-Identifier: Apache-2.0
"""What every part of the compiler stands on: sources, spans, diagnostics and their codes, files."""
