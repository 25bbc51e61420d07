"""The JSON lines that GAMMS exchanges with robots and other programs, version 1; docs/bridge.md describes them.

Incoming lines are checked against the types below and against bounds; an invalid line is refused and has no other
effect.
"""

from collections.abc import Mapping
from math import isfinite
from typing import Annotated, Literal, Union

import msgspec
import msgspec.structs

from gamms.arguments import as_float
from gamms.errors import BadType, BadValue, nearest
from gamms.text import shown

VERSION = 1
LONGEST_LINE = 1 << 16  # bytes
_FAR = 1e9  # map units
_NUMBERS = ("t", "lat", "lon", "x", "y", "heading")

Id = Annotated[int, msgspec.Meta(ge=-(1 << 63), le=(1 << 63) - 1)]
Name = Annotated[str, msgspec.Meta(max_length=200)]


class Fix(msgspec.Struct, frozen=True, tag="fix", tag_field="type"):
    """A measured position of a robot.

    Attributes:
        t: the time of the measurement, seconds by the clock of the sender; None: the time of arrival.
        lat, lon: degrees (WGS84); or
        x, y: map units.
        heading: degrees clockwise from north; None: unknown.
        agent: the agent that the robot plays.
        gamms: the version of the line.
    """

    t: float | None = None
    lat: float | None = None
    lon: float | None = None
    x: float | None = None
    y: float | None = None
    heading: float | None = None
    agent: Name = ""
    gamms: Literal[1] = 1

    @property
    def flaw(self) -> str | None:
        """The reason why the numbers are not a position; None: they are."""
        given = [value for name in _NUMBERS if (value := getattr(self, name)) is not None]
        if not all(map(isfinite, given)):
            return "a number is NaN or infinite"
        if self.x is not None and self.y is not None:
            return None if abs(self.x) <= _FAR and abs(self.y) <= _FAR else "x or y is beyond any map"
        if self.lat is None or self.lon is None:
            return "it has neither x and y nor lat and lon"
        return None if abs(self.lat) <= 90.0 and abs(self.lon) <= 180.0 else "lat and lon are no degrees"


class RoadChanges(msgspec.Struct, frozen=True, tag="roads", tag_field="type"):
    """Changes of the roads before a turn.

    Attributes:
        turn: the number of turns played so far.
        close: ids of edges to close.
        open: ids of closed edges to open again.
        travel_time: id of an edge -> its new travel time in seconds.
        gamms: the version of the line.
    """

    turn: int
    close: list[Id] = []
    open: list[Id] = []
    travel_time: dict[Id, Annotated[float, msgspec.Meta(gt=0.0)]] = {}
    gamms: Literal[1] = 1


Incoming = Fix | RoadChanges
_decoder: msgspec.json.Decoder[Incoming] = msgspec.json.Decoder(Union[Fix, RoadChanges])  # noqa: UP007 - its type argument


class BadLine(BadValue):
    """An incoming line that cannot be used."""


def parse(line: bytes | str) -> Incoming:
    """Return the message in a line.

    Raises:
        BadLine: the line is too long, is not JSON, or is not a message of this version.
    """
    if len(line) > LONGEST_LINE:
        raise BadLine(f"A line has at most {LONGEST_LINE:,} bytes, not {len(line):,}.")
    try:
        return _decoder.decode(line)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise BadLine(f"No line of version {VERSION}: {shown(str(error))}.") from None


def encode_line(kind: str, fields: Mapping[str, object]) -> bytes:
    """Return a message as one line of JSON, without the final line feed."""
    return msgspec.json.encode({"gamms": VERSION, "type": kind, **fields})


def as_fix(value: object) -> Fix:
    """Return a fix from a `Fix` or a mapping; `Fix.flaw` tells whether numbers are missing.

    Raises:
        BadType: the value is neither, or holds a value that is not a number.
        BadValue: the mapping has an unknown key.
    """
    if isinstance(value, Fix):
        return value
    if not isinstance(value, Mapping):
        raise BadType(f"A fix is a mapping such as {{'t': 12.0, 'x': 3.0, 'y': 4.0}}, not {shown(value)}.")
    numbers: dict[str, float] = {}
    for key, number in value.items():
        if key in ("agent", "type", "gamms"):
            continue
        if key not in _NUMBERS:
            raise BadValue(f"A fix has no {shown(key)}.{nearest(key, _NUMBERS)} It has {', '.join(_NUMBERS)}.")
        if number is not None:
            try:
                numbers[key] = as_float(number, f"{key!r} of a fix")
            except BadValue:  # NaN and infinity, which some sensors send instead of a missing value
                numbers[key] = float("nan")
    return msgspec.structs.replace(Fix(), **numbers)
