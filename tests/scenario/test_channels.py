"""Channels of scenario files: they are those of the game, and what they name must be there."""

import pytest
import yaml

from gamms import scenario

_FILE = {
    "map": {"grid": {"width": 5, "height": 5}},
    "seed": 1,
    "max_turns": 2,
    "teams": {"red": {"count": 2}, "blue": {"agents": [{"name": "bob", "node": 3}]}},
    "channels": {
        "radio": {
            "range_m": 50,
            "line_of_sight": True,
            "relay": ["bob"],
            "loss": [[0, 0.1], [50, 0.5]],
            "delay_turns": 2,
            "teams": "red",
            "eavesdroppers": ["blue"],
            "jammers": [{"agent": "bob", "radius_m": 5}, {"at": [10, 10], "radius_m": 2}],
        },
        "pipe": {"hops": 3},
    },
}


@pytest.fixture
def talk(tmp_path):
    """Return the scenario above."""
    (tmp_path / "talk.yaml").write_text(yaml.safe_dump(_FILE))
    return scenario.load(tmp_path / "talk.yaml")


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ({}, r"channels\.radio: Channel 'radio' has no range: give range_m="),
        ({"range_m": 10, "loss": 2}, r"channels\.radio: loss of channel 'radio' must have probabilities from 0 to 1"),
        ({"rang_m": 10}, r"channels\.radio\.rang_m: unknown key, with the value 10\. Did you mean 'range_m'"),
        ({"range_m": -1}, r"channels\.radio\.range_m: cannot be -1"),
        ({"hops": 1, "delay_turns": 0}, r"channels\.radio\.delay_turns: cannot be 0"),
        ({"hops": 1, "teams": ["rad"]}, r"channels\.radio\.teams: .*'rad'.*Did you mean 'red'"),
        ({"hops": 1, "relay": ["bab"]}, "there is no agent or team 'bab'. Did you mean 'bob'"),
        ({"hops": 1, "eavesdroppers": "spy"}, r"channels\.radio\.eavesdroppers: there is no agent or team 'spy'"),
        ({"hops": 1, "jammers": [{"agent": "bib", "radius_m": 1}]}, "there is no agent or team 'bib'"),
        ({"hops": 1, "jammers": [{"team": "grey", "radius_m": 1}]}, "'grey'"),
        ({"hops": 1, "jammers": [{"radius_m": 1}]}, "must be like"),
    ],
)
def test_an_impossible_channel_is_named_with_its_place(talk, channel, message):
    with pytest.raises(scenario.ScenarioError, match=message):
        talk.replace(channels={"radio": channel})
