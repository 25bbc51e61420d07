"""Messages by channels: who hears what and when, what is refused, and that snapshots and recordings hold it all."""

import io
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, Duplicate, UnknownName


def world(places, *, teams=None, seed=3, plan=None, **game):
    """Return a context on a road of 10 m edges with an agent for each name -> node, in the order of `places`.

    In each turn, an agent sends `plan(name, turn)`, and what it hears is noted in `ctx.heard` as (turn, name, inbox).
    """
    ctx = gamms.create_context(seed=seed, logger_config={"level": "ERROR"}, game=game)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 10))
    heard = ctx.heard = []

    def strategy(state):
        heard.append((state["turn"], state["name"], state["inbox"]))
        state["outbox"] += (plan or (lambda *_: []))(state["name"], state["turn"])
        state["action"] = state["curr_pos"]

    for name, node in places.items():
        ctx.agent.create_agent(name, start_node_id=node, team=(teams or {}).get(name), strategy=strategy)
    return ctx


def send(to, body="hello", channel="radio"):
    return {"channel": channel, "to": to, "body": body}


def once(messages, sender="ann", when=0):
    """Return the plan of one agent that sends messages in one turn."""
    return lambda name, turn: messages if (name, turn) == (sender, when) else []


def inboxes(ctx, name):
    """Return turn -> the bodies that an agent heard, without empty ones."""
    return {turn: [one["body"] for one in inbox] for turn, who, inbox in ctx.heard if who == name and inbox}


ROAD = {"ann": 0, "bob": 1, "cat": 3}


def test_a_message_is_in_the_inbox_of_the_turn_after(tmp_path):
    with world(ROAD, plan=once([send("bob", {"seen": [1, 2]})])) as ctx:
        ctx.game.add_channel("radio", range_m=10)
        result = ctx.game.run(3)
        inbox = [
            {"channel": "radio", "sender": "ann", "to": "bob", "body": {"seen": [1, 2]}, "turn": 0, "overheard": False}
        ]
        assert [(turn, got) for turn, name, got in ctx.heard if name == "bob"] == [(0, []), (1, inbox), (2, [])]
        assert inboxes(ctx, "cat") == inboxes(ctx, "ann") == {}
        assert result.messages == [
            {
                "turn": 1,
                "channel": "radio",
                "sender": "ann",
                "to": "bob",
                "body": {"seen": [1, 2]},
                "size": result.messages[0]["size"],
                "heard": {"bob": 2},
                "overheard": {},
                "lost": [],
                "jammed": [],
            }
        ]
        assert result.table("messages")["receiver"].tolist() == ["bob"]
        result.save(tmp_path / "result.json")
        assert gamms.game.Result.load(tmp_path / "result.json") == result


def test_a_game_without_channels_has_neither_inbox_nor_outbox():
    seen = []
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 2))
        ctx.agent.create_agent(
            "ann", start_node_id=0, strategy=lambda state: seen.append(set(state)) or state.update(action=0)
        )
        ctx.game.run(1)
        ctx.game.add_channel("radio", range_m=1)
        ctx.game.run(1)
        ctx.game.remove_channel("radio")
        ctx.game.run(1)
    assert [{"inbox", "outbox"} & keys for keys in seen] == [set(), {"inbox", "outbox"}, set()]


def test_a_delay_counts_turns_and_moves_later_change_nothing():
    with world(ROAD, plan=once([send("bob")])) as ctx:
        ctx.game.add_channel("radio", range_m=10, delay_turns=3)
        ctx.game.run(1)
        ctx.agent.get_agent("bob").current_node_id = 9
        ctx.game.run(4)
        assert inboxes(ctx, "bob") == {3: ["hello"]}


