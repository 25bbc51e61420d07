"""Contract of the logger, and its levels (the standard library's numbers)."""

import logging
from abc import ABC, abstractmethod
from logging import CRITICAL, DEBUG, ERROR, INFO, NOTSET, WARNING


class ILogger(ABC):
    """The methods of loggers that GAMMS calls; `logging.Logger` of the standard library has them."""

    @abstractmethod
    def debug(self, msg: str, *args: object) -> None:
        """Log details for developers."""

    @abstractmethod
    def info(self, msg: str, *args: object) -> None:
        """Log an event."""

    @abstractmethod
    def warning(self, msg: str, *args: object) -> None:
        """Log a probable mistake."""

    @abstractmethod
    def error(self, msg: str, *args: object) -> None:
        """Log an error."""

    @abstractmethod
    def critical(self, msg: str, *args: object) -> None:
        """Log an error that ends the program."""

    @abstractmethod
    def setLevel(self, level: int | str) -> None:  # noqa: N802 - the standard library's name
        """Drop messages less severe than `level`."""


ILogger.register(logging.Logger)

__all__ = ["CRITICAL", "DEBUG", "ERROR", "INFO", "NOTSET", "WARNING", "ILogger"]
