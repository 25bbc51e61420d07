"""The runs of a tournament: each has a random secret, from which all seeds of its games follow.

The manifest has the SHA-256 of the secret from the beginning, and the secret when the run has ended; until then it lies
in a file that only the user may read. Games that are added later belong to a new run.
"""

import hmac
import os
import secrets
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, TypedDict

from gamms.errors import BadFile
from gamms.folders import read_bytes
from gamms.text import shown

SUFFIX = ".secret"  # of the file of a secret
_BYTES = 16  # of a random secret


class Run(TypedDict):
    """One run of a tournament.

    Attributes:
        sha256: the SHA-256 of the secret.
        secret: the secret; None: the run has not ended.
        is_given: whether the caller gave the secret.
        entries: name -> digest of the entry.
        seeds: the labels of the games of each pair of entries.
        rounds: the number of rounds of a Swiss tournament; None: every entry plays every other.
    """

    sha256: str
    secret: str | None
    is_given: bool
    entries: dict[str, str]
    seeds: list[int]
    rounds: int | None


def make_seed(secret: str, *names: str | int) -> int:
    """Return the first 62 bits of the HMAC-SHA-256 of the names, joined by "/", under the secret.

    Neither the secret nor other seeds can be computed from them.
    """
    digest = hmac.digest(secret.encode(), "/".join(map(str, names)).encode(), "sha256")
    return int.from_bytes(digest[:8], "big") >> 2


def hash_secret(secret: str) -> str:
    """Return the SHA-256 of a secret, which is published before its games."""
    return sha256(secret.encode()).hexdigest()


def begin_run(folder: Path, runs: list[Run], plan: Mapping[str, Any], given: str | None) -> str:
    """Return the secret of the last run if it has this plan; else end it, append a new run and return its secret.

    Args:
        folder: the folder of the tournament.
        runs: its runs.
        plan: the keys `entries`, `seeds` and `rounds` of a `Run`.
        given: the secret that the caller gave.

    Raises:
        BadFile: the secret of an interrupted run is lost.
    """
    for last in runs[-1:]:
        file = folder / f"{last['sha256']}{SUFFIX}"
        known = last["secret"]
        if known is None:
            known = read_bytes(file).decode(errors="replace") if file.exists() else ""
        if hash_secret(known) != last["sha256"]:
            raise BadFile(
                f"The secret of the interrupted run is not in {str(file)!r}. Put it back, or use another folder."
            )
        if {**last, **plan} == last and given in (None, known):
            return known
        last["secret"] = known
    secret = secrets.token_hex(_BYTES) if given is None else given
    hashed = hash_secret(secret)
    file = folder / f"{hashed}{SUFFIX}"
    file.unlink(missing_ok=True)
    with open(file, "xb", opener=partial(os.open, mode=0o600)) as stream:
        stream.write(secret.encode())
    runs.append({"sha256": hashed, "secret": None, "is_given": given is not None, **plan})  # type: ignore[typeddict-item] # the plan has the other keys
    return secret


def check_runs(runs: Sequence[Run], rows: Iterable[Mapping[str, Any]]) -> None:
    """Check that published secrets have their SHA-256, and that each row belongs to a run.

    Raises:
        BadFile: the folder has been tampered with.
    """
    for run in runs:
        if run["secret"] is not None and hash_secret(run["secret"]) != run["sha256"]:
            raise BadFile(
                f"The secret of a run does not have its SHA-256, {shown(run['sha256'])}: tampered or damaged."
            )
    hashes: set[str | None] = {run["sha256"] for run in runs} or {None}
    for row in rows:
        if row.get("run") not in hashes:
            raise BadFile(f"The row {shown(row['id'])} belongs to no run of the tournament: tampered or damaged.")
