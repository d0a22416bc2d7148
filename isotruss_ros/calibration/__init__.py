# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stiffness of one's own tube, fitted to measurements."""
