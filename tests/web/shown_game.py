"""What a page or a live game holds, read in Python: the states of all turns, and all that it says in plain values."""

import base64
import re
import zlib
from typing import NamedTuple

import numpy as np

from gamms.ir.packing import Decoder
from gamms.limits import MemoryBudget
from gamms.web.columns import ALIVE, MAGIC, THERE


class State(NamedTuple):
    """Agents at the end of a turn."""

    agents: dict  # name -> an array
    slots: dict


class ShownGame:
    """A header and parts of turns, from their bytes."""

    def __init__(self, data):
        assert data.startswith(MAGIC)
        self._decoder = Decoder(MemoryBudget(1 << 30, "A page"))
        values, at = [], len(MAGIC)
        while at + 4 <= len(data):
            end = at + 4 + int.from_bytes(data[at : at + 4], "little")
            if end > len(data):
                break  # of a game that goes on
            values.append(self._decoder.decode(data[at + 4 : end]))
            at = end
        self.header, self.sent = values[0], values[1:]
        self.world = self._decoder.decode(self.header["world"])

    @property
    def turns(self):
        return self.sent[-1]["first"] + self.sent[-1]["turns"] - 1 if self.sent else -1

    def columns(self, part):
        return self._decoder.decode(part["columns"])

    def __iter__(self):
        """The states of all turns."""
        slots, states = {}, {}  # a part that is whole says the last turn again
        for part in self.sent:
            columns, names = self.columns(part), np.array(part["agents"])
            changes = list(zip(*[iter(part["changes"])] * 3, strict=True))
            for turn in range(part["turns"]):
                slots = slots | {slot: self._decoder.decode(data) for at, slot, data in changes if at == turn}
                status = columns["status"][:, turn]
                there = status & THERE != 0
                nodes = self.world["node_ids"][columns["nodes"][there, turn]]
                sides = np.array(columns["sides"])[columns["side"][there, turn]]
                agents = {"name": names[there], "node": nodes, "alive": status[there] & ALIVE != 0, "side": sides}
                states[part["first"] + turn] = State(agents, slots)
        yield from states.values()

    def captions(self):
        """The turn and the words of all captions."""
        for part in self.sent:
            yield from ({**one, "turn": part["first"] + one["turn"]} for one in self.columns(part)["captions"])

    def said(self):
        """All that it says, as text."""
        opened = [
            {**part, "columns": self.columns(part), "changes": [self._opened(one) for one in part["changes"]]}
            for part in self.sent
        ]
        return str({**self.header, "world": self.world}) + str(opened)

    def _opened(self, value):
        return self._decoder.decode(value) if isinstance(value, bytes) else value


def game_in(page):
    """Return the game in the bytes of a page."""
    [data] = re.findall(r'class="recording">([^<]*)<', page.decode())
    return ShownGame(zlib.decompress(base64.b64decode(data)))
