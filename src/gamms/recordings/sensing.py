"""Adds to a recording what its agents would have sensed, where that was not recorded."""

from io import BytesIO

from gamms.ir import events as kinds
from gamms.recorder import Reader, Recording, RecordingError, Writer
from gamms.recorder import open as opened
from gamms.recorder.replaying import Replayer
from gamms.recorder.sensed import packed
from gamms.recordings.conversion import with_map


def with_sensed(recording: Recording) -> Recording:
    """Return a recording with what agents sense in front of each turn: itself, if it says so already.

    Else the sensors are asked in a replay. Those that report wrongly or late draw other errors than in the game, and
    functions of the program's own report nothing.

    Raises:
        RecordingError (ValueError): it is damaged, or does not hold its map.
    """
    if recording.counts().get("SENSED"):
        return recording
    stream, reader = BytesIO(), Reader(BytesIO(recording.content()))
    first = reader.keyframe(0)
    if first is None:
        raise RecordingError("This recording does not say how it begins.")
    writer = Writer(stream, reader.header, seconds=None)
    writer.keyframe(first[1])
    with with_map(None) as ctx:
        ctx.graph.storage.unpack(recording.graph.packed)
        replayer = Replayer(ctx)
        replayer.begin(reader)
        for turn in range(reader.turns):
            columns = recording.detached(min(turn, recording.turns)).agents.columns
            numbers = dict(zip(columns["names"], columns["numbers"].tolist(), strict=True))
            nodes = dict(zip(columns["names"], columns["node"].tolist(), strict=True))
            agents = [agent for agent in ctx.agent.create_iter() if agent.alive]
            results = [(numbers[agent.name], agent.get_state()["sensor"]) for agent in agents]
            writer.add_turn([(kinds.SENSED, packed(results, numbers, nodes)), *reader.log(turn)])
            for _ in replayer.play_turn(reader):
                pass
    writer.close()
    return opened(BytesIO(stream.getvalue()))
