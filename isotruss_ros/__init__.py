# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
