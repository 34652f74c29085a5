# SPDX-License-Identifier: Apache-2.0
"""What every node has: start and end of the process, options, polled subscriptions; names of machines and addresses."""
