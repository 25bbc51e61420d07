"""How long agents take for a distance."""

from math import inf

import pytest

from gamms.strategies.paces import in_turns


@pytest.mark.parametrize(
    ("far", "speed", "turns"), [(10.0, 4.0, 2.5), (0.0, 0.0, 0.0), (3.0, 0.0, inf), (inf, 2.0, inf), (inf, inf, inf)]
)
def test_a_distance_takes_its_turns_at_a_speed(far, speed, turns):
    assert in_turns(far, speed) == turns
