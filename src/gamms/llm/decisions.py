"""Decisions of language models, kept in a file and in recordings, so that games can be played without the server."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from types import UnionType
from typing import Self

from gamms import recorder
from gamms.arguments import as_path
from gamms.errors import BadFile, MissingFile, MissingFolder
from gamms.limits import refuse_above
from gamms.plain import Plain
from gamms.text import reason, shown

EVENT = "llm"
"""The kind of the events that hold decisions in results and recordings."""

ANSWERED = "answer"
"""The outcome of a decision that the model made; any other outcome says why the fallback decided."""

WRONG = "wrong answer: "
"""The beginning of the outcome of a decision whose answers did not count."""

_FORMAT = "gamms llm decisions 1"
_BYTES_PER_LETTER = 40  # bytes of memory for each byte of JSON: `{"":0}` takes most
_MOST = 1 << 53  # the upper bound of a count
_IN_LOG = "log"


@dataclass(frozen=True)
class Decision:
    """One decision of an agent in a turn.

    Attributes:
        turn: the number of the turn, from 1.
        agent: the name of the agent.
        request: the digest of the request.
        outcome: "answer", or the reason why the fallback decided.
        answer: the choice of the model as JSON; None: no valid answer.
        calls: the number of requests to the server.
        input_tokens: the tokens of all questions.
        output_tokens: the tokens of all answers.
        cost: the cost of all tokens, by the prices of the strategy.
        log: the outcome of each call; not part of events.
    """

    turn: int
    agent: str
    request: str
    outcome: str
    answer: str | None
    calls: int
    input_tokens: int
    output_tokens: int
    cost: float
    log: list[dict[str, Plain]] = field(default_factory=list, compare=False)

    @classmethod
    def from_plain(cls, plain: object) -> "Self":
        """Return the decision that a dict of plain values describes; check it, as it may come from any file.

        Raises:
            BadFile: the values do not describe a decision; the message names the wrong value.
        """
        if not isinstance(plain, dict):
            raise BadFile(f"a decision must be an object, not {shown(plain)}")
        for name, kind in _KINDS.items():
            value = plain.get(name)
            is_right = isinstance(value, kind) and not isinstance(value, bool)
            if not is_right or (isinstance(value, (int, float)) and not 0 <= value < _MOST):
                raise BadFile(f"its {name!r} is {shown(value)}")
        return cls(**{name: plain[name] for name in _KINDS})

    @property
    def flaw(self) -> str:
        """The reason why the last answer did not count; empty if it did, or if there was none."""
        return self.outcome.removeprefix(WRONG) if self.outcome.startswith(WRONG) else ""

    def as_event(self) -> dict[str, Plain]:
        """Return the fields of the decision's event, without the turn."""
        return {name: value for name, value in asdict(self).items() if name not in ("turn", _IN_LOG)}


_KINDS: dict[str, type | UnionType] = {
    **dict.fromkeys(("agent", "request", "outcome"), str),
    "answer": str | None,
    **dict.fromkeys(("turn", "calls", "input_tokens", "output_tokens"), int),
    "cost": int | float,
}


def digest(asked: Plain) -> str:
    """Return the digest of a plain value, such as a request."""
    written = json.dumps(asked, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return sha256(written.encode("utf-8", "surrogatepass")).hexdigest()[:32]


class DecisionFile:
    """Recorded decisions, which are looked up by the digests of their requests.

    Args:
        path: a file of JSON lines, which is created with the first decision and to which further decisions are
            appended; or a recording, `.ggr`, which is only read; None: keep no decisions.
        must_exist: whether the file has to exist.

    Raises:
        BadFile (ValueError): the file has another format.
        TooLarge (ValueError): reading the file would take more memory than allowed.
        MissingFile (FileNotFoundError): the recording, or a file that must exist, does not exist.
        MissingFolder (FileNotFoundError): the folder of the file does not exist.
    """

    def __init__(self, path: str | os.PathLike[str] | None, *, must_exist: bool = False) -> None:
        self._path: Path | None = None if path is None else as_path(path, "calls")
        self._known: dict[str, Decision] = {}
        self._cut_at: int | None = None  # byte offset of an incomplete last line
        if self._path is None:
            return
        self._is_recording = self._path.suffix == ".ggr"
        if self._path.is_dir():
            raise BadFile(f"calls must be a file, and {str(self._path)!r} is a folder.")
        if (self._is_recording or must_exist) and not self._path.is_file():
            raise MissingFile("calls", self._path)
        if not self._path.parent.is_dir():
            raise MissingFolder(self._path.name, self._path.parent)
        if self._path.is_file():
            for decision in self._read_recording() if self._is_recording else self._read_lines():
                self._known[decision.request] = decision

    def __str__(self) -> str:
        """Return the path of the file, in quotes."""
        return "no file" if self._path is None else repr(str(self._path))

    def get(self, request: str) -> Decision | None:
        """Return the decision for a request digest, or None."""
        return self._known.get(request)

    def add(self, decision: Decision) -> None:
        """Store a decision; it replaces an earlier decision for the same request."""
        if self._path is None or self._is_recording:
            return
        self._known[decision.request] = decision
        is_new = not self._path.exists() or not self._path.stat().st_size
        lines = [{"format": _FORMAT}] if is_new else []
        with self._path.open("ab") as file:
            if self._cut_at is not None:
                file.truncate(self._cut_at)
                self._cut_at = None
            file.write("".join(json.dumps(line) + "\n" for line in [*lines, asdict(decision)]).encode())

    def _read_lines(self) -> Iterator[Decision]:
        """Yield the decisions in a file; ignore an incomplete last line, which a killed program may leave behind."""
        path = self._path or Path()
        refuse_above(path.stat().st_size * _BYTES_PER_LETTER, f"Reading {str(path)!r}")
        whole = 0
        with path.open("rb") as file:
            for number, line in enumerate(file, 1):
                with _add_place_to_errors(path, f"line {number}"):
                    if number > 1 and not line.endswith(b"\n"):
                        self._cut_at = whole
                        return
                    plain = json.loads(line)
                    is_header = isinstance(plain, dict) and plain.get("format") == _FORMAT
                    if number == 1 and not is_header:
                        raise BadFile(f"the header with the format {_FORMAT!r} is missing")
                    if not is_header:  # two programs that create the file at the same time both write a header
                        yield Decision.from_plain(plain)
                whole += len(line)

    def _read_recording(self) -> Iterator[Decision]:
        with recorder.open(self._path or "") as recording:
            for event in recording.events():
                if event["kind"] == EVENT:
                    with _add_place_to_errors(self._path, f"turn {event['turn']}"):
                        yield Decision.from_plain(event)


@contextmanager
def _add_place_to_errors(path: Path | None, place: str) -> Iterator[None]:
    """Add the file and the place in it to errors about its content."""
    try:
        yield
    except (ValueError, RecursionError) as error:
        raise BadFile(
            f"{str(path)!r} is not a file of decisions of language models, in {place}: {reason(error)}. Set calls= "
            "to a new file, or to one written by gamms.llm."
        ) from None
