"""Random streams by name: adding an agent, a sensor or a plot never changes anybody else's draws."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.random import Generator


def stream(seed: int, *names: str | int) -> "Generator":
    """The generator of one purpose.

    A Philox counter-based generator (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011)
    keyed by a hash of the seed and the names; the same arguments give the same draws on every machine.
    """
    from numpy.random import Generator, Philox

    return Generator(Philox(key=stream_key(seed, *names)))


def stream_key(seed: int, *names: str | int) -> int:
    """128 bits that follow from the seed and the names."""
    from hashlib import blake2b

    return int.from_bytes(blake2b(repr((seed, *names)).encode(), digest_size=16).digest(), "little")
