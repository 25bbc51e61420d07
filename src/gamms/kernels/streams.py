"""Random streams by name: adding an agent, a sensor or a plot never changes anybody else's draws."""

from hashlib import blake2b

import numpy as np


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """The generator of one purpose.

    A Philox counter-based generator (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011)
    keyed by a hash of the seed and the names; the same arguments give the same draws on every machine.
    """
    digest = blake2b(repr((seed, *names)).encode(), digest_size=16).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest, "little")))
