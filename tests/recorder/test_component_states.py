"""`Recording.state(turn).components`: what the fields of components were after each turn."""

import io
from copy import deepcopy

import pytest
from games import grid_context, recorded
from hypothesis import HealthCheck, given, settings
from test_random_games import Programme, programmes, without_what_a_pause_hides

import gamms
from gamms import recordings
from gamms.plain import to_plain


def values_of(ctx):
    found = ctx.record.components.recorded()[1]
    fields = {
        name: {field: one for field, one in values.items() if field != "name"} for name, (_, values) in found.items()
    }
    return to_plain(fields)


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


@pytest.fixture(params=[False, True], ids=["few keyframes", "a keyframe after each turn"])
def keyframes(request, monkeypatch):
    if request.param:
        monkeypatch.setattr("gamms.recorder.turn_writer._TURNS_AT_ONCE", 1)
        monkeypatch.setattr("gamms.recorder.turn_writer._KEYFRAME_ENTRIES", 0)


def without_components(state):
    return {key: value for key, value in state.items() if key != "components"}


def test_recordings_whose_keyframes_do_not_know_components_are_read_from_their_events(ctx, keyframes):
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


@settings(max_examples=12)
@given(programmes, programmes)
def test_components_are_those_of_the_game_after_pauses_too(before, after):
    ctx = grid_context()
    programme = Programme(ctx)
    programme.do(before)
    data = recorded(lambda _: programme.do([*after, ("play",), ("simulate",)]), ctx)
    with gamms.recorder.open(io.BytesIO(data)) as rec:
        assert rec[-1].components == values_of(ctx)


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(programmes, programmes)
def test_components_are_those_of_the_game_turn_by_turn(keyframes, before, after):
    ctx, live = grid_context(), []
    programme = Programme(ctx)
    programme.do(without_what_a_pause_hides(before))
    live.append(values_of(ctx))

    def play(ctx):
        ctx.visual.after_turn.append(lambda: live.append(deepcopy(values_of(ctx))))
        programme.do(without_what_a_pause_hides(after))

    data = recorded(play, ctx)
    with gamms.recorder.open(io.BytesIO(data)) as rec:
        assert [state.components for state in rec] == live
        assert [rec[turn].components for turn in reversed(range(len(live)))] == live[::-1]
