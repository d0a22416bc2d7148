"""Say what is wrong, but not a thousand times a second."""

from __future__ import annotations

import time

from rclpy.impl.rcutils_logger import RcutilsLogger

#: A complaint of one kind comes at most this often [s].
QUIET_TIME = 1.0


class Reporter:
    """
    Throttles warnings by kind, so that a flood of one does not hide another.

    :param logger: the node's.
    """

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._last: dict[str, float] = {}

    def warn(self, kind: str, message: str) -> None:
        """Log a warning, unless one of this kind was logged just now."""
        now = time.monotonic()
        if now - self._last.get(kind, -QUIET_TIME) >= QUIET_TIME:
            self._last[kind] = now
            self._logger.warning(message)