def test_the_dead_neither_send_nor_hear():
    plan = lambda name, turn: [send(None, name)]
    with world(dict.fromkeys(ROAD, 0), plan=plan) as ctx:
        ctx.game.add_channel("radio", range_m=0)
        ctx.game.add(lambda ctx: ctx.game.eliminate("ann") if ctx.game.turn == 1 else None)
        ctx.game.run(3)
        assert inboxes(ctx, "bob") == {1: ["ann", "cat"], 2: ["cat"]}
        assert inboxes(ctx, "ann") == {}
        ctx.agent.delete_agent("bob")
        ctx.game.run(1)
        assert inboxes(ctx, "cat") == {1: ["ann", "bob"], 2: ["bob"], 3: ["bob"]}


# -- what is refused ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("messages", "flaw"),
    [
        ([send("bob", channel="raido")], "Unknown channel 'raido'. Did you mean 'radio'?"),
        ([send("bop")], "Unknown agent or team 'bop'. Did you mean 'bob'?"),
        ([send("ann")], "A message to 'ann' would come to no agent but its sender."),
        ([send([])], "The receiver of a message must be a value such as a text or a number"),
        ([send("bob", object())], "The body must be a plain value"),
        ([send("bob", {"x": [1, {2j}]})], "The body must be a plain value"),
        (
            [send("bob", "x" * 100)],
            "Its body has 103 bytes; channel 'radio' takes 50 of each agent per turn; 42 are left.",
        ),
        ([send("bob", None) | {"two": 1}], "Unknown key of a message: 'two'"),
        ([{"channel": "radio", "body": 1}], "There is no 'to'; a message has 'channel', 'to', 'body'."),
        (["hello"], "A message must be a dict, not 'hello' (str)."),
        ([send("bob", channel=5)], "The channel of a message must be a string"),
    ],
)
def test_an_impossible_message_is_counted_named_and_not_sent(messages, flaw):
    with world(ROAD, plan=once([send("bob", "before"), *messages, send("bob", "after")])) as ctx:
        ctx.game.add_channel("radio", range_m=10, max_bytes_per_turn=50)
        result = ctx.game.run(2)
        assert flaw in result.errors[0]["message"]
        assert "state['outbox'][1]: " in result.errors[0]["message"]
        assert {key: result.errors[0][key] for key in ("turn", "agent", "kind")} == {
            "turn": 0,
            "agent": "ann",
            "kind": "illegal",
        }
        assert (len(result.errors), result.agents["ann"]["illegal"]) == (1, 1)
        assert inboxes(ctx, "bob") == {1: ["before", "after"]}


@pytest.mark.parametrize("outbox", [5, None, "hello", {"to": "bob"}])
def test_an_outbox_that_is_no_list_is_counted(outbox):
    with world(ROAD) as ctx:
        ctx.agent.get_agent("ann").register_strategy(lambda state: state.update(action=0, outbox=outbox))
        ctx.game.add_channel("radio", range_m=10)
        assert "state['outbox'] must be a list" in ctx.game.run(1).errors[0]["message"]


def test_a_body_of_a_hostile_class_is_counted():
    class Hostile(dict):
        def items(self):
            raise RuntimeError("no")

    with world(ROAD, plan=once([send("bob", Hostile(a=1)), send("bob", 2)])) as ctx:
        ctx.game.add_channel("radio", range_m=10)
        assert "RuntimeError" in ctx.game.run(2).errors[0]["message"]
        assert inboxes(ctx, "bob") == {1: [2]}


def test_an_illegal_message_raises_where_illegal_actions_do():
    with world(ROAD, plan=once([send("bop")]), on_illegal="raise") as ctx:
        ctx.game.add_channel("radio", range_m=10)
        with pytest.raises(gamms.game.IllegalAction, match="Unknown agent or team 'bop'"):
            ctx.game.run(1)
        assert (ctx.game.turn, ctx.game.messages, ctx.game.errors) == (0, [], [])


