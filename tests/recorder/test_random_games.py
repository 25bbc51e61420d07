"""Whatever happens in a game: the same game gives the same bytes, a replay the same world, a copy the same file."""

import io
from contextlib import suppress

from games import CORNERS, act, copied, empty_context, everything, grid_context, recorded, replayed
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gamms.recorder import Reader, RecordingError

GROUND, AIR = ("a", "b", "c"), ("d", "e")

nodes, names = st.integers(0, 9), st.sampled_from(GROUND + AIR)
walkers, flyers = st.sampled_from(GROUND), st.sampled_from(AIR)
reals = st.sampled_from([-10.0, -2.5, 0.0, 0.1, 7.0, 1e9])
points = st.tuples(reals, reals, reals)
turns_of = st.tuples(reals, reals, reals, reals).filter(any)
headings = st.none() | st.tuples(reals, reals).filter(any)
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**70), 2**70) | reals | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=2) | st.tuples(inner) | st.dictionaries(st.text(max_size=2), inner, max_size=2)
    ),
    max_leaves=4,
)
keys = st.text("xy", max_size=1) | st.integers(0, 2) | st.tuples(st.integers(0, 1), st.text("z", max_size=1))
teams = st.none() | st.integers(0, 1) | st.sampled_from(["red", "blue"])
sensors = st.sampled_from(["near", "map", "others"])


def called(verb, *arguments):
    return st.tuples(st.just(verb), *arguments)


steps = st.one_of(
    called("walker", walkers, nodes, teams, headings, st.dictionaries(st.sampled_from(["meta", "size"]), plain)),
    called("flyer", flyers, nodes, teams, st.none() | points, st.none() | turns_of),
    called("delete", names),
    called("move", walkers, nodes),
    called("turn_and_move", walkers, nodes, headings),
    called("fly", flyers, points),
    called("fly_and_turn", flyers, points, turns_of),
    called("set", names, st.just("current_node_id"), nodes),
    called("set", names, st.just("prev_node_id"), nodes),
    called("set", names, st.just("orientation"), headings),
    called("set", names, st.just("team"), teams),
    called("set", names, st.just("alive"), st.booleans()),
    called("set", walkers, st.just("speed"), st.none() | st.integers(1, 3)),
    called("set", flyers, st.just("position"), points),
    called("set", flyers, st.just("quat"), turns_of),
    called("carry", names, sensors, sensors),
    called("drop", names, sensors),
    called("component", st.sampled_from("pq")),
    called("field", st.sampled_from("pq"), st.just("count"), st.none() | st.integers(-5, 5)),
    called("field", st.sampled_from("pq"), st.just("way"), st.lists(st.integers(0, 3), max_size=2).map(tuple)),
    called("field", st.sampled_from("pq"), st.sampled_from(["count", "way"]), plain),  # of types not declared
    called("forget", st.sampled_from("pq")),
    called("event", st.dictionaries(st.sampled_from(["x", "y"]), plain)),
    called("data", keys, plain),
    called("no_data", keys),
    called("score", teams, st.integers(0, 5) | reals),
    called("emit", st.dictionaries(st.sampled_from(["x", "y"]), plain)),
    called("edge", nodes, nodes),
    called("no_edge", st.integers(0, 23)),
    called("node", st.integers(9, 12), reals),
    called("no_node", st.integers(0, 12)),
    called("face", st.integers(0, 1)),
    called("respawn", names, nodes),
    called("simulate"),
    called("simulate"),
    called("game"),
    called("game"),
    called("end", teams),
    called("reset", st.integers(0, 2)),
    called("pause"),
    called("play"),
)


class Programme:
    """Does the steps, in which what is impossible does nothing."""

    def __init__(self, ctx):
        self.ctx = ctx

        @ctx.record.component(struct={"count": int, "way": tuple[int, ...]})
        class Flag:
            pass

        self.Flag = Flag

    def do(self, programme):
        for verb, *arguments in programme:
            with suppress(KeyError, ValueError):
                getattr(self, verb)(*arguments)

    def walker(self, name, node, team, heading, more):
        facing = {} if heading is None else {"orientation": heading}
        sensors = ["near", "others"] if node % 2 else []
        self.ctx.agent.create_agent(
            name, start_node_id=node, team=team, sensors=sensors, strategy=wander, **facing, **more
        )

    def flyer(self, name, node, team, position, quat):
        more = {} if position is None else {"position": position}
        more |= {} if quat is None else {"quat": quat}
        self.ctx.agent.create_agent(name, start_node_id=node, type=1, speed=1.5, team=team, strategy=rise, **more)

    def delete(self, name):
        self.ctx.agent.delete_agent(name)

    def move(self, name, node):
        act(self.ctx, name, node)

    def turn_and_move(self, name, node, heading):
        act(self.ctx, name, {"node_id": node, "orientation": heading})

    def fly(self, name, direction):
        act(self.ctx, name, direction)

    def fly_and_turn(self, name, direction, quat):
        act(self.ctx, name, {"direction": direction, "quat": quat})

    def set(self, name, attribute, value):
        setattr(self.ctx.agent.get_agent(name), attribute, value)

    def carry(self, name, under, sensor):
        self.ctx.agent.get_agent(name).register_sensor(under, self.ctx.sensor.get_sensor(sensor))

    def drop(self, name, under):
        self.ctx.agent.get_agent(name).deregister_sensor(under)

    def component(self, name):
        self.Flag(name)

    def field(self, name, field, value):
        setattr(self.ctx.record.get_component(name), field, value)

    def forget(self, name):
        self.ctx.record.delete_component(name)

    def event(self, data):
        self.ctx.record.event("mine", **data)

    def data(self, key, value):
        self.ctx.game.data[key] = value

    def no_data(self, key):
        self.ctx.game.data.pop(key, None)

    def score(self, team, value):
        self.ctx.game.scores[team] += value

    def emit(self, data):
        self.ctx.game.emit("thing", **data)

    def edge(self, source, target):
        graph = self.ctx.graph.graph
        graph.add_edge({"id": 100 + len(list(graph.get_edges())), "source": source, "target": target, "length": 3.0})

    def no_edge(self, id):
        self.ctx.graph.graph.remove_edge(id)

    def node(self, id, x):
        self.ctx.graph.graph.add_node({"id": id, "x": x, "y": -5.0})

    def no_node(self, id):
        self.ctx.graph.graph.remove_node(id)

    def face(self, id):
        self.ctx.graph.add_obstacle_face(face_id=id, type=id, **CORNERS)

    def respawn(self, name, node):
        self.ctx.game.respawn(name, node)

    def simulate(self):
        self.ctx.visual.simulate()

    def game(self):
        self.ctx.game.step()

    def end(self, winner):
        self.ctx.game.end("somebody has won", winner)

    def reset(self, seed):
        self.ctx.game.reset(seed)

    def pause(self):
        self.ctx.record.pause()

    def play(self):
        self.ctx.record.play()


