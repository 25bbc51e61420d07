"""Named factories, filled by engines and by installed packages."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Generic, TypeVar

from gamms.errors import Duplicate, MissingExtra, UnknownName

T = TypeVar("T")


class Registry(Generic[T]):
    """Factories of one kind of object, by name.

    An installed package adds a name through an entry point of the registry's group.

    Args:
        kind: the kind of object, for error messages.
        group: the group of entry points.
        home: the module that registers the factory "gamms"; imported on first use.
    """

    def __init__(self, kind: str, group: str, home: str = "") -> None:
        self._kind = kind
        self._group = group
        self._home = home
        self._factories: dict[str, Callable[..., T]] = {}

    def register(self, name: str) -> Callable[[Callable[..., T]], Callable[..., T]]:
        """Decorator: register a factory under `name`.

        Raises:
            Duplicate: the name is taken.
        """

        def keep(factory: Callable[..., T]) -> Callable[..., T]:
            if name in self._factories:
                raise Duplicate(f"a {self._kind}", name)
            self._factories[name] = factory
            return factory

        return keep

    def __getitem__(self, name: str) -> Callable[..., T]:
        if name == "gamms" and self._home:
            import_module(self._home)
        if name in self._factories:
            return self._factories[name]
        from importlib.metadata import entry_points

        for entry in entry_points(group=self._group, name=name):
            factory: Callable[..., T] = entry.load()
            return factory
        raise UnknownName(self._kind, name, self)

    def __iter__(self) -> Iterator[str]:
        from importlib.metadata import entry_points

        yield from self._factories
        yield from (entry.name for entry in entry_points(group=self._group))


@contextmanager
def require_extra(feature: str, extra: str) -> Iterator[None]:
    """Import a library that a feature needs in the `with` block.

    Raises:
        MissingExtra (ImportError): it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise MissingExtra(feature, extra) from error
