"""What cannot be written, because it is no plain value: it is left out, and the logger is told once."""

from collections.abc import Mapping
from typing import Any

from gamms.plain import plain_subset


class LeftOut:
    """Tells a context's logger what is not in its recording; once for each key of nodes, edges, agents and sensors."""

    def __init__(self, ctx: Any) -> None:
        self._ctx = ctx
        self._told: set[tuple[str, Any]] = set()

    def packed(self) -> bytes:
        """Graph and obstacles of the context, as far as they can be written."""
        packed: bytes
        packed, left_out = self._ctx.graph.storage.pack_savable()
        for (kind, key), ids in left_out.items():
            others = f" and {len(ids) - 1} more" if len(ids) > 1 else ""
            self._tell(kind, f"{ids[0]}{others}", key)
        return packed

    def plain_part(self, kind: str, name: Any, values: Mapping[Any, Any]) -> dict[Any, Any]:
        """What of the values of an agent or sensor can be written."""
        left_out: list[Any] = []
        part = plain_subset(values, left_out)
        for key in left_out:
            self._tell(kind, repr(name), key)
        return part

    def look_over(self) -> None:
        """Tell what of the agents and sensors of the context cannot be written."""
        for agent in self._ctx.agent.agents.values():
            if vars(agent):
                self.plain_part("agent", agent.name, vars(agent))
        self.look_over_sensors(self._ctx.sensor.storage.described())

    def look_over_sensors(self, described: list[dict[str, Any]]) -> None:
        """Tell what of these sensors cannot be written."""
        for sensor in described:
            self.plain_part("sensor", sensor["id"], sensor["keywords"])

    def _tell(self, kind: str, which: str, key: Any) -> None:
        if (kind, key) in self._told:
            return
        self._told.add((kind, key))
        self._ctx.logger.warning(
            f"{kind.capitalize()} {which} has {key!r} with something in it that is no plain value: that is left out of "
            "the recording, here and wherever else."
        )
