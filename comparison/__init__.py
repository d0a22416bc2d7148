# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Our model against MuJoCo's, number by number: `make plant` writes docs/plant.md."""
