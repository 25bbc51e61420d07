"""`Recording.state(turn).components`: what the fields of components were after each turn."""

import io

from games import grid_context, recorded

import gamms
from gamms import recordings


def a_game(ctx, *, count=7):
    @ctx.record.component(struct={"count": int, "way": tuple[int, ...]})
    class Flag:
        pass

    flag = Flag("early")
    flag.count = 3

    def play(ctx):
        ctx.visual.simulate()
        late = Flag("late")
        ctx.visual.simulate()
        late.way, flag.count = (1, 2), count
        ctx.visual.simulate()
        ctx.record.delete_component("early")
        ctx.record.unregister_component((Flag.__module__, Flag.__qualname__))
        late.count = 1
        Flag("last")
        ctx.visual.simulate()

    return play


EXPECTED = [
    {"early": {"count": 3, "way": None}},
    {"early": {"count": 3, "way": None}},
    {"early": {"count": 3, "way": None}, "late": {"count": None, "way": None}},
    {"early": {"count": 7, "way": None}, "late": {"count": None, "way": (1, 2)}},
    {"late": {"count": 1, "way": (1, 2)}, "last": {"count": None, "way": None}},
]


def test_a_state_has_the_fields_of_each_component(ctx):
    with gamms.recorder.open(io.BytesIO(recorded(a_game(ctx), ctx))) as rec:
        assert [state.components for state in rec] == EXPECTED
        assert [rec[turn].components for turn in (4, 2, 3, 0)] == [EXPECTED[turn] for turn in (4, 2, 3, 0)]


def test_components_of_a_state_are_the_callers_own(ctx):
    with gamms.recorder.open(io.BytesIO(recorded(a_game(ctx), ctx))) as rec:
        rec[3].components["early"]["count"] = 99
        rec[3].components.clear()
        assert rec[3].components == EXPECTED[3]


def test_games_that_part_in_a_component_part_there(ctx):
    data = [recorded(a_game(ctx, count=count), ctx) for ctx, count in ((ctx, 7), (grid_context(), 8))]
    with gamms.recorder.open(io.BytesIO(data[0])) as one, gamms.recorder.open(io.BytesIO(data[1])) as other:
        assert recordings.first_difference(one, other)[:3] == (3, None, "components")


def without_components(state):
    return {key: value for key, value in state.items() if key != "components"}


def test_recordings_whose_keyframes_do_not_know_components_are_read_from_their_events(ctx):
    data = recorded(a_game(ctx), ctx)
    with gamms.recorder.Reader(io.BytesIO(data)) as reader:
        stream = io.BytesIO()
        writer = gamms.recorder.Writer(stream, reader.header)
        for turn in range(reader.turns + 1):
            at, state = reader.keyframe(turn)
            if at == turn:
                writer.keyframe(without_components(state))
            if turn < reader.turns:
                writer.add_turn(reader.log(turn))
        writer.close()
    with gamms.recorder.open(io.BytesIO(stream.getvalue())) as rec:
        assert [rec[turn].components for turn in (4, 3, 2, 1)] == EXPECTED[:0:-1]
