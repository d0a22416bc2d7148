# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node `viewer`: shows the robot in a browser, and passes on what is asked for there.

Entry point: `node`. Beside it are the requests to other nodes. Imports `isotruss_ros.viewer`,
`nodes.framework` and the core.
"""