def test_a_turn_that_an_illegal_message_ends_leaves_the_memory_of_the_team_as_it_was():
    def strategy(state):
        state["team_memory"]["visits"] = state["team_memory"].get("visits", 0) + 1
        state.update(action=0, outbox=[send("bop")])

    with world(ROAD, on_illegal="raise") as ctx:
        ctx.agent.get_agent("ann").register_strategy(strategy)
        ctx.game.add_channel("radio", range_m=10)
        for _ in range(2):
            with pytest.raises(gamms.game.IllegalAction):
                ctx.game.step()
        assert ctx.game.team_memories == {}


def test_the_sender_learns_which_messages_were_refused():
    reasons = []
    with world(ROAD) as ctx:
        ctx.agent.get_agent("ann").register_strategy(
            lambda state: reasons.append(state["blocked"]) or state.update(action=0, outbox=[send("bop")])
        )
        ctx.game.add_channel("radio", range_m=10)
        ctx.game.run(2)
    assert reasons[0] is None
    assert "Unknown agent or team 'bop'" in reasons[1]


def test_the_receiver_may_be_a_team_of_which_a_misspelt_name_is_told():
    with world(ROAD, teams={"cat": "green"}, plan=once([send("gren")])) as ctx:
        ctx.game.add_channel("radio", range_m=10)
        assert "'gren'. Did you mean 'green'?" in ctx.game.run(1).errors[0]["message"]


@pytest.mark.parametrize("flaw", ["raises", "is late", "moves where it may not", "does not act"])
def test_messages_of_a_failed_decision_are_dropped(flaw):
    def strategy(state):
        state["outbox"].append(send("bob"))
        if flaw == "raises":
            raise RuntimeError("broken")
        if flaw != "does not act":
            state["action"] = 39 if flaw.startswith("moves") else 0

    with world(ROAD, on_error="stay", time_budget=1e-9 if flaw == "is late" else None) as ctx:
        ctx.agent.get_agent("ann").register_strategy(strategy)
        ctx.game.add_channel("radio", range_m=10)
        result = ctx.game.run(2)
        assert (len([one for one in result.errors if one["agent"] == "ann"]), result.messages) == (2, [])


def test_sent_and_heard_messages_share_nothing():
    kept = {"list": [1]}

    def hear(state):
        for one in state["inbox"]:
            one["body"]["list"].append(2)
        state["action"] = 0

    with world(dict.fromkeys(ROAD, 0), plan=once([send(None, kept)])) as ctx:
        ctx.agent.get_agent("bob").register_strategy(hear)
        ctx.game.add_channel("radio", range_m=0, delay_turns=2)
        ctx.game.run(1)
        kept["list"].clear()
        result = ctx.game.run(3)
        assert inboxes(ctx, "cat") == {2: [{"list": [1]}]}
        assert result.messages[0]["body"] == {"list": [1]}


