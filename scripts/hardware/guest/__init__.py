# SPDX-License-Identifier: Apache-2.0
"""What programs in the guest use: devices that appear, change and go away. Nothing here works outside of it."""
