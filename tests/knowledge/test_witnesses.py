"""Which sides know of events, asked for many events of a turn."""

from gamms.knowledge.sides import PastViews, Side


class CountedSides(dict):
    """Agent -> side, which counts how often all agents are listed."""

    listed = 0

    def items(self):
        self.listed += 1
        return super().items()

    def keys(self):
        self.listed += 1
        return super().keys()

    def values(self):
        self.listed += 1
        return super().values()


def test_many_events_of_a_turn_list_the_agents_of_the_sides_once():
    red, blue = Side("red", None), Side("blue", None)
    sides = CountedSides({"a": red, "b": blue, "c": blue})
    views = PastViews()
    views.note(1, red, ["c"])
    event = {"turn": 1, "kind": "flag"}
    found = [views.find_witnesses({**event, "agent": name}, sides) for name in ("a", "b", "c", "d")]
    assert found == [{red}, {blue}, {red, blue}, set()]
    assert sides.listed == 1