# -- declarations -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({}, BadValue, r"Channel 'radio' has no range: give range_m= \(metres in a straight line\), hops="),
        ({"loss": 0.1}, BadValue, "has no range"),
        ({"relay": True}, BadValue, "what is missing is how far each agent reaches"),
        ({"line_of_sight": False}, BadValue, "has no range"),
        (
            {"range_m": 10, "loss": 2},
            BadValue,
            "loss of channel 'radio' must have probabilities from 0 to 1, not 2",
        ),
        ({"range_m": 10, "loss": [(5, 0.1), (2, 0.2)]}, BadValue, "must ascend"),
        ({"range_m": 10, "loss": len}, BadType, "loss of channel 'radio' must be a probability or pairs"),
        ({"range_m": -1}, BadValue, "range_m of channel 'radio' must not be negative"),
        ({"range_m": "far"}, BadType, "must be a number"),
        ({"hops": 0}, BadValue, "at least 1"),
        ({"hops": 1.5}, BadType, "must be an integer"),
        ({"hops": 1, "delay_turns": 0}, BadValue, "delay_turns of channel 'radio' must be at least 1, not 0"),
        ({"hops": 1, "max_bytes_per_turn": 0}, BadValue, "at least 1"),
        ({"line_of_sight": 1}, BadType, "must be True or False"),
        ({"hops": 1, "relay": "bob"}, BadType, "must be a list of agents and teams, or True"),
        ({"hops": 1, "teams": []}, BadValue, "must name a team at least"),
        ({"hops": 1, "jammers": "bob"}, BadType, "must be a list of dicts such as"),
        ({"hops": 1, "jammers": [{"agent": "bob"}]}, BadValue, "must be like {'agent': name, 'radius_m': 50}"),
        ({"hops": 1, "jammers": [{"agent": "bob", "at": 3, "radius_m": 1}]}, BadValue, "must be like"),
        ({"hops": 1, "jammers": [{"agnt": "bob", "radius_m": 1}]}, UnknownName, "Did you mean 'agent'"),
        ({"rnge_m": 1}, UnknownName, "Unknown keyword of channel 'radio': 'rnge_m'. Did you mean 'range_m'"),
    ],
)
def test_an_impossible_channel_is_an_error_at_once(options, error, message):
    with gamms.create_context() as ctx:
        with pytest.raises(error, match=message):
            ctx.game.add_channel("radio", **options)
        assert ctx.game.channels == {}


def test_channels_are_listed_shown_and_removed():
    with gamms.create_context(game={"channels": {"radio": {"range_m": 50, "loss": 0.25}}}) as ctx:
        pipe = ctx.game.add_channel("pipe", hops=3, teams=["red", "blue"], jammers=[{"at": (1, 2), "radius_m": 5}])
        assert list(ctx.game.channels) == ["radio", "pipe"]
        assert repr(ctx.game.channels["radio"]) == "Channel('radio', range_m=50.0, loss=0.25)"
        assert "hops=3" in repr(pipe)
        with pytest.raises(Duplicate):
            ctx.game.add_channel("radio", hops=1)
        plain = ctx.game.plain_settings()["channels"]
        with gamms.create_context(game={"channels": plain}) as other:
            assert other.game.channels == ctx.game.channels
        ctx.game.remove_channel("radio")
        with pytest.raises(UnknownName, match="Unknown channel 'radio'"):
            ctx.game.remove_channel("radio")
        assert list(ctx.game.channels) == ["pipe"]


JAMMERS = [("agent", "ann"), ("agent", "ane"), ("team", "red"), ("team", "rid"), ("at", 3), ("at", 99)]


def test_names_that_nothing_has_are_warned_about_once(caplog):
    with world(ROAD, teams={"ann": "red"}) as ctx:
        ctx.logger.setLevel("WARNING")
        ctx.game.add_channel(
            "radio",
            hops=1,
            teams=["red", "rad"],
            relay=["cat", "cet"],
            eavesdroppers=["bob", "bib"],
            jammers=[{key: name, "radius_m": 1} for key, name in JAMMERS],
        )
        ctx.game.run(2)
    assert [record.getMessage().split(".")[0] for record in caplog.records] == [
        "radio: Unknown agent or team 'ane'",
        "radio: Unknown agent or team 'bib'",
        "radio: Unknown agent or team 'cet'",
        "radio: Unknown agent or team 'rad'",
        "radio: Unknown agent or team 'rid'",
        "radio: Unknown node of a jammer: 99",
    ]


# -- reach --------------------------------------------------------------------------------------------------------


def reach_of(ctx, sender="ann"):
    """Let one agent send to all once; return who hears it, and when."""
    ctx.agent.get_agent(sender).register_strategy(
        lambda state: state.update(action=state["curr_pos"], outbox=[send(None)] * (state["turn"] == 0))
    )
    ctx.game.run(1)
    return next(one["heard"] for one in ctx.game.result().messages if one["sender"] == sender)


