"""Keyed random draws for many names at once, and the keys; `gamms.core.draws` computes the bits.

A draw of an agent: `draw_bits(purpose_key(seed, "agent"), name_key("anna"), turn)`.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from math import exp
from typing import TYPE_CHECKING

import numpy as np

from gamms.core import draws
from gamms.core.draws import compute_bits, compute_first_key, compute_turn_key, convert_to_fraction
from gamms.ir.graph import FloatArray, IntArray

if TYPE_CHECKING:
    from numpy.random import Generator

BitArray = np.ndarray[tuple[int, ...], np.dtype[np.uint64]]  # 64 random bits each, or hashes of names
_LEAST_RUN_SEED = 1 << 62
_MOST_NAMES = 1 << 16  # whose hashes are kept


@lru_cache(maxsize=1 << 12)
def compute_purpose_key(seed: int, *purpose: str | int) -> int:
    """Return the 64-bit hash of a seed and a purpose."""
    return _hash(repr((seed, *purpose)))


def compute_purpose_keys(seeds: Sequence[int], purposes: Sequence[tuple[str | int, ...]]) -> BitArray:
    """Return the `compute_purpose_key` of each seed and purpose, (seeds, purposes)."""
    from hashlib import blake2b

    ends = _encode_names(purposes)
    texts = (b"(%d%b" % (seed, end) for seed in seeds for end in ends)
    digests = b"".join([blake2b(text, digest_size=8).digest() for text in texts])
    return np.frombuffer(digests, "<u8").astype(np.uint64).reshape(len(seeds), len(ends))


def compute_run_seeds(runs: Iterable[int], games: Iterable[int], episodes: Iterable[int]) -> list[int]:
    """Return the seeds of the episodes of games of training runs: 2 ** 62 plus 62 bits of a hash of the three numbers.

    Games of different runs share no seed, and smaller seeds are never drawn in training: they are for tests.

    Args:
        runs: the seed of each run.
        games: the number of each game in its run.
        episodes: the number of earlier episodes of each game.
    """
    from hashlib import sha256

    texts = [b"%d/%d/%d" % numbers for numbers in zip(runs, games, episodes, strict=True)]
    return [_LEAST_RUN_SEED + (int.from_bytes(sha256(text).digest()[:8], "big") >> 2) for text in texts]


def _encode_names(names: Sequence[tuple[str | int, ...]]) -> list[bytes]:
    """Return what follows the seed in the text of a seed and names, for each tuple of names."""
    return [f", {', '.join(map(repr, name))})".encode() for name in names]


@lru_cache(maxsize=_MOST_NAMES)
def compute_name_key(name: str) -> int:
    """Return the 64-bit hash of a name."""
    return _hash(name)


def compute_name_keys(names: Iterable[str]) -> BitArray:
    """Return the hashes of names, (names,)."""
    names = list(names)
    if len(names) <= _MOST_NAMES:
        return np.array([compute_name_key(name) for name in names], np.uint64)
    # NOTE: a quarter of the time of `compute_name_key`, whose cache would be too small (benchmarks: sizes).
    return _hash_many(names)


def draw_bits(purpose: int, name: int, turn: int, k: int = 0) -> int:
    """Return 64 random bits.

    Args:
        purpose: a `compute_purpose_key`.
        name: a `compute_name_key`.
        turn: a 64-bit integer.
        k: index of the draw.
    """
    return compute_bits(compute_turn_key(compute_first_key(purpose, name), turn), k)


def draw_bits_rows(purposes: BitArray | int, names: BitArray, turns: IntArray | int, k: IntArray | int = 0) -> BitArray:
    """Apply `draw_bits` to each row; the arguments are broadcast against each other."""
    return compute_bits_rows(compute_turn_key_rows(compute_first_key_rows(purposes, names), turns), k)


def compute_first_key_rows(purposes: BitArray | int, names: BitArray) -> BitArray:
    """Return the `compute_first_key` of each row; the arguments are broadcast against each other."""
    return _apply_row_loop(draws.fill_first_keys, np.asarray(purposes, np.uint64), names)


def compute_turn_key_rows(first: BitArray, turns: IntArray | int) -> BitArray:
    """Return the `compute_turn_key` of each row; the arguments are broadcast against each other."""
    return _apply_row_loop(draws.fill_turn_keys, first, np.asarray(turns, np.int64))


def compute_bits_rows(keys: BitArray, k: IntArray | int) -> BitArray:
    """Return draw `k`, counted from 0, of each `compute_turn_key`; the arguments are broadcast against each other."""
    return _apply_row_loop(draws.fill_bits, keys, np.asarray(k, np.int64))


def _apply_row_loop(fill: Callable[..., int], first: BitArray, second: BitArray | IntArray) -> BitArray:
    """Apply a row loop of the core to two arrays, which are broadcast against each other."""
    shape = np.broadcast(first, second).shape
    out = np.empty(shape, np.uint64)
    fill(_flatten(first, shape), _flatten(second, shape), out.reshape(-1).data)
    return out


def _flatten(values: BitArray | IntArray, shape: tuple[int, ...]) -> memoryview:
    """Return the values, broadcast to a shape, as a flat buffer."""
    rows = np.empty(shape, values.dtype)
    rows[...] = values
    return rows.reshape(-1).data


def draw_bits_each(purpose: int, names: Iterable[str], turn: int) -> list[int]:
    """Return 64 random bits for each name, (names,); for few names faster than arrays."""
    return [draw_bits(purpose, compute_name_key(name), turn) for name in names]


def convert_to_integers(bits: BitArray, n: IntArray | int) -> IntArray:
    """Apply `below` to each draw, (draws,); `n` is one number or one for each draw."""
    found = (bits >> np.uint64(32)) * np.asarray(n).astype(np.uint64)
    found >>= np.uint64(32)
    return found.view(np.int64)


def convert_to_fractions(bits: BitArray) -> FloatArray:
    """Apply `convert_to_fraction` to each draw, (draws,)."""
    return (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53


def convert_to_normals(bits: Iterable[int]) -> FloatArray:
    """Map random bits to numbers (draws,) of the standard normal distribution, by inversion."""
    from statistics import NormalDist

    inverse = NormalDist().inv_cdf
    return np.array([inverse(((one >> 12) + 0.5) * 2.0**-52) for one in bits])


def convert_to_poisson(bits: int, mean: float) -> int:
    """Map random bits to a number of the Poisson distribution, by inversion; the mean is at most 100."""
    drawn = convert_to_fraction(bits)
    count = 0
    chance = exp(-mean)
    total = chance
    while drawn >= total and (count < mean or chance > 2.0**-60):  # smaller chances are below rounding errors
        count += 1
        chance *= mean / count
        total += chance
    return count


def _hash(text: str) -> int:
    return int.from_bytes(_hash_texts([text])[0], "little")


def _hash_many(texts: Sequence[str]) -> BitArray:
    """Return the hash of each text, (texts,)."""
    return np.frombuffer(b"".join(_hash_texts(texts)), "<u8").astype(np.uint64)


def _hash_texts(texts: Sequence[str]) -> list[bytes]:
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


def stream_keys(seeds: Iterable[int], names: Sequence[tuple[str | int, ...]]) -> BitArray:
    """Return the `stream_key` of each seed and name, (seeds, names, 2): its lower and its upper half."""
    from hashlib import blake2b

    ends = _encode_names(names)
    texts = (b"(%d%b" % (seed, end) for seed in seeds for end in ends)
    digests = b"".join([blake2b(text, digest_size=16).digest() for text in texts])
    return np.frombuffer(digests, "<u8").astype(np.uint64).reshape(-1, len(ends), 2)


def stream_words(keys: BitArray) -> BitArray:
    """Return the first eight 32-bit numbers of streams, (…, 8), for their `stream_keys`, (…, 2)."""
    words = np.empty((*keys.shape[:-1], 8), np.uint64)
    draws.fill_words(keys.reshape(-1).data, words.reshape(-1).data)
    return words


def draw_from_many_words(words: BitArray, n: IntArray) -> IntArray:
    """Return the first `integers(n)` of the generators of streams, (streams,).

    Args:
        words: (streams, 8) the words of the streams; see `stream_words`.
        n: (streams,) from 1 to 2 ** 28.
    """
    chosen = np.empty(len(words), np.int64)
    draws.fill_below_of_words(np.ascontiguousarray(words).reshape(-1).data, np.ascontiguousarray(n).data, chosen.data)
    return chosen


def draw_places(keys: BitArray, rows: IntArray) -> IntArray:
    """Return different rows drawn for the agents of games, (games, agents).

    Args:
        keys: (games, agents, 2) the `stream_keys` of the agents.
        rows: the rows to draw from, at least as many as agents.
    """
    shape = keys.shape[:2]
    found = np.empty(shape, np.int64)
    words = np.empty(8, np.uint64)
    taken = np.empty(shape[1], np.int64)
    draws.place_agents(keys.reshape(-1).data, rows.data, words.data, taken.data, found.reshape(-1).data)
    return found
