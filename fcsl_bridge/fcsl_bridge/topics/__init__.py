# SPDX-License-Identifier: Apache-2.0
"""Topics: message classes, quality of service, publishers and subscriptions of machines, transforms."""
