"""Random streams by name: adding an agent, a sensor or a plot never changes anybody else's draws."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.random import Generator


def stream(seed: int, *names: str | int) -> "Generator":
    """The generator of one purpose.

    A Philox counter-based generator (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011)
    keyed by a hash of the seed and the names; the same arguments give the same draws on every machine.
    """
    from hashlib import blake2b

    from numpy.random import Generator, Philox

    digest = blake2b(repr((seed, *names)).encode(), digest_size=16).digest()
    return Generator(Philox(key=int.from_bytes(digest, "little")))
