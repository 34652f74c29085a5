# SPDX-License-Identifier: Apache-2.0
"""Flights of the craft of craft/ on the devices of guest/. craft.py builds it on the host; the other modules run in the guest."""
