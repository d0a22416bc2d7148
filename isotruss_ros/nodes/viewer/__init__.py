# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `viewer`: live view of the robot in a browser, with requests from the browser.

Entry point: `node`. `view_requests` has the requests to other nodes. Imports
`isotruss_ros.viewer`, `nodes.framework` and the core.
"""