def wander(state):
    state["action"] = state["legal"][len(state["legal"]) * 7 // 8]


def rise(state):
    state["action"] = (0.5, 0.0, 1.0)


programmes = st.lists(steps, max_size=25)
EXAMPLES = settings(max_examples=12)


def game_of(before, after, **options):
    """The recording of a game that began before, and what it came to."""
    ctx = grid_context()
    programme = Programme(ctx)
    programme.do(before)
    data = recorded(lambda _: programme.do(after), ctx, **options)
    return data, ctx


@EXAMPLES
@given(programmes, programmes)
def test_the_same_game_gives_the_same_bytes(before, after):
    assert game_of(before, after)[0] == game_of(before, after)[0]


@EXAMPLES
@given(programmes, programmes)
def test_a_copy_of_a_replay_is_the_same_file_for_generations(before, after):
    data = game_of(before, after)[0]
    second = copied(data)
    assert second == data
    assert copied(second) == data


def without_what_a_pause_hides(programme):
    """Nothing happens unseen."""
    return [step for step in programme if step[0] not in ("pause", "play")]


@EXAMPLES
@given(programmes, programmes)
def test_a_replay_reaches_the_end_of_the_game(before, after):
    data, ctx = game_of(before, [*after, ("play",)])
    again, _ = replayed(data)
    assert everything(again) == everything(ctx)


# -- a replay that is not all there is to a recording ---------------------------------------------------------------


def replayed_into(data, ctx, programme, upon):
    """Replay, and do something else after so many records."""
    for number, _ in enumerate(ctx.record.replay(io.BytesIO(data))):
        if number == upon:
            programme()
    if number < upon:
        programme()


FLYER_ON_A_CHANGED_MAP = [("flyer", "d", 0, None, None, None), ("edge", 0, 0), ("data", "", None), ("reset", 0)]


@EXAMPLES
@example([], FLYER_ON_A_CHANGED_MAP, [], 0)
@given(programmes, programmes, programmes, st.integers(0, 30))
def test_a_recording_that_begins_in_the_middle_of_a_replay_comes_to_the_same(before, after, more, upon):
    data = game_of(before, after)[0]
    ctx, stream = empty_context(seed=2), io.BytesIO()
    replayed_into(data, ctx, lambda: ctx.record.start(stream), upon)
    ctx.record.play()
    ctx.record.close()
    again, _ = replayed(stream.getvalue())
    assert everything(again) == everything(ctx)


@EXAMPLES
@given(programmes, programmes, programmes)
def test_a_game_that_goes_on_after_a_replay_is_recorded_to_its_end(before, after, more):
    data = game_of(before, after)[0]
    ctx = empty_context(seed=2)

    def play(ctx):
        list(ctx.record.replay(io.BytesIO(data)))
        Programme(ctx).do([*more, ("play",)])

    again, _ = replayed(recorded(play, ctx))
    assert everything(again) == everything(ctx)


@EXAMPLES
@given(programmes, programmes, programmes, programmes)
def test_a_replay_into_a_game_that_is_being_recorded_is_a_part_of_it(before, after, begun, more):
    data = game_of(before, after)[0]
    ctx = grid_context()
    ctx.graph.storage.unpack(Reader(io.BytesIO(data)).header["world"])

    def play(ctx):
        programme = Programme(ctx)
        programme.do([step for step in begun if step[0] not in ("edge", "no_edge", "node", "no_node", "face", "reset")])
        ctx.record.play()
        with suppress(RecordingError):  # there may be such agents already
            list(ctx.record.replay(io.BytesIO(data)))
        programme.do([*more, ("play",)])

    again, _ = replayed(recorded(play, ctx))
    assert everything(again) == everything(ctx)
