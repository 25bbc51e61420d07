"""The law of recordings: what a batch writes of a game are the bytes that are written while it is played alone."""

import numpy as np
from batch_scenes import assert_as_shown, plain, scene
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from test_laws import LAWS

import gamms

WALK = "gamms.strategies:random_walk"
RULES = [
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "hops": 1}},
    {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "then": "eliminate"}},
    {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "metres": 6, "mutual": True}},
    {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "euclid": 9}},
    {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}},
    {"rule": "hold", "with": {"nodes": [12, 7], "turns": 2, "ends": False, "score": 1}},
    {"rule": "discover", "with": {"nodes": {3: "flag", 18: [1, 2]}, "hops": 1}},
    {"rule": "resource", "with": {"name": "fuel", "start": 6, "per_turn": 1, "recharge": {6: 2}}},
    {"rule": "respawn", "with": {"after": 2}},
    {"rule": "payoff", "with": {"table": {"tag": {"agent": 0.3}}}},
]
FROM_AIR = {"rule": "tag", "with": {"taggers": "air", "tagged": "red", "euclid": 12, "air": True}}
EYES = {
    "near": {"type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.7},
    "late": {"type": "AGENT_RANGE", "sensor_range": 35.0, "delay_turns": 2, "position_noise_m": 9.0},
    "odd": {"type": "AGENT", "false_alarm_rate": 0.4},
    "ahead": {"type": "OCCLUDED_AGENT", "sensor_range": 35.0, "fov": 2.5},
    "above": {"type": "OCCLUDED_AERIAL_AGENT", "sensor_range": 30.0, "fov": 3.0, "delay_turns": 1, "detection": 0.7},
}
teams = st.fixed_dictionaries(
    {
        "count": st.integers(1, 4),
        "strategy": st.sampled_from([WALK, "gamms.strategies:flee", "gamms.strategies:chase"]),
        "sensors": st.sampled_from([["near"], ["odd", "late"], ["ahead"]]),
    },
    optional={"speed": st.sampled_from([1.0, 2.5])},
)
air = st.fixed_dictionaries(
    {
        "count": st.integers(1, 2),
        "type": st.just("aerial"),
        "speed": st.sampled_from([4.0, 30.0]),
        "altitude": st.sampled_from([0.0, 9.0]),
        "strategy": st.sampled_from([WALK, "gamms.strategies:stay"]),
        "sensors": st.sampled_from([["near"], ["odd", "above"]]),
    }
)
settled = st.fixed_dictionaries(
    {},
    optional={
        "order": st.just([["blue"], ["red"]]),
        "speed_unit": st.just("metres"),
        "deeds": st.just({"scan": {"node": "node"}, "rest": {}}),
    },
)


@settings(LAWS, max_examples=5, phases=[Phase.generate])
@given(
    red=teams,
    blue=teams,
    air=st.one_of(st.none(), air),
    rules=st.lists(st.sampled_from(RULES), max_size=4, unique_by=str),
    settled=settled,
    conflicts=st.sampled_from([{}, {"conflicts": {"capacity": 1}}]),
    max_turns=st.sampled_from([1, 9]),
    outside=st.sampled_from([[], ["red"], ["red", "blue"]]),
)
def test_a_recording_of_a_game_of_a_batch_is_that_of_the_game_alone(
    red, blue, air, rules, settled, conflicts, max_turns, outside, tmp_path_factory
):
    folder, rng = tmp_path_factory.mktemp("games"), np.random.default_rng(1)
    radio = {"range_m": 30.0, "max_bytes_per_turn": 3}
    if air is not None and "order" in settled:
        settled = settled | {"order": [["blue"], ["red", "air"]]}
    given = {"settings": settled, "channels": {"radio": radio}, "max_turns": max_turns, "sensors": EYES}
    given |= conflicts
    rules = rules if air is None else [*rules, FROM_AIR]
    scenario = scene(rules, teams={"red": red, "blue": blue} | ({} if air is None else {"air": air}), **given)
    outside = outside + (["air"] if air is not None and outside else [])
    with scenario.batch(2, seed=5, record=True) as games:
        while outside and not games.is_over.all():
            actions = {
                team: {
                    "moves": games.observe(team).counts * 0 + rng.integers(2),
                    "messages": {"radio": (True, int(rng.integers(3)) * 999, rng.choice([team, None]))},
                }
                | ({"flights": rng.normal(size=(2, air["count"], 3)) * 20.0} if team == "air" else {})
                for team in outside
            }
            games.step(actions, on_illegal="stay")
        games.run()
        assert_as_shown(games)
        for number in range(2):
            games.record(number, folder / "batch.ggr")
            with gamms.recorder.open(folder / "batch.ggr") as recording:
                assert recording.turns == games.turn[number]
                assert recording.state(recording.turns).scores == games.result(number).scores
            if not outside:
                expected = plain(scenario.play(seed=5 + number, record=folder / "alone.ggr"))
                assert plain(games.result(number)) == expected
                assert (folder / "batch.ggr").read_bytes() == (folder / "alone.ggr").read_bytes()
