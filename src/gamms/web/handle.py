"""What programs hold of what they serve: it can be waited for, and ends with a `with` block."""

import threading
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import Self

from gamms.workers import SIGNALS_S


class Handle(ABC):
    """What is served, until `close`; usable in a `with` statement."""

    _is_closed: threading.Event

    @abstractmethod
    def close(self) -> None:
        """End the server."""

    def stay_open(self) -> None:
        """Serve on until `close` or Ctrl-C."""
        with suppress(KeyboardInterrupt):
            while not self._is_closed.wait(SIGNALS_S):
                pass

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
