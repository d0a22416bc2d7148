# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The object is held fast: contact with the tubes, friction and closure, (5) to (10)."""
