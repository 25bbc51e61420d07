"""Keyed draws: random bits that follow from a seed, a purpose, a name, a turn and a count, and from nothing else.

A further agent, sensor, thread or game therefore never changes the draws of others. All numbers are 64-bit integers
without sign, so the same text gives the same bits compiled and interpreted, on every machine:

    first = SipHash-2-4 of the name under the key of the purpose
    turn  = mix(first + turn * GAMMA)
    bits  = mix(turn + (k + 1) * GAMMA)

`mix` and GAMMA are those of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators",
OOPSLA 2014). They can be inverted: an agent that sees its own bits can compute its own first key. SipHash (Aumasson and
Bernstein, "SipHash: a fast short-input PRF", INDOCRYPT 2012) keeps it from computing the key of its purpose, and so the
draws of other agents.
"""

from __future__ import annotations

from typing import Any

MASK = 0xFFFFFFFFFFFFFFFF
GAMMA = 0x9E3779B97F4A7C15
FACTOR_1 = 0xBF58476D1CE4E5B9
FACTOR_2 = 0x94D049BB133111EB
SIP_0 = 0x736F6D6570736575
SIP_1 = 0x646F72616E646F6D
SIP_2 = 0x6C7967656E657261
SIP_3 = 0x7465646279746573
EIGHT_BYTES = 0x0800000000000000
MOST = 0x100000000  # the maximum bound of `convert_to_integer`
LOW = 0xFFFFFFFF
PHILOX_0 = 0xD2E7470EE14C6C93  # factors and steps of Philox
PHILOX_1 = 0xCA5A826395121157
WEYL_0 = 0x9E3779B97F4A7C15
WEYL_1 = 0xBB67AE8584CAA73B
WORDS = 8


def mix(bits: int) -> int:
    """Return the finalizer of SplitMix64."""
    bits = ((bits ^ (bits >> 30)) * FACTOR_1) & MASK
    bits = ((bits ^ (bits >> 27)) * FACTOR_2) & MASK
    return bits ^ (bits >> 31)


def rotate_left(bits: int, places: int) -> int:
    """Return the bits rotated to the left by 1 to 63 places."""
    return ((bits << places) & MASK) | (bits >> (64 - places))


def compute_siphash(key_0: int, key_1: int, word: int) -> int:
    """Return SipHash-2-4 of the eight bytes of a word, under a key of two words."""
    v0 = key_0 ^ SIP_0
    v1 = key_1 ^ SIP_1
    v2 = key_0 ^ SIP_2
    v3 = key_1 ^ SIP_3 ^ word
    for number in range(8):
        if number == 2:
            v0 ^= word
            v3 ^= EIGHT_BYTES
        elif number == 4:
            v0 ^= EIGHT_BYTES
            v2 ^= 0xFF
        v0 = (v0 + v1) & MASK
        v1 = rotate_left(v1, 13) ^ v0
        v0 = rotate_left(v0, 32)
        v2 = (v2 + v3) & MASK
        v3 = rotate_left(v3, 16) ^ v2
        v0 = (v0 + v3) & MASK
        v3 = rotate_left(v3, 21) ^ v0
        v2 = (v2 + v1) & MASK
        v1 = rotate_left(v1, 17) ^ v2
        v2 = rotate_left(v2, 32)
    return v0 ^ v1 ^ v2 ^ v3


def compute_first_key(purpose: int, name: int) -> int:
    """Return the key of all draws for one purpose and name."""
    return compute_siphash(purpose, mix(purpose), name)


def compute_turn_key(first: int, turn: int) -> int:
    """Return the key of all draws of a `compute_first_key` in one turn; the turn may be negative."""
    return mix((first + turn * GAMMA) & MASK)


def compute_bits(key: int, k: int) -> int:
    """Return draw number `k`, from 0, of a `compute_turn_key`: 64 random bits."""
    return mix((key + (k + 1) * GAMMA) & MASK)


def convert_to_integer(bits: int, n: int) -> int:
    """Return a number from 0 to `n - 1` from random bits; `n` is from 1 to 2 ** 32."""
    return ((bits >> 32) * n) >> 32


def draw_integer(first: int, turn: int, k: int, n: int) -> int:
    """Return draw number `k` of a `compute_first_key` in a turn as a number from 0 to `n - 1`."""
    return convert_to_integer(compute_bits(compute_turn_key(first, turn), k), n)


def convert_to_fraction(bits: int) -> float:
    """Return a number in [0, 1) from random bits, a multiple of 2 ** -53."""
    return (bits >> 11) * 2.0**-53


def fill_first_keys(purposes: memoryview[int], names: memoryview[int], out: memoryview[int]) -> int:
    """Write the `compute_first_key` of each row; all arrays have the same length."""
    for i in range(len(out)):
        out[i] = compute_first_key(purposes[i], names[i])
    return 0


