"""Keyed draws: 64 random bits that follow from a seed, a purpose, a name, a turn and a number, and nothing else."""

from hashlib import blake2b

MASK = (1 << 64) - 1
GAMMA = 0x9E3779B97F4A7C15


def bits(seed, purpose, name, turn, k=0):
    """Return draw number `k` of an agent, or of whatever else bears the name, in a turn.

    Args:
        seed: of the game.
        purpose: what is drawn, a tuple of texts and numbers.
        name: of whom it is drawn for; or its key.
        turn: the number of the turn.
        k: how many numbers were drawn before.
    """
    return bits_of(hashed(repr((seed, *purpose))), name, turn, k)


def bits_of(purpose, name, turn, k=0):
    """Return the same for the key of a purpose, a number of 64 bits."""
    if isinstance(name, str):
        name = hashed(name)
    turn_key = mix(first_key(purpose, name) + turn * GAMMA)
    return mix(turn_key + (k + 1) * GAMMA)


def bits_of_pair(seed, purpose, one, other, turn):
    """Return 64 random bits for two names, in this order."""
    return bits(seed, purpose, mix(hashed(one)) ^ hashed(other), turn)


def first_key(purpose, name):
    """Return where the draws of one purpose and name begin: SipHash-2-4 of the eight bytes of the name.

    Aumasson and Bernstein, "SipHash: a fast short-input PRF" (INDOCRYPT 2012).
    """
    keys = (purpose, mix(purpose), purpose, mix(purpose))
    texts = (b"somepseu", b"dorandom", b"lygenera", b"tedbytes")
    v0, v1, v2, v3 = (key ^ int.from_bytes(text, "big") for key, text in zip(keys, texts, strict=True))
    for block in (name, 8 << 56):  # the last block says how many bytes there are
        v0, v1, v2, v3 = sip_round(*sip_round(v0, v1, v2, v3 ^ block))
        v0 ^= block
    v2 ^= 0xFF
    for _ in range(4):
        v0, v1, v2, v3 = sip_round(v0, v1, v2, v3)
    return v0 ^ v1 ^ v2 ^ v3


def sip_round(v0, v1, v2, v3):
    """Return the state of SipHash after a round."""
    v0, v2 = (v0 + v1) & MASK, (v2 + v3) & MASK
    v1, v3 = rotated(v1, 13) ^ v0, rotated(v3, 16) ^ v2
    v0 = rotated(v0, 32)
    v2, v0 = (v2 + v1) & MASK, (v0 + v3) & MASK
    v1, v3 = rotated(v1, 17) ^ v2, rotated(v3, 21) ^ v0
    return v0, v1, rotated(v2, 32), v3


def rotated(number, places):
    """Return 64 bits rotated to the left."""
    return (number << places) & MASK | number >> (64 - places)


def hashed(text):
    """Return the first 8 bytes of the BLAKE2b hash of a text as a number."""
    return int.from_bytes(blake2b(text.encode(errors="surrogatepass"), digest_size=8).digest(), "little")


def mix(number):
    """Return the finalizer of SplitMix64."""
    number &= MASK
    number = ((number ^ number >> 30) * 0xBF58476D1CE4E5B9) & MASK
    number = ((number ^ number >> 27) * 0x94D049BB133111EB) & MASK
    return number ^ number >> 31


def fraction(number):
    """Return a number in [0, 1) that random bits choose."""
    return (number >> 11) * 2.0**-53


def below(number, n):
    """Return a number from 0 to n - 1 that random bits choose."""
    return (number >> 32) * n >> 32


class Draw:
    """What an agent draws by in a turn: `state["draw"]`."""

    def __init__(self, seed, name, turn):
        self.given = (seed, ("agent",), name, turn)
        self.count = 0

    def random(self):
        """Return a number in [0, 1)."""
        return fraction(self._next())

    def below(self, n):
        """Return a number from 0 to n - 1."""
        return below(self._next(), n)

    def choice(self, options):
        """Return one of the options."""
        return options[self.below(len(options))]

    def _next(self):
        self.count += 1
        return bits(*self.given, self.count - 1)
