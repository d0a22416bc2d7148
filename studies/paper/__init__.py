# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regenerate the paper's tables and figures: `python -m studies.paper`, or `make paper`."""
