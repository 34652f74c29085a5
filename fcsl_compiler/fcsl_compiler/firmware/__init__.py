# SPDX-License-Identifier: Apache-2.0
"""Machines for processors without an operating system: static libraries, and what they need of a board."""
