"""Write a recording that is cut down to what a team knew."""

from typing import Any, BinaryIO

from gamms.errors import BadValue, UnknownName
from gamms.ir import events as kinds
from gamms.ir.graph import GraphColumns
from gamms.recorder import sensed
from gamms.recorder.cut import Cut, cut_header, sides_of
from gamms.recorder.errors import DAMAGES, refusing
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Writer
from gamms.recorder.keyframes import Keyframe

_KEYFRAME_TURNS = 64


def write_cut(reader: Reader, columns: GraphColumns, out: BinaryIO, team: object) -> None:
    """Write what a team knew into a stream; see `Recording.cut`.

    Args:
        reader: of the whole recording.
        columns: of its map.
        out: the stream.
        team: see there.
    """
    first = reader.keyframe(0)
    if first is None or not any(True for _ in reader.events(kinds={kinds.SENSED})):
        raise BadValue("This recording does not say what agents sensed: record with ctx.record.start(…, sensed=True).")

    def is_own(name: str, team: Any) -> bool:
        return bool((name if team is None else team) == own)

    own = _team_of(reader, first[1], team)
    with refusing("It cannot be cut", DAMAGES):
        cut = Cut(first[1], is_own, sensed.nearest_on(lambda: columns), reader.header.get("visuals"))
        header = cut_header(reader.header, cut)
    header |= {"seed": None, "audience": own, "sides": sides_of(reader.header, first[1], is_own)}
    writer = Writer(out, header, seconds=None)
    for turn in range(reader.turns):
        with refusing(f"Turn {turn + 1} cannot be cut", DAMAGES):
            complete = list(cut.add(reader.log(turn)))
        for given in complete:
            writer.add_turn(given)
        if turn % _KEYFRAME_TURNS == 0:
            writer.keyframe(cut.keyframe(turn))
    for given in cut.rest():
        writer.add_turn(given)
    writer.close()


def _team_of(reader: Reader, first: Keyframe, team: object) -> Any:
    """Return the team that a caller means, as agents have it; the name of an agent that has none."""
    come = [(data["name"], data["kwargs"].get("team")) for *_, data in reader.events(kinds={kinds.AGENT_CREATE})]
    come += [(data["agent_name"], data["team"]) for *_, data in reader.events(kinds={kinds.AGENT_TEAM})]
    there = zip(first["names"], first["teams"], strict=True)
    teams = [name if own is None else own for name, own in (*there, *come)]
    for known in teams:
        if known == team or str(known) == team:
            return known
    raise UnknownName("team", team, dict.fromkeys(map(str, teams)))
