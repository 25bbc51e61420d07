"""Fixes come from programs, threads and strangers: what is no position is counted, and never stops a game."""

import asyncio
import itertools
import threading
import time
from contextlib import suppress

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.bridge import Feed, Fix, FixChecks, SimulatedClock
from gamms.bridge.lines import LONGEST_LINE, BadLine, RoadChanges, encode_line, parse
from gamms.bridge.matching import PositionTracker
from gamms.errors import BadType, BadValue

NAN, INF = float("nan"), float("inf")


def tracker(**checks):
    return PositionTracker(
        FixChecks(**{"within_m": 10.0, "max_speed": 10.0, "max_age_s": 2.0, **checks}), lambda lat, lon: (lon, lat)
    )


def track(*fixes, **checks):
    """Take fixes (received, t, x) one after another; return the tracker."""
    one = tracker(**checks)
    feed = Feed(clock=SimulatedClock())
    for at, t, x in fixes:
        feed.clock._now = at
        feed.put(Fix(t=t, x=x, y=0.0))
        one.take(feed.take())
    return one


# -- fixes ---------------------------------------------------------------------------------------------------------


def test_a_fix_has_the_age_that_it_has_gained_since_it_was_measured():
    one = track((100.0, 0.0, 0.0), (103.5, 3.0, 1.0))  # the second was half a second longer on its way
    assert one.compute_age(104.0) == pytest.approx(1.0, abs=0.01)


def test_fixes_without_a_time_are_as_old_as_they_are_here():
    assert track((100.0, None, 0.0)).compute_age(101.5) == 1.5


def test_a_fix_that_was_overtaken_does_not_count():
    one = track((100.0, 5.0, 0.0), (100.5, 4.0, 50.0))
    assert one.counts == {"taken": 1, "out_of_order": 1}
    assert one.last.xy == (0.0, 0.0)


def test_a_sender_whose_clock_begins_again_after_a_pause_is_heard():
    one = track((100.0, 900.0, 0.0), (105.0, 1.0, 3.0))
    assert one.last.xy == (3.0, 0.0)
    assert one.compute_age(105.0) == 0.0


def test_a_jump_that_no_robot_can_make_does_not_count():
    one = track((0.0, 0.0, 0.0), (1.0, 1.0, 500.0), (2.0, 2.0, 12.0))
    assert one.counts == {"taken": 2, "outlier": 1}
    assert one.last.xy == (12.0, 0.0)


def test_three_jumps_to_one_place_mean_that_the_robot_was_carried():
    one = track((0.0, 0.0, 0.0), (1.0, 1.0, 500.0), (2.0, 2.0, 501.0), (3.0, 3.0, 502.0))
    assert one.counts == {"taken": 2, "outlier": 2}
    assert one.last.xy == (502.0, 0.0)


def test_degrees_outside_of_the_map_do_not_count():
    def nowhere(lat, lon):
        raise BadValue("outside")

    one, feed = PositionTracker(FixChecks(), nowhere), Feed()
    feed.put({"lat": 10.0, "lon": 20.0})
    one.take(feed.take())
    assert one.counts == {"off_map": 1}


numbers = st.one_of(st.none(), st.floats(), st.sampled_from([0.0, 1e308, -1e308, 90.0]))


@given(st.lists(st.tuples(st.floats(0, 1e6), numbers, numbers, numbers, numbers, numbers), max_size=12))
def test_no_fix_breaks_a_tracker(fixes):
    one, feed = tracker(), Feed(clock=SimulatedClock())
    for wait, t, lat, lon, x, y in fixes:
        feed.clock.sleep(wait)
        feed.put(Fix(t=t, lat=lat, lon=lon, x=x, y=y))
        one.take(feed.take())
        assert one.compute_age(feed.clock.now()) >= 0.0
    assert sum(one.counts.values()) + feed.counts["bad"] == len(fixes)


# -- feeds ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "fix",
    [
        {"x": NAN, "y": 0},
        {"x": INF, "y": 0},
        {"x": 1e12, "y": 0},
        {"lat": 91, "lon": 0},
        {"lat": 1},
        {},
        {"x": 0, "y": 0, "t": 1.75e12},  # milliseconds since 1970
    ],
)
def test_a_fix_without_a_position_or_a_time_in_seconds_is_counted_and_dropped(fix):
    feed = Feed()
    feed.put(fix)
    assert feed.take() == []
    assert feed.counts == {"received": 1, "bad": 1}


