"""Fixes are stamped by clocks of any rate, which are paused and put forward; a link that is late is noticed."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.bridge import Feed, Fix, FixChecks, SimulatedClock, drive
from gamms.bridge.matching import PositionTracker
from gamms.errors import BadValue

MAX_AGE_S = 2.0
TICK_S = 0.05


def stale_times(rate, seconds=60.0, *, period=0.1, jitter=0.05, pause=(0.0, 0.0), delay=None, shift=None, **checks):
    """Return the times at which the newest fix of a sender is stale.

    Args:
        rate: seconds of the sender's clock in a second; or a function of the time.
        period: seconds between two fixes.
        jitter: the mean of a random delay.
        pause: begin and end of a time in which the sender and its clock stand.
        delay: a further delay, a function of the time.
        shift: a shift of the sender's clock, a function of the time.
    """
    rng = random.Random(0)
    sent = []
    t = 0.0
    for count in range(1, int(seconds / period)):
        now = count * period
        if pause[0] < now < pause[1]:
            continue
        t += period * (rate(now) if callable(rate) else rate)
        arrives = now + min(rng.expovariate(1.0 / jitter), 6 * jitter) + (delay(now) if delay else 0.0)
        sent.append((arrives, t + (shift(now) if shift else 0.0)))
    sent.sort(key=lambda one: one[0])
    tracker = PositionTracker(FixChecks(max_age_s=MAX_AGE_S, **checks), lambda lat, lon: (lat, lon))
    feed = Feed(clock=SimulatedClock())
    stale = []
    for tick in range(1, int(seconds / TICK_S)):
        while sent and sent[0][0] <= tick * TICK_S:
            feed.clock._now, t = sent.pop(0)
            feed.put(Fix(t=t, x=0.0, y=0.0))
            tracker.take(feed.take())
        if tracker.last is not None and tracker.compute_age(tick * TICK_S) > MAX_AGE_S:
            stale.append(tick * TICK_S)
    return stale


@pytest.mark.parametrize("rate", [0.05, 0.1, 0.3, 0.5, 0.9, 0.999, 1.0, 1.001, 1.5, 5.0])
@pytest.mark.parametrize("period", [0.02, 0.1, 1.0])
def test_a_clock_of_any_rate_is_fresh(rate, period):
    assert stale_times(rate, period=period) == []


@given(
    rate=st.floats(0.05, 1.5),
    period=st.floats(0.05, 0.6),
    jitter=st.floats(0.001, 0.05),
    start=st.sampled_from([0.0, 1.7e9, -5.0]),
)
def test_no_rate_and_no_start_of_a_clock_makes_fixes_stale(rate, period, jitter, start):
    assert stale_times(rate, 30.0, period=period, jitter=jitter, shift=lambda _: start) == []


@pytest.mark.parametrize("rates", [(0.3, 0.9), (0.05, 1.0), (0.9, 1.5)])
def test_a_rate_that_changes_every_second_is_fresh(rates):
    assert stale_times(lambda now: rates[int(now) % 2]) == []


@pytest.mark.parametrize("rates", [(1.0, 0.05), (0.9, 0.3), (0.3, 0.9), (1.0, 1.5)])
def test_after_a_change_of_the_rate_fixes_are_soon_fresh_again(rates):
    assert all(20.0 < now < 30.0 for now in stale_times(lambda now: rates[now > 20.0]))


@pytest.mark.parametrize("rate", [0.05, 0.3, 1.0, 1.5])
@pytest.mark.parametrize("length", [1.0, 3.0, 5.0, 8.0, 20.0])
def test_after_a_pause_fixes_are_soon_fresh_again(rate, length):
    stale = stale_times(rate, pause=(20.0, 20.0 + length))
    assert all(20.0 + MAX_AGE_S <= now <= 20.0 + length + 5.0 for now in stale)


@pytest.mark.parametrize("rate", [0.3, 1.0])
def test_a_sender_that_repeats_its_time_is_stale_until_the_time_goes_on(rate):
    stale = stale_times(lambda now: 0.0 if 20.0 < now < 25.0 else rate)
    assert {24.0, 24.5} <= {round(now, 2) for now in stale}
    assert all(20.0 + MAX_AGE_S - 0.2 <= now <= 30.0 for now in stale)


@pytest.mark.parametrize("rate", [0.3, 1.0, 1.5])
@pytest.mark.parametrize("step", [0.5, 3.0, 100.0, 1e9])
def test_a_clock_that_is_put_forward_is_fresh(rate, step):
    assert stale_times(rate, shift=lambda now: step * (now > 20.0)) == []


@pytest.mark.parametrize("rate", [0.3, 1.0, 1.5])
@pytest.mark.parametrize("step", [-1.0, -3.0, -100.0])
def test_a_clock_that_is_put_back_is_soon_fresh_again(rate, step):
    stale = stale_times(rate, shift=lambda now: step * (now > 20.0))
    assert all(20.0 + MAX_AGE_S - 0.5 <= now <= 24.0 + MAX_AGE_S / rate for now in stale)


@pytest.mark.parametrize("rate", [0.3, 0.9, 1.0, 1.5])
@pytest.mark.parametrize("late", [3.0, 5.0, 8.0])
def test_a_link_that_gets_late_is_noticed_also_after_the_gap(rate, late):
    stale = stale_times(rate, delay=lambda now: late * (now > 20.0))
    after_the_gap = [now for now in stale if now > 20.0 + late + 0.5]
    assert min(stale) == pytest.approx(20.0 + MAX_AGE_S, abs=0.5)
    assert len(after_the_gap) * TICK_S > 0.3
    assert max(stale) < 20.0 + late + 5.0  # from here on it cannot be told from a clock that stood


@pytest.mark.parametrize("rate", [0.3, 1.0])
def test_fixes_that_were_held_up_have_their_true_age(rate):
    """For three seconds nothing comes, and then all at once: fixes are stale until the newest ones are here."""
    stale = stale_times(rate, delay=lambda now: 23.0 - now if 20.0 < now < 23.0 else 0.0)
    assert all(22.0 <= now < 23.5 for now in stale)
    assert len(stale) * TICK_S == pytest.approx(1.0, abs=0.4)


def test_by_a_clock_in_real_time_a_late_link_is_noticed_as_long_as_it_is_late():
    late = {"delay": lambda now: 3.0 * (20.0 < now < 40.0), "stamps": "real"}
    stale = {round(now, 2) for now in stale_times(1.0, **late)}
    assert all(now in stale for now in (22.5, 25.0, 30.0, 35.0, 40.0))
    assert stale_times(1.0005, stamps="real") == []
    assert stale_times(0.5, stamps="real") != []


def test_by_arrival_only_silence_makes_a_fix_stale():
    late = {"delay": lambda now: 3.0 * (now > 20.0), "stamps": "arrival"}
    assert all(22.0 <= now < 23.5 for now in stale_times(0.05, **late))
    assert stale_times(lambda now: 0.05 + now % 1.0, stamps="arrival") == []


def test_another_kind_of_stamps_is_refused():
    with pytest.raises(BadValue, match="stamps of FixChecks must be 'any' or 'real' or 'arrival', not 'arival'"):
        drive("anna", Feed(), checks=FixChecks(stamps="arival"))


class Robot:
    """A simulated robot at 10 m/s, with its own clock and link."""

    def __init__(self, rate, late_s=0.0, late_from=1e9):
        self.clock = SimulatedClock()
        self.rate = rate
        self.late_s = late_s
        self.late_from = late_from
        self.waiting = []
        self.xy = self.goal = (0.0, 0.0)

    def send(self, message):
        self.goal = message["points"][-1]

    def __call__(self):
        now = self.clock.now()
        dx, dy = self.goal[0] - self.xy[0], self.goal[1] - self.xy[1]
        share = min(1.0, 0.5 / ((dx * dx + dy * dy) ** 0.5 or 1.0))
        self.xy = (self.xy[0] + dx * share, self.xy[1] + dy * share)
        arrives = now + (self.late_s if now >= self.late_from else 0.0)
        self.waiting.append((arrives, {"t": 100.0 + now * self.rate, "x": self.xy[0], "y": self.xy[1]}))
        here = [fix for at, fix in self.waiting if at <= now]
        self.waiting = [one for one in self.waiting if one[0] > now]
        return here


def late_turns(robot, turns=12, **checks):
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, spacing=10.0))
        patrol = gamms.strategies.patrol(ctx, [0, 8])
        ctx.agent.create_agent("anna", start_node_id=0, team="r", strategy=patrol)
        ctx.game.add(drive("anna", robot, limit_s=4.0, checks=FixChecks(**checks)))
        events = ctx.game.run(turns).events
    return [one["turn"] for one in events if one["kind"] == "robot_late" and one["status"] == "stale"]


@pytest.mark.parametrize("rate", [0.05, 0.5, 0.9, 1.0, 1.5])
def test_a_robot_in_a_simulator_of_another_rate_is_never_late(rate):
    assert late_turns(Robot(rate)) == []


@pytest.mark.parametrize("rate", [0.5, 1.0])
def test_a_robot_whose_link_gets_late_is_late(rate):
    assert late_turns(Robot(rate, late_s=6.0, late_from=5.0)) != []


def test_a_robot_with_a_clock_in_real_time_stays_late():
    late = late_turns(Robot(1.0, late_s=6.0, late_from=5.0), stamps="real")
    assert late == list(range(late[0], 13))
