"""How libraries are imported that may not be installed."""

from collections.abc import Iterator
from contextlib import contextmanager

from gamms.errors import MissingExtra


@contextmanager
def needing(feature: str, extra: str) -> Iterator[None]:
    """Import a library that a feature needs in the `with` block.

    Raises:
        MissingExtra (ImportError): it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise MissingExtra(feature, extra) from error
