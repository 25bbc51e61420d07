"""Actions that strategies and callers give, in arrays of any library."""

from types import ModuleType
from typing import Any

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.game.batch.libraries import Tensor
from gamms.text import shown


def as_actions(given: object, by: str) -> Any:
    """Return actions that `by` has given as an array.

    Raises:
        BadType: they are lists of several lengths.
    """
    try:
        return np.asarray(given)
    except ValueError:
        raise BadType(f"{by}: actions are the numbers of legal nodes, not {shown(given)}.") from None


def refuse_no_actions(given: Tensor, shape: tuple[int, ...], by: str, xp: ModuleType) -> None:
    """Refuse arrays of a library, the namespace `xp`, that are no integers, or not one for each game and agent.

    Raises:
        BadType, BadValue: they are none; the messages begin with `by`, what has given them.
    """
    # NOTE: isdtype of NumPy takes 3 us, more than all else of this (benchmarks: batches).
    is_integer = given.dtype.kind in "iu" if xp is np else xp.isdtype(given.dtype, "integral")
    if not is_integer and 0 not in given.shape:
        raise BadType(f"{by}: actions are the numbers of legal nodes, not {shown(given)}.")
    if tuple(given.shape) != tuple(shape):
        raise BadValue(
            f"{by}: there is one action for each game and agent, an array {tuple(shape)}, "
            f"not one of the shape {tuple(given.shape)}."
        )
