"""The random numbers of a game, written again from their definition: SipHash-2-4 and SplitMix64 with keys."""

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


def rotated(bits, places):
    return ((bits << places) & MASK) | (bits >> (64 - places))


def scrambled(v0, v1, v2, v3):
    """Return the state of SipHash after a round."""
    v0, v2 = (v0 + v1) & MASK, (v2 + v3) & MASK
    v1, v3 = rotated(v1, 13) ^ v0, rotated(v3, 16) ^ v2
    v0 = rotated(v0, 32)
    v2, v0 = (v2 + v1) & MASK, (v0 + v3) & MASK
    v1, v3 = rotated(v1, 17) ^ v2, rotated(v3, 21) ^ v0
    return v0, v1, rotated(v2, 32), v3


def sip(key_0, key_1, word):
    """Return SipHash-2-4 of the eight bytes of a word."""
    v0, v1, v2, v3 = (
        key ^ int.from_bytes(text, "big")
        for key, text in zip(
            (key_0, key_1, key_0, key_1), (b"somepseu", b"dorandom", b"lygenera", b"tedbytes"), strict=True
        )
    )
    for block in (word, 8 << 56):  # the bytes, and the last block, which holds how many there are
        v0, v1, v2, v3 = scrambled(*scrambled(v0, v1, v2, v3 ^ block))
        v0 ^= block
    v2 ^= 0xFF
    for _ in range(4):
        v0, v1, v2, v3 = scrambled(v0, v1, v2, v3)
    return v0 ^ v1 ^ v2 ^ v3


def bits(seed, purpose, name, turn, k=0):
    """Return draw number `k` of a purpose (a tuple), a name and a turn: 64 bits."""
    of_purpose = hashed(repr((seed, *purpose)))
    key = sip(of_purpose, mixed(of_purpose), hashed(name))
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
