"""The random numbers of the games of this folder, by the definition of the reference."""

from hashlib import blake2b

from numpy.random import Generator, Philox

import reference.draws
from reference.draws import Draw, bits

__all__ = ["Draw", "bits", "fraction", "stream"]


def fraction(*key):
    """Return a number in [0, 1); see `reference.draws.bits`."""
    return reference.draws.fraction(bits(*key))


def stream(seed, *names):
    """Return the generator of a purpose."""
    key = blake2b(repr((seed, *names)).encode(), digest_size=16).digest()
    return Generator(Philox(key=int.from_bytes(key, "little")))
