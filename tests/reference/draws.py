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
    return bits(seed, purpose, repr((one, other)), turn)


def first_key(purpose, name):
    """Return where the draws of one purpose and name begin."""
    return mix(purpose ^ name)


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
