"""Keyed random draws for many names at once, and the keys; `gamms.core.draws` computes the bits.

A draw of an agent: `draw_bits(purpose_key(seed, "agent"), name_key("anna"), turn)`.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from math import exp
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.core import draws
from gamms.core.draws import bits_at, first_key, fraction, turn_key
from gamms.ir.graph import FloatArray, IntArray

if TYPE_CHECKING:
    from numpy.random import Generator

BitArray = np.ndarray[tuple[int, ...], np.dtype[np.uint64]]  # 64 random bits each, or hashes of names
_MASK = (1 << 64) - 1
_PHILOX = (0xD2E7470EE14C6C93, 0xCA5A826395121157)
_WEYL = (0x9E3779B97F4A7C15, 0xBB67AE8584CAA73B)
_LOW = np.uint64(0xFFFFFFFF)
_WEYLS = np.array(_WEYL, np.uint64)[:, None]
_FACTORS_OF_PHILOX = np.array([[one & 0xFFFFFFFF for one in _PHILOX], [one >> 32 for one in _PHILOX]], np.uint64)[
    ..., None
]
_MOST_NAMES = 1 << 16  # whose hashes are kept
_FEW_STREAMS = 128  # number of streams up to which NumPy's generator is faster than arrays


@lru_cache(maxsize=1 << 12)
def purpose_key(seed: int, *purpose: str | int) -> int:
    """Return the 64-bit hash of a seed and a purpose."""
    return _hash(repr((seed, *purpose)))


@lru_cache(maxsize=_MOST_NAMES)
def name_key(name: str) -> int:
    """Return the 64-bit hash of a name."""
    return _hash(name)


def name_keys(names: Iterable[str]) -> BitArray:
    """Return the hashes of names, (names,)."""
    names = list(names)
    if len(names) <= _MOST_NAMES:
        return np.array([name_key(name) for name in names], np.uint64)
    # NOTE: a quarter of the time of `name_key`, whose cache would be too small (benchmarks: sizes).
    return np.frombuffer(b"".join(_digests(names)), "<u8").astype(np.uint64)


def draw_bits(purpose: int, name: int, turn: int, k: int = 0) -> int:
    """Return 64 random bits.

    Args:
        purpose: a `purpose_key`.
        name: a `name_key`.
        turn: a 64-bit integer.
        k: index of the draw.
    """
    return bits_at(turn_key(first_key(purpose, name), turn), k)


def draw_bits_rows(purposes: BitArray | int, names: BitArray, turns: IntArray | int, k: IntArray | int = 0) -> BitArray:
    """Apply `draw_bits` to each row; the arguments are broadcast against each other."""
    return bits_at_rows(turn_key_rows(first_key_rows(purposes, names), turns), k)


def first_key_rows(purposes: BitArray | int, names: BitArray) -> BitArray:
    """Return the `first_key` of each row; the arguments are broadcast against each other."""
    return _rows(draws.fill_first_keys, np.asarray(purposes, np.uint64), names)


def turn_key_rows(first: BitArray, turns: IntArray | int) -> BitArray:
    """Return the `turn_key` of each row; the arguments are broadcast against each other."""
    return _rows(draws.fill_turn_keys, first, np.asarray(turns, np.int64))


def bits_at_rows(keys: BitArray, k: IntArray | int) -> BitArray:
    """Return draw `k`, counted from 0, of each `turn_key`; the arguments are broadcast against each other."""
    return _rows(draws.fill_bits, keys, np.asarray(k, np.int64))


def _rows(fill: Callable[..., int], first: BitArray, second: BitArray | IntArray) -> BitArray:
    """Apply a row loop of the core to two arrays, which are broadcast against each other."""
    shape = np.broadcast(first, second).shape
    out = np.empty(shape, np.uint64)
    fill(_buffer(first, shape), _buffer(second, shape), out.reshape(-1).data)
    return out


def _buffer(values: BitArray | IntArray, shape: tuple[int, ...]) -> memoryview:
    """Return the values, broadcast to a shape, as a flat buffer."""
    rows = np.empty(shape, values.dtype)
    rows[...] = values
    return rows.reshape(-1).data


def draw_bits_each(purpose: int, names: Iterable[str], turn: int) -> list[int]:
    """Return 64 random bits for each name, (names,); for few names faster than arrays."""
    return [draw_bits(purpose, name_key(name), turn) for name in names]


def below_many(bits: BitArray, n: IntArray | int) -> IntArray:
    """Apply `below` to each draw, (draws,); `n` is one number or one for each draw."""
    found = (bits >> np.uint64(32)) * np.asarray(n).astype(np.uint64)
    found >>= np.uint64(32)
    return found.view(np.int64)


def fraction_many(bits: BitArray) -> FloatArray:
    """Apply `fraction` to each draw, (draws,)."""
    return (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53


def normals(bits: Iterable[int]) -> FloatArray:
    """Map random bits to numbers (draws,) of the standard normal distribution, by its inverse."""
    from statistics import NormalDist

    inverse = NormalDist().inv_cdf
    return np.array([inverse(((one >> 12) + 0.5) * 2.0**-52) for one in bits])


def poisson(bits: int, mean: float) -> int:
    """Map random bits to a number of the Poisson distribution, by inversion; the mean is at most 100."""
    drawn = fraction(bits)
    count = 0
    chance = exp(-mean)
    total = chance
    while drawn >= total and (count < mean or chance > 2.0**-60):  # smaller chances are below rounding errors
        count += 1
        chance *= mean / count
        total += chance
    return count


def _hash(text: str) -> int:
    return int.from_bytes(_digests([text])[0], "little")


def _digests(texts: Sequence[str]) -> list[bytes]:
    """Return the 8 bytes of the hash of each text."""
    from hashlib import blake2b

    return [blake2b(text.encode(errors="surrogatepass"), digest_size=8).digest() for text in texts]


def stream(seed: int, *names: str | int) -> "Generator":
    """Return the random generator of one purpose.

    A Philox counter-based generator (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011)
    keyed by a hash of the seed and the names; equal arguments give equal draws on every machine.
    """
    from numpy.random import Generator, Philox

    return Generator(Philox(key=stream_key(seed, *names)))


def stream_key(seed: int, *names: str | int) -> int:
    """Return a 128-bit key derived from the seed and the names."""
    from hashlib import blake2b

    return int.from_bytes(blake2b(repr((seed, *names)).encode(), digest_size=16).digest(), "little")


def stream_words(keys: Sequence[int]) -> BitArray:
    """Return the first eight 32-bit numbers of streams, (streams, 8), without creating their generators.

    Args:
        keys: (streams,) each a `stream_key`.
    """
    words = _philox_few(keys) if len(keys) < _FEW_STREAMS else _philox_many(keys)
    return np.stack((words & _LOW, words >> np.uint64(32)), axis=2).reshape(len(keys), 8)


def below_of_words(words: BitArray, n: IntArray) -> IntArray:
    """Return the first `integers(n)` of the generators of streams, (streams,), by Lemire's method.

    Source: "Fast random integer generation in an interval" (TOMACS 2019).

    Args:
        words: words of the streams; see `stream_words`.
        n: (streams,) from 1 to 2 ** 28.
    """
    sizes = n.astype(np.uint64)[:, None]
    found = words * sizes
    is_fair = (found & _LOW) >= np.uint64(1 << 32) % sizes
    chosen: IntArray = (found[np.arange(len(words)), is_fair.argmax(axis=1)] >> np.uint64(32)).astype(np.int64)
    return chosen


def _philox_few(keys: Sequence[int]) -> BitArray:
    """Return the first four words of each Philox generator, (keys, 4), by NumPy's generator."""
    from numpy.random import Philox

    # NOTE: setting the state takes a fifth of the time of a new generator per key (benchmarks: 5 against 5 by
    # reset).
    words = np.empty((len(keys), 4), np.uint64)
    generator = Philox(key=0)
    state: Any = generator.state
    for row, key in enumerate(keys):
        state["state"]["key"][:] = key & _MASK, key >> 64
        generator.state = state
        words[row] = generator.random_raw(4)
    return words


def _philox_many(keys: Sequence[int]) -> BitArray:
    """Return the first four words of each Philox generator, (keys, 4): its tenth round for the counter 1."""
    key = np.array([[one & _MASK for one in keys], [one >> 64 for one in keys]], np.uint64)
    even, odd = np.zeros((2, *key.shape), np.uint64)  # words 1 and 3, words 2 and 4
    even[0] = 1
    for _ in range(10):
        high, low = _products(even)
        even = high[::-1] ^ odd ^ key
        odd = low[::-1]
        key += _WEYLS
    return np.stack((even[0], odd[0], even[1], odd[1]), axis=1)


def _products(bits: BitArray) -> tuple[BitArray, BitArray]:
    """Return the upper and lower 64 bits of the products with the two factors, computed from 32-bit halves."""
    half = np.uint64(32)
    low, high = _FACTORS_OF_PHILOX
    below = bits & _LOW
    above = bits >> half
    middle = above * low + (below * low >> half)
    crossed = below * high + (middle & _LOW)
    return above * high + (middle >> half) + (crossed >> half), bits * (high << half | low)
