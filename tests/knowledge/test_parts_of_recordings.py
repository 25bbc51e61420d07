"""The parts of events and states that a side knows; parts without an audience or a role are left out."""

import numpy as np
import pytest

from gamms.ir.events import EVENTS, MOVES, Role
from gamms.ir.game_state import FIELD_EVENTS, FIELDS
from gamms.ir.schema import AGENT_COLUMNS, Audience
from gamms.knowledge.sides import KnownAgents, names_only, select_columns, select_event, select_history

KINDS = EVENTS.values()
SECRET = "fox"
NODE = 77777
OWN = {"anna": "red"}
AGENTS = KnownAgents(OWN, seen=(), names=("anna", "bob"), by_number={0: "anna", 1: "bob"})

PUBLIC = {  # fields without agents, of events for all: a new one belongs here only if every team may know it
    "GAME_SCORES": {"scores"},
    "GAME_OVER": {"reason", "winner", "truncated"},
    "GAME_TURN": {"turn", "pace"},
    "GAME_FACTS": {"set", "removed"},
    "WORLD": {"world"},
    "COMPONENT_REGISTER": {"key", "struct"},
    "COMPONENT_CREATE": {"name", "type"},
    "COMPONENT_UPDATE": {"name", "key", "value"},
    "COMPONENT_DELETE": {"name"},
    "COMPONENT_UNREGISTER": {"key"},
}


def make_data(kind, name, team, number):
    """Return data of an event of a kind about one agent, in which all that is not public is secret."""
    values = {
        Role.AGENT: [name] if kind.name == "FLYERS_ABOVE" else name,
        Role.NUMBER: np.array([number]),
        Role.EACH: [SECRET],
        Role.BY_AGENT: {name: SECRET},
        Role.BY_TEAM: [(team, SECRET)],
        Role.NODE: NODE,
        Role.PLAIN: SECRET,
    }
    if kind.code == MOVES:
        return [number, NODE]
    if kind.is_tuple:
        return number, NODE, *[0.0] * (len(kind.fields) - 2)
    public = PUBLIC.get(kind.name, ())
    data = {key: "public" if key in public else values[field.role] for key, field in kind.fields.items()}
    if kind.audience is Audience.WITNESSED:
        data |= {"agent": name, "note": SECRET}
    return data


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_an_event_about_an_agent_out_of_sight_has_nothing_for_others(kind):
    data = make_data(kind, "bob", "blue", 1)
    known = select_event(kind.code, data, AGENTS)
    if known is not None and not names_only(kind.code, known, OWN.__contains__):
        known = None
    assert SECRET not in repr(known)
    assert str(NODE) not in repr(known)
    assert "bob" not in repr(known)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_a_side_knows_events_about_its_own_agents_except_those_of_the_host(kind):
    known = select_event(kind.code, make_data(kind, "anna", "red", 0), AGENTS)
    assert (known is None) == (kind.audience in (Audience.HOST, Audience.HEARD))


def test_public_fields_are_those_that_are_named_here():
    found = {}
    for kind in KINDS:
        names_agent = any(field.role is Role.AGENT for field in kind.fields.values())
        if kind.audience is Audience.ALL and not names_agent:
            found[kind.name] = {key for key, field in kind.fields.items() if field.role in (Role.PLAIN, Role.NODE)}
    assert {name: fields for name, fields in found.items() if fields} == PUBLIC


def test_a_field_that_its_kind_does_not_declare_is_left_out():
    code = next(kind.code for kind in KINDS if kind.name == "GAME_OVER")
    assert select_event(code, {"winner": "red", "why": SECRET}, AGENTS) == {"winner": "red"}
    code = next(kind.code for kind in KINDS if kind.name == "GAME_MEMORY")
    data = {"agents": {"anna": 1, "bob": SECRET}, "teams": [("blue", SECRET)], "all": SECRET}
    assert select_event(code, data, AGENTS) == {"agents": {"anna": 1}, "teams": []}


def test_every_column_of_agents_declares_who_knows_it():
    assert [column.name for column in AGENT_COLUMNS if column.audience is None and column.event is None] == []


def test_of_agents_in_sight_all_know_the_team_and_whether_they_live():
    """A new column that all may know has to be told in cuts when an agent comes in sight, too."""
    assert {column.name for column in AGENT_COLUMNS if column.find_audience() is Audience.ALL} == {"teams", "alive"}


def test_columns_of_the_host_are_empty_for_all():
    columns = {"names": ["bob", "anna"], "strategies": [SECRET, SECRET], "node": np.array([NODE, 3])}
    known = select_columns({**columns, "of a later version": np.array([NODE, NODE])}, [1])
    assert {name: list(values) for name, values in known.items()} == {
        "names": ["anna"],
        "strategies": [None],
        "node": [3],
        "of a later version": [0],
    }


def test_fields_of_a_game_and_the_events_that_change_them_have_one_audience():
    """A field is recorded in keyframes, by its axis, and in events, by their audience."""
    of_all = {"game", "agent"}  # of values by agent, a side knows its own
    axes = {Audience.HOST: {None}, Audience.ALL: of_all, Audience.TEAM: {"agent", "team"}}
    wrong = {name for name, event in FIELD_EVENTS.items() if FIELDS[name].axis not in axes[event.audience]}
    assert wrong == set()


def test_parts_of_a_state_without_a_rule_are_left_out():
    channels = {
        "radio": {"jammers": [{"agent": "bob"}, {"agent": "anna"}, {"node": 3}], "relay": ["anna", "bob"]},
        "secret": {"teams": ["of bob"], "eavesdroppers": ["bob"]},
        "overheard": {"teams": ["of bob"], "eavesdroppers": ["anna", "bob"]},
    }
    events = [{"turn": 1, "kind": "noise", "agent": name} for name in ("anna", "bob")]
    state = {
        "pace": 1,
        "settings": {"channels": channels, "deeds": {"dig": {}}},
        "plan": SECRET,
        "starts": {"anna": 3, "bob": NODE},
    }
    known = select_history({**state, "events": events, "deeds": [{"agent": "bob"}]}, AGENTS, 1)
    assert known == {
        "pace": 1,
        "events": events[:1],
        "settings": {
            "channels": {
                "radio": {"jammers": [{"agent": "anna"}, {"node": 3}], "relay": ["anna"]},
                "overheard": {"teams": ["of bob"], "eavesdroppers": ["anna"]},
            }
        },
        "deeds": [],
        "starts": {"anna": 3},
    }
    assert len(channels["radio"]["jammers"]) == 3  # the state itself is unchanged