def fill_turn_keys(first: memoryview[int], turns: memoryview[int], out: memoryview[int]) -> int:
    """Write the `compute_turn_key` of each row; all arrays have the same length."""
    for i in range(len(out)):
        out[i] = compute_turn_key(first[i], turns[i])
    return 0


def fill_bits(keys: memoryview[int], counts: memoryview[int], out: memoryview[int]) -> int:
    """Write draw number `counts[i]` of each `compute_turn_key`; all arrays have the same length."""
    for i in range(len(out)):
        out[i] = compute_bits(keys[i], counts[i])
    return 0


# -- streams that begin a game -----------------------------------------------------------------------------------------


def compute_upper_product(a: int, b: int) -> int:
    """Return the upper 64 bits of a product, computed from 32-bit halves."""
    middle = (a >> 32) * (b & LOW) + ((a & LOW) * (b & LOW) >> 32)
    crossed = (a & LOW) * (b >> 32) + (middle & LOW)
    return (a >> 32) * (b >> 32) + (middle >> 32) + (crossed >> 32)


def put_words(key_0: int, key_1: int, out: memoryview[int], begin: int) -> int:
    """Write the first eight 32-bit numbers of a stream: Philox4x64-10 for the counter 1, as in NumPy's generator.

    Source: Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011.

    Args:
        key_0: the lower half of the key.
        key_1: the upper half.
        out: receives the numbers.
        begin: the index of the first of them.
    """
    a = 1
    b = 0
    c = 0
    d = 0
    for _ in range(10):
        lower_0 = (a * PHILOX_0) & MASK
        lower_1 = (c * PHILOX_1) & MASK
        a_next = compute_upper_product(c, PHILOX_1) ^ b ^ key_0
        c = compute_upper_product(a, PHILOX_0) ^ d ^ key_1
        a = a_next
        b = lower_1
        d = lower_0
        key_0 = (key_0 + WEYL_0) & MASK
        key_1 = (key_1 + WEYL_1) & MASK
    put_halves(a, out, begin)
    put_halves(b, out, begin + 2)
    put_halves(c, out, begin + 4)
    return put_halves(d, out, begin + 6)


def put_halves(word: int, out: memoryview[int], begin: int) -> int:
    """Write the lower and the upper half of a word."""
    out[begin] = word & LOW
    out[begin + 1] = word >> 32
    return 0


def draw_from_words(words: memoryview[int], begin: int, n: int) -> int:
    """Return the first `integers(n)` of NumPy's generator of a stream, by Lemire's method.

    Source: "Fast random integer generation in an interval" (TOMACS 2019).

    Args:
        words: the first eight numbers of the stream from index `begin`.
        begin: see `words`.
        n: from 1 to 2 ** 28.
    """
    for place in range(begin, begin + WORDS):
        if ((words[place] * n) & LOW) >= MOST % n:
            return words[place] * n >> 32
    return words[begin] * n >> 32


