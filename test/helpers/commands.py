# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands within the process of the tests."""


def exit_code(main, arguments):
    """Return the exit code of a command, also if it exits while it reads its arguments."""
    try:
        return main(arguments)
    except SystemExit as end:
        return end.code
