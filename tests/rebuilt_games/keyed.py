"""The random numbers of the games of this folder, by the definition of the reference."""

from hashlib import blake2b

import plain_game.draws
from numpy.random import Generator, Philox
from plain_game.draws import Draw, bits, bits_of_pair

__all__ = ["Draw", "bits_of_pair", "fraction", "stream"]


def fraction(*key):
    """Return a number in [0, 1); see `plain_game.draws.bits`."""
    return plain_game.draws.fraction(bits(*key))


def stream(seed, *names):
    """Return the generator of a purpose."""
    key = blake2b(repr((seed, *names)).encode(), digest_size=16).digest()
    return Generator(Philox(key=int.from_bytes(key, "little")))