def test_a_feed_that_is_flooded_keeps_the_newest():
    feed = Feed()
    for x in range(10_000):
        feed.put(Fix(x=x, y=0.0))
    taken = feed.take()
    assert (len(taken), taken[-1].fix.x) == (256, 9_999)
    assert feed.counts["dropped"] == 10_000 - 256


def test_an_iterable_is_read_in_a_thread_that_ends_with_it():
    with Feed({"x": x, "y": 0} for x in range(5)) as feed:
        feed._reader._thread.join(60.0)
        assert [one.fix.x for one in feed.take()] == [0, 1, 2, 3, 4]
    assert not feed._reader._thread.is_alive()


def test_an_iterable_without_end_is_let_go_when_the_feed_is_closed():
    def fixes():
        while True:
            time.sleep(0.001)
            yield {"x": 1, "y": 1}

    with Feed(fixes()) as feed:
        pass
    feed._reader._thread.join(60.0)
    assert not feed._reader._thread.is_alive()


def test_an_asynchronous_iterable_is_cancelled_when_the_feed_is_closed():
    begun = threading.Event()

    async def fixes():
        yield {"x": 1, "y": 1}
        begun.set()
        await asyncio.sleep(60)

    with Feed(fixes()) as feed:
        assert begun.wait(60.0)
        assert len(feed.take()) == 1
    assert not feed._reader._thread.is_alive()


def test_what_an_iterable_raises_is_raised_where_the_feed_is_used():
    def fixes():
        yield {"x": 1, "y": 1}
        raise OSError("the cable is out")

    feed = Feed(fixes())
    feed._reader._thread.join(60.0)
    with pytest.raises(OSError, match="cable"):
        feed.take()
    assert feed.take() == []


def test_a_function_may_return_nothing_one_fix_or_several():
    answers = iter([None, {"x": 1, "y": 0}, [{"x": 2, "y": 0}, {"x": 3, "y": 0}]])
    feed = Feed(lambda: next(answers))
    assert [len(feed.take()) for _ in range(3)] == [0, 1, 2]


@pytest.mark.parametrize("answer", [3, "here", [3], {"lat": "north", "lon": 1.0}])
def test_a_function_that_returns_no_fix_is_an_error(answer):
    with pytest.raises(BadType):
        Feed(lambda: answer).take()


# -- lines ---------------------------------------------------------------------------------------------------------


def test_a_line_says_where_an_agent_is():
    fix = Fix(t=1.5, lat=60.1, lon=24.9, heading=90.0, agent="anna")
    assert parse(msgspec.json.encode(fix)) == fix
    assert parse('{"type": "fix", "agent": "anna", "x": 1, "y": 2, "battery": 0.8}') == Fix(x=1, y=2, agent="anna")
    assert parse(encode_line("roads", {"turn": 3, "close": [4], "travel_time": {5: 2.5}})) == RoadChanges(
        turn=3, close=[4], travel_time={5: 2.5}
    )


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"hello",
        b"\xff\xfe",
        b"{}",
        b"[" * 60_000,
        b'{"a":' * 10_000,
        b'{"type": "fix", "x": NaN, "y": 1}',
        b'{"type": "fix", "x": 1e999, "y": 1}',
        b'{"type": "fix", "x": "1", "y": 1}',
        b'{"type": "fix", "gamms": 2, "x": 1, "y": 1}',
        b'{"type": "order", "run": "__import__(\'os\')"}',
        b'{"type": "roads", "turn": 1, "close": [1.5]}',
        b'{"type": "roads", "turn": 1, "travel_time": {"1": 0}}',
        b'{"type": "fix", "agent": "' + b"a" * 300 + b'"}',
        b" " * (LONGEST_LINE + 1),
    ],
    ids=itertools.count(),
)
def test_a_line_that_is_none_is_refused(line):
    with pytest.raises(BadLine) as error:
        parse(line)
    assert len(str(error.value)) < 300


@given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_no_line_does_more_than_be_refused(line):
    with suppress(BadLine):
        assert isinstance(parse(line), Fix | RoadChanges)