def fill_words(keys: memoryview[int], out: memoryview[int]) -> int:
    """Write the first eight 32-bit numbers of streams, (streams * 8,), for their keys, (streams * 2,)."""
    for i in range(len(keys) // 2):
        put_words(keys[2 * i], keys[2 * i + 1], out, WORDS * i)
    return 0


def fill_below_of_words(words: memoryview[int], n: memoryview[int], out: memoryview[int]) -> int:
    """Write `draw_from_words` of streams for their bounds; `words` is (streams * 8,), the others are (streams,)."""
    for i in range(len(out)):
        out[i] = draw_from_words(words, WORDS * i, n[i])
    return 0


def place_agents(
    keys: memoryview[int], rows: memoryview[int], words: memoryview[int], taken: memoryview[int], out: memoryview[int]
) -> int:
    """Draw different nodes for the agents of games.

    Args:
        keys: (games * agents * 2,) the keys of the agents' streams.
        rows: the nodes, at least as many as agents.
        words: (8,) working memory.
        taken: (agents,) working memory.
        out: (games * agents,) receives the nodes.
    """
    agents = len(taken)
    for row in range(len(out)):
        i = row % agents
        put_words(keys[2 * row], keys[2 * row + 1], words, 0)
        number = draw_from_words(words, 0, len(rows) - i)
        out[row] = rows[take_free(taken, i, number)]
    return 0


def take_free(taken: memoryview[int], count: int, number: int) -> int:
    """Take the free index with a number, counted from 0 among the free indices; return it.

    Args:
        taken: the first `count` are the taken indices, in ascending order; the new one is added.
        count: how many are taken.
        number: the number.
    """
    low = 0
    high = count
    while low < high:
        middle = (low + high) >> 1
        if taken[middle] - middle <= number:
            low = middle + 1
        else:
            high = middle
    for place in range(count, low, -1):
        taken[place] = taken[place - 1]
    taken[low] = number + low
    return number + low


# -- draws of turns ------------------------------------------------------------------------------------------------


class RandomChoices:
    """Random numbers of agents; rows are game by game.

    Attributes:
        keys: (rows,) the `compute_first_key` of each agent.
        counts: (rows,) the bound of each number, from 1 to 2 ** 32.
        chosen: (rows,) the drawn numbers, below the bounds.
    """

    def __init__(self, keys: memoryview[int], counts: memoryview[int], chosen: memoryview[int]) -> None:
        self.keys = keys
        self.counts = counts
        self.chosen = chosen


def choose(choices: RandomChoices, at: int, agents: memoryview[int], begin: int, end: int, turn: int) -> int:
    """Write draw number 0 of a turn for `agents[begin:end]` of the game whose first row is `at`."""
    for place in range(begin, end):
        row = at + agents[place]
        choices.chosen[row] = draw_integer(choices.keys[row], turn, 0, choices.counts[row])
    return 0


class TurnCounter:
    """A counter of turns, shared by all random streams of a game.

    Args:
        clock: an object with the attribute `turn`.
        seed: the seed of the game.

    Attributes:
        clock, seed: see the arguments.
        turn: the last turn with a draw.
        begun: the number of turns begun, under any seed; streams restart when it changes.
        seeds: the number of changes of the seed.
        before_draws: called before the first draw in a turn; None: nothing is.
    """

    def __init__(self, clock: Any, seed: Any) -> None:
        self.clock = clock
        self.seed = seed
        self.before_draws: Any = None
        self.turn = -1
        self.begun = 0
        self.seeds = 0

    def catch_up(self) -> int:
        """Begin a new turn if the clock has advanced; return `begun`."""
        return self._catch_up()

    def _catch_up(self) -> int:
        turn: int = self.clock.turn
        if turn != self.turn and self.before_draws is not None:
            self.before_draws()  # which may draw
        if turn != self.turn:
            self.turn = turn
            self.begun += 1
        return self.begun

    def rekey(self, seed: Any) -> int:
        """Use another seed for all draws from now on, in this turn, too."""
        self.seed = seed
        self.seeds += 1
        self.turn = -1
        return 0

    def begin_again(self) -> None:
        """Restart all streams of the current turn, as if nothing had been drawn in it."""
        self.turn = -1


class TurnStream:
    """A random stream of one name, which restarts in each turn.

    A subclass has `compute_first_key`, which returns the `compute_first_key` of the name for the current seed, and
    `refuse_bound`, which raises the error for a bad argument of `convert_to_integer`.

    Args:
        turns: the turns of the game.
    """

    def __init__(self, turns: TurnCounter) -> None:
        self._turns = turns
        self._begun = -1  # `TurnCounter.begun` at the last draw
        self._count = 0  # the number of draws in that turn
        self._key = 0  # the key of that turn
        self._seeds = -1  # `TurnCounter.seeds` when `_first` was computed
        self._first = 0

    def mark(self) -> int | None:
        """Return the number of draws in this turn, for `go_to`; None: nothing was drawn."""
        turns = self._turns
        return self._count if self._begun == turns.begun and turns.turn == turns.clock.turn else None

    def go_to(self, mark: int | None) -> None:
        """Continue from a mark of this turn."""
        self._begun = -1
        if mark is not None:
            self._seek()
            self._count = mark

    def _seek(self) -> int:
        """Restart the stream if a new turn has begun."""
        turns = self._turns
        begun = turns._catch_up()
        if begun != self._begun:
            if turns.seeds != self._seeds:
                self._first = self.compute_first_key()  # type: ignore[attr-defined] # of a subclass
                self._seeds = turns.seeds
            self._key = compute_turn_key(self._first, turns.turn)
            self._begun = begun
            self._count = 0
        return 0

    def _draw_next(self) -> int:
        self._seek()
        self._count += 1
        return compute_bits(self._key, self._count - 1)

    def bits(self) -> int:
        """Return 64 random bits."""
        return self._draw_next()

    def random(self) -> float:
        """Return a number in [0, 1)."""
        return convert_to_fraction(self._draw_next())

    def below(self, n: Any) -> Any:
        """Return a uniform random integer from 0 to `n - 1`.

        Raises:
            BadValue: `n` is not between 1 and 2 ** 32.
        """
        if not 1 <= n <= MOST:
            self.refuse_bound(n)  # type: ignore[attr-defined] # of a subclass
        if type(n) is int:
            bound = n
            return convert_to_integer(self._draw_next(), bound)
        return (self._draw_next() >> 32) * n >> 32

    def choice(self, options: Any) -> Any:
        """Return a uniform random item of a sequence.

        Raises:
            BadValue: the sequence is empty.
        """
        count = len(options)
        if count < 1:
            self.refuse_bound(count)  # type: ignore[attr-defined] # of a subclass
        return options[convert_to_integer(self._draw_next(), count)]
