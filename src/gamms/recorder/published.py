"""What 1.0.0 offered beside the recorder's own methods: the decorator of components, and the check of their types."""

from collections.abc import Callable, Mapping

from gamms.errors import BadType
from gamms.recorder import struct_types
from gamms.typing import IContext
from gamms.typing.recorder import C


def component(ctx: IContext, struct: Mapping[str, object] | None = None) -> Callable[[C], C]:
    """Decorate a class whose declared fields are recorded; the same as `ctx.record.component(struct)`."""
    return ctx.record.component(struct)


def check_validity(data_type: object) -> None:
    """Check that a field of a component may be of this type.

    Raises:
        BadType (TypeError): it may not.
    """
    if data_type is None:
        raise BadType("The type of a field cannot be None alone. Use Optional[...] of another type.")
    struct_types.of_hint(data_type)


__all__ = ["check_validity", "component"]
