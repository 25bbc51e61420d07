"""The random numbers of a game, written again from their definition: SplitMix64 with keys."""

from hashlib import blake2b

from numpy.random import Generator, Philox

MASK = 2**64 - 1
GAMMA = 0x9E3779B97F4A7C15


def mixed(bits):
    bits &= MASK
    bits = ((bits ^ (bits >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    bits = ((bits ^ (bits >> 27)) * 0x94D049BB133111EB) & MASK
    return bits ^ (bits >> 31)


def hashed(text, size=8):
    return int.from_bytes(blake2b(text.encode(), digest_size=size).digest(), "little")


def bits(seed, purpose, name, turn, k=0):
    """Return draw number `k` of a purpose (a tuple), a name and a turn: 64 bits."""
    key = mixed(hashed(repr((seed, *purpose))) ^ hashed(name))
    return mixed(mixed(key + turn * GAMMA) + (k + 1) * GAMMA)


def fraction(*key):
    return (bits(*key) >> 11) * 2.0**-53


class Draw:
    """What an agent draws in a turn, one number after the other."""

    def __init__(self, seed, name, turn):
        self.key, self.k = (seed, ("agent",), name, turn), -1

    def random(self):
        self.k += 1
        return fraction(*self.key, self.k)

    def choice(self, options):
        self.k += 1
        return options[((bits(*self.key, self.k) >> 32) * len(options)) >> 32]


def stream(seed, *names):
    return Generator(Philox(key=hashed(repr((seed, *names)), 16)))
