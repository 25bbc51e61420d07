"""Recordings that were damaged by chance or by an enemy; `scripts/fuzz_recordings.py` tries many more."""

import secrets

import pytest
from fuzzing import check, fuzz, originals

FOUND = []  # mutants, "SEED/NUMBER", that once did something else


def test_mutated_recordings_are_refused_or_give_a_prefix():
    fuzz(secrets.token_hex(4), 500)  # a failure names its mutant


@pytest.mark.parametrize("name", FOUND or ["0/0"])
def test_mutants_that_once_did_harm_do_none(name):
    check(name, originals())