def test_a_range_holds_in_space():
    with world(ROAD) as ctx:
        stay = lambda state: state.update(action=(0, 0, 0))
        for name, place in (("near", (0.0, 3.0, 4.0)), ("high", (0.0, 0.0, 5.1))):
            ctx.agent.create_agent(name, type="AERIAL", start_node_id=0, position=place, speed=1.0, strategy=stay)
        ctx.game.add_channel("radio", range_m=5)
        assert reach_of(ctx) == {"near": 2}


def block(x, y, width, depth):
    """Return the walls of a building 8 m high, (4, 4, 3)."""
    corners = [(x, y), (x + width, y), (x + width, y + depth), (x, y + depth)]
    return np.array(
        [[(*a, 0), (*b, 0), (*b, 8), (*a, 8)] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    )


# -- chance -------------------------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(st.integers(0, 10**9))
def test_sight_agrees_with_the_lines_of_the_plan(seed):
    from shapely import LineString, box

    draw = Random(seed)
    places = {name: draw.randrange(40) for name in "abcdefg"}
    boxes = [(10 * draw.randrange(9) + 3, 10 * draw.randrange(3) + 2) for _ in range(6)]
    with world(places, plan=once([send(None)], "a")) as ctx:
        for x, y in boxes:
            ctx.graph.add_obstacles(block(x, y, 5, 5))
        ctx.game.add_channel("radio", line_of_sight=True)
        heard = set(ctx.game.run(1).messages[0]["heard"])
    at = {name: (10.0 * (node % 10), 10.0 * (node // 10)) for name, node in places.items()}
    walls = [box(x, y, x + 5, y + 5) for x, y in boxes]
    margins = {name: [LineString([at["a"], at[name]]).distance(wall) for wall in walls] for name in "bcdefg"}
    touched = {
        name for name in "bcdefg" for x, y in boxes if LineString([at["a"], at[name]]).touches(box(x, y, x + 5, y + 5))
    }
    clear = {name for name, far in margins.items() if all(one > 0.0 for one in far)}
    assert heard - touched == clear - touched


# -- state --------------------------------------------------------------------------------------------------------


PLACES = {"ann": 0, "bob": 2, "cat": 4, "dan": 6}


def noisy(seed=7, places=PLACES, **more):
    """Return a game in which all send much, on channels with delays, losses and relays."""
    ctx = world(
        places,
        teams={"ann": "red", "bob": "red", "cat": "blue", "dan": "blue"},
        seed=seed,
        plan=lambda name, turn: [send(None, [name, turn]), send("dan", turn, "mesh")],
        **more,
    )
    ctx.game.add_channel("radio", range_m=25, loss=0.4, delay_turns=3, eavesdroppers="dan", teams=("red", "blue"))
    ctx.game.add_channel("mesh", hops=2, relay=True, loss=[(0, 0.1), (50, 0.6)])
    return ctx


def test_a_fork_goes_on_with_messages_under_way_and_its_own_random_numbers():
    with noisy() as ctx:
        ctx.game.run(4)
        fork = ctx.game.fork(1)
        assert fork.messages == ctx.game.messages
        inbox = fork.observation("bob")["inbox"]
        assert inbox == ctx.game.observation("bob")["inbox"]
        before = list(ctx.game.messages)
        fork.run(20)
        assert ctx.game.messages == before
        ctx.game.run(20)
        assert [one["lost"] for one in fork.messages] != [one["lost"] for one in ctx.game.messages]


@settings(max_examples=8)
@given(st.lists(st.tuples(st.integers(0, 4), st.integers(1, 4)), min_size=1, max_size=6), st.integers(0, 2**31))
def test_going_back_to_any_snapshot_delivers_the_same_again(jumps, seed):
    with noisy(seed) as ctx:
        whole, moments = [], []
        for turn in range(9):
            moments.append(ctx.game.snapshot())
            ctx.game.step()
            whole.append(ctx.heard[4 * turn :])
        for back, turns in jumps:
            ctx.game.restore(moments[back])
            for turn in range(back, back + turns):
                del ctx.heard[:]
                ctx.game.step()
                assert ctx.heard == whole[turn]


def recorded(turns=8):
    file = io.BytesIO()
    with noisy() as ctx:
        ctx.record.start(file)
        result = ctx.game.run(turns)
        ctx.record.stop()
        return file.getvalue(), result, list(ctx.heard)


def test_a_hostile_entry_of_a_recording_is_refused():
    from gamms.ir.events import as_entry

    good = recorded(2)[1].messages[0]
    assert as_entry("messages", good) == good
    for key, value in [("heard", ["bob"]), ("heard", {"bob": "soon"}), ("lost", [1]), ("sender", 3), ("turn", None)]:
        with pytest.raises(BadType, match="is not one of the messages"):
            as_entry("messages", good | {key: value})


def test_channels_cannot_be_changed_while_agents_decide():
    from gamms.deciding import IllegalMutation

    def strategy(state):
        for change in (
            lambda: ctx.game.add_channel("x", hops=1),
            lambda: ctx.game.remove_channel("radio"),
            lambda: setattr(ctx.game, "channels", {}),
        ):
            with pytest.raises(IllegalMutation):
                change()
        state["action"] = 0

    with world(ROAD) as ctx:
        ctx.game.add_channel("radio", hops=1)
        ctx.agent.get_agent("ann").register_strategy(strategy)
        ctx.game.run(1)
        assert list(ctx.game.channels) == ["radio"]


def test_a_created_agent_hears_messages_sent_earlier_to_its_name():
    with world(ROAD, plan=once([send("bob")])) as ctx:
        ctx.game.add_channel("radio", range_m=10, delay_turns=3)
        ctx.game.step()
        ctx.agent.delete_agent("bob")
        ctx.agent.delete_agent("ann")
        ctx.game.step()
        keep = lambda state: ctx.heard.append((state["turn"], "bob", state["inbox"]))
        ctx.agent.create_agent("bob", start_node_id=7, strategy=keep)
        ctx.game.run(2)
        assert inboxes(ctx, "bob") == {3: ["hello"]}
        assert [one["sender"] for one in ctx.game.messages] == ["ann"]


def test_the_log_stays_the_same_list_and_holds_unread_messages():
    with noisy() as ctx:
        log = ctx.game.messages
        ctx.game.step()
        assert ctx.game.messages is log
        first = list(log)
        snapshot = ctx.game.snapshot()
        ctx.game.step()
        ctx.game.restore(snapshot)
        assert ctx.game.messages == first
        ctx.game.step()
        with_unread = ctx.game.fork(seed=9)
        assert with_unread.messages == ctx.game.messages
        assert [one["turn"] for one in ctx.game.messages] == [1] * len(first) + [2] * len(first)
        for game in (with_unread, ctx.game):
            game.run(3)
        assert with_unread.messages[: len(first)] == first


def test_an_entry_that_a_program_adds_to_the_log_arrives():
    with world(ROAD) as ctx:
        ctx.game.add_channel("radio", range_m=10)
        ctx.game.step()
        entry = {"turn": 1, "channel": "radio", "sender": "ann", "to": None, "body": 5, "size": 1}
        ctx.game.messages.append(entry | {"heard": {"bob": 2}, "overheard": {}, "lost": [], "jammed": []})
        ctx.game.run(2)
        assert inboxes(ctx, "bob") == {1: [5]}
        assert len(ctx.game.messages) == 1


def test_messages_of_agents_that_are_all_deleted_in_their_turn_are_dropped():
    def delete_all(ctx):
        for name in [*ctx.agent.agents]:
            ctx.agent.delete_agent(name)

    with world(ROAD, plan=once([send(None)])) as ctx:
        ctx.game.add_channel("radio", range_m=10)
        ctx.game.add(delete_all, phase="deeds")
        ctx.game.run(2)
        assert ctx.game.turn == 2
        assert ctx.game.messages == []
