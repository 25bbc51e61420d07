"""Lists of texts that are numbered, such as "agent_0", "agent_1", …, as columns."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadFile

FEWEST = 32  # texts: of fewer there is nothing to save
_LONGEST = 64  # characters before the number
_MOST_STEMS = 256
_MOST_DIGITS = 18
_DIGITS = "0123456789"


class Numbered(NamedTuple):
    """Each text is the stem at a place in `stems`, and its number."""

    stems: list[str]
    which: "np.ndarray[Any, np.dtype[np.uint8]]"  # (texts,)
    numbers: "np.ndarray[Any, np.dtype[np.int64]]"  # (texts,)


def numbered(texts: Sequence[Any]) -> Numbered | None:
    """A list of texts as columns; None if they are no such texts."""
    if set(map(type, texts)) != {str}:
        return None
    return _of_one_stem(texts) or _of_several_stems(texts)


def _of_one_stem(texts: Sequence[str]) -> Numbered | None:
    # NOTE: in C, for most lists of names are such, and every recording begins with some (benchmarks/README.md, w4).
    stem = texts[0].rstrip(_DIGITS)
    size = len(stem)
    if size > _LONGEST or not stem.isascii() or max(map(len, texts)) > size + _MOST_DIGITS:
        return None
    try:
        numbers = [int(text[size:]) for text in texts]
    except ValueError:
        return None
    if [f"{stem}{number}" for number in numbers] != texts or min(numbers) < 0:
        return None
    return Numbered([stem], np.zeros(len(texts), np.uint8), np.array(numbers, np.int64))


def _of_several_stems(texts: Sequence[str]) -> Numbered | None:
    stems: dict[str, int] = {}
    which, numbers = [], []
    for text in texts:
        stem = text.rstrip(_DIGITS)
        number = text[len(stem) :]
        if not number or len(number) > _MOST_DIGITS or len(stem) > _LONGEST or (number[0] == "0" and number != "0"):
            return None
        which.append(stems.setdefault(stem, len(stems)))
        if len(stems) > _MOST_STEMS or not text.isascii():
            return None
        numbers.append(int(number))
    return Numbered(list(stems), np.array(which, np.uint8), np.array(numbers, np.int64))


def texts_of(stems: Any, which: "np.ndarray[Any, Any]", numbers: "np.ndarray[Any, Any]") -> list[str]:
    """The texts again.

    Raises:
        BadFile: no writer makes this.
    """
    is_whole = which.dtype == np.uint8 and numbers.dtype == np.int64 and which.shape == numbers.shape == (len(which),)
    if not is_whole or not _are_stems(stems):
        raise BadFile("a list of numbered texts is damaged")
    if len(which) and int(which.max()) >= len(stems):
        raise BadFile("a list of numbered texts has a text without a stem")
    return [f"{stems[place]}{number}" for place, number in zip(which.tolist(), numbers.tolist(), strict=True)]


def _are_stems(stems: Iterable[Any]) -> bool:
    return type(stems) is list and all(type(one) is str and len(one) <= _LONGEST and one.isascii() for one in stems)
