# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `viewer`, which shows the robot in a browser and executes requests from the browser.

Entry point: `node`. The module `view_requests` contains the requests to other nodes. Imports
`isotruss_ros.viewer`, `nodes.framework` and the core.
"""
