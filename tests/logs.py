"""What is logged during a test."""

import logging


class Logged(logging.Handler):
    """What was logged."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)

    @property
    def text(self) -> str:
        """With the details of errors, as a log has them."""
        return "\n".join(map(logging.Formatter().format, self.records))
