"""Keyed draws of the core."""

from gamms.core import draws

KEY_0 = 0x0706050403020100
KEY_1 = 0x0F0E0D0C0B0A0908


def test_siphash_meets_the_vector_of_its_authors() -> None:
    # Entry 8 of vectors_sip64 in the reference implementation: the key 00..0f, the message 00..07.
    assert draws.siphash(KEY_0, KEY_1, KEY_0) == 0x93F5F5799A932462


def test_mix_is_the_finalizer_of_splitmix64() -> None:
    # The first outputs of SplitMix64 with the seed 1234567.
    assert [draws.bits_at(1234567, k) for k in range(3)] == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
    ]


def test_a_turn_may_be_negative() -> None:
    assert draws.turn_key(5, -3) == draws.mix((5 - 3 * 0x9E3779B97F4A7C15) % 2**64)
