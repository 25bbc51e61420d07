"""Messages in the core: facts, laws on random games, and a plain form of how they spread to compare with."""

from collections import Counter
from math import dist, inf

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms.core import draws, messages

ALL = messages.USES
OUTCOMES = [None, "heard", "overheard", "lost", "jammed"]


def flat(values, kind):
    return np.ascontiguousarray(values, kind).reshape(-1).data


def channel(roles, range_m=inf, *, delay=1, loss=(), jammers=(), needs_rows=False, is_relayed=False):
    """Return a channel; jammers are (agent or -1, x, y, radius)."""
    losses = np.array(loss, float).reshape(-1, 2).T
    numbers, x, y, radii = np.array(jammers, float).reshape(-1, 4).T
    columns = (roles, np.uint8), *((one, float) for one in losses), (numbers, np.int64)
    columns = *columns, (np.stack((x, y, 0.0 * x), axis=1), float), (radii, float)
    flags = {"needs_rows": needs_rows, "is_relayed": is_relayed}
    return messages.Channel(len(roles), range_m, delay, *(flat(*one) for one in columns), **flags)


def spread(one, games, sent, groups, *, turns=None, names=None, purposes=None, rows=None):
    """Return what becomes of messages, as (outcome, arrival) by agent, and which transmitters were awaited.

    Args:
        one: the channel.
        games: of each the places of its agents, (x, y, z), None of those that are dead.
        sent: (game, sender, group), by game.
        groups: the agents of each.
        turns: of games.
        names, purposes: hashes.
        rows: transmitter -> agents that it reaches, among those in range; of one game.
    """
    agents = len(games[0])
    names = range(agents) if names is None else names
    purposes = np.zeros(len(games) * agents) if purposes is None else purposes
    xyz = [place or (0.0, 0.0, 0.0) for game in games for place in game]
    alive = [place is not None for game in games for place in game]
    slots, awaited = np.full(len(alive), -1), np.zeros(len(alive), np.int64)
    reach, listed = np.zeros((0, agents), np.uint8), []
    at, senders, which = (np.array([row[k] for row in sent], np.int64) for k in range(3))
    memory = np.zeros(3 * agents, np.int64)
    numbers, outcomes = np.zeros_like(at), np.full((len(sent), agents), 9, np.uint8)
    arrivals = np.zeros(outcomes.shape, np.int64)
    messages.count_messages(at.data, senders.data, memory[:agents].data, numbers.data)
    first = np.cumsum([0, *map(len, groups)])
    members = np.array([agent for group in groups for agent in group], np.int64)
    known, written = np.zeros(len(sent), np.uint8), (outcomes.reshape(-1).data, arrivals.reshape(-1).data)
    columns = (column.data for column in (at, senders, which, first, members, numbers, known))
    box = messages.Messages(*columns, *written)
    columns = (xyz, float), (alive, np.uint8), (names, np.uint64), (purposes, np.uint64)
    columns = *columns, (turns or [0] * len(games), np.int64)
    while True:
        views = *(flat(*column) for column in columns), slots.data, awaited.data, flat(reach, np.uint8), memory.data
        network = messages.ChannelNetwork(*views, *(part.data for part in np.zeros((2, agents), np.uint8)))
        number = messages.spread_all(one, network, box)
        if not number:
            break
        listed += awaited[:number].tolist()
        slots[awaited[:number]] = len(reach) + np.arange(number)
        more = np.full((number, agents), 9, np.uint8)
        messages.find_in_range(one, network, number, more.reshape(-1).data)
        for row, transmitter in zip(more, awaited[:number].tolist(), strict=True):
            row[[agent for agent in range(agents) if agent not in rows.get(transmitter, ())]] = 0
        reach = np.concatenate((reach, more))
    assert known.all()
    found = [dict[int, tuple[str, int | None]]() for _ in sent]
    for message, agent in np.argwhere(outcomes).tolist():
        outcome = OUTCOMES[outcomes[message, agent]]
        found[message][agent] = outcome, int(arrivals[message, agent]) if "heard" in outcome else None
    return found, listed


def spread_alone(one, places, sender, group, **more):
    """Return what becomes of one message in one game, agent -> (outcome, arrival)."""
    return spread(one, [places], [(0, sender, 0)], [group], **more)[0][0]


LINE = [(10.0 * k, 0.0, 0.0) for k in range(5)]
EVERYBODY = range(5)


def test_those_within_the_range_hear_in_the_next_turn_the_rim_included():
    found = spread_alone(channel([ALL] * 5, 20.0), LINE, 1, EVERYBODY, turns=[6])
    assert found == dict.fromkeys((0, 2, 3), ("heard", 8))


def test_a_range_holds_in_space_and_has_no_end_where_it_is_infinite():
    places = [(0.0, 0.0, 0.0), (0.0, 3.0, 4.0), (0.0, 3.0, 4.1), (1e300, 1e300, -1e300)]
    assert list(spread_alone(channel([ALL] * 4, 5.0), places, 0, range(4))) == [1]
    assert list(spread_alone(channel([ALL] * 4), places, 0, range(4))) == [1, 2, 3]


def test_only_living_members_of_the_group_that_may_use_the_channel_hear():
    roles = [ALL, ALL, 0, messages.OVERHEARS, ALL]
    places = [*LINE[:4], None]
    assert spread_alone(channel(roles), places, 0, EVERYBODY) == {1: ("heard", 2), 3: ("overheard", 2)}
    assert spread_alone(channel(roles), places, 0, [4, 0]) == {3: ("overheard", 2)}


def test_relays_pass_on_what_they_hear_and_each_transmission_takes_the_delay():
    roles = [ALL, messages.RELAYS, ALL | messages.RELAYS, ALL, ALL]
    by_relays = channel(roles, 10.0, delay=3, is_relayed=True)
    assert spread_alone(by_relays, LINE, 0, EVERYBODY) == {2: ("heard", 7), 3: ("heard", 10)}


def test_jammers_are_living_agents_or_places_and_the_jammed_do_not_relay():
    roles = [ALL | messages.RELAYS] * 5
    near = channel(roles, 10.0, is_relayed=True, jammers=[(2, 0, 0, 1.0), (-1, 40.0, 5.0, 4.9)])
    assert spread_alone(near, LINE, 0, EVERYBODY) == {1: ("heard", 2), 2: ("jammed", None)}
    there = [*LINE[:2], None, *LINE[3:]]
    far = channel(roles, 30.0, is_relayed=True, jammers=[(2, 0, 0, 99.0), (-1, 40.0, 5.0, 5.0)])
    assert spread_alone(far, there, 0, EVERYBODY) == {1: ("heard", 2), 3: ("heard", 2), 4: ("jammed", None)}


def test_transmitters_that_need_a_row_are_listed_once_in_the_order_in_which_they_transmit():
    roles = [ALL | messages.RELAYS] * 5
    by_rows = channel(roles, 25.0, needs_rows=True, is_relayed=True)
    rows = {0: [2], 2: [1, 4], 1: [0, 4]}
    sent = [(0, 0, 0), (0, 0, 1), (0, 3, 0)]
    found, listed = spread(by_rows, [LINE], sent, [EVERYBODY, [4]], rows=rows)
    assert found == [{2: ("heard", 2), 1: ("heard", 3), 4: ("heard", 3)}, {4: ("heard", 3)}, {}]
    assert listed == [0, 3, 2, 1, 4]


def test_certain_losses_are_lost_and_none_are_not():
    for chance, outcome in ((1.0, "lost"), (0.0, "heard")):
        found = spread_alone(channel([ALL] * 5, loss=[(0.0, chance)]), LINE, 0, [3, 4])
        assert [kind for kind, _ in found.values()] == [outcome] * 2


def test_losses_are_drawn_by_the_sender_the_receiver_the_turn_and_the_number_of_the_message():
    names, purposes, turns = [2**64 - 1, 5, 6, 7, 8], [0, 2**63, 1, 2, 3], [-(2**40)]
    lossy = channel([ALL] * 5, loss=[(0.0, 0.5)])
    found, _ = spread(lossy, [LINE], [(0, 1, 0)] * 30, [[0, 4]], names=names, purposes=purposes, turns=turns)
    for number, one in enumerate(found):
        for agent in (0, 4):
            first = draws.first_key(purposes[1], names[agent])
            drawn = draws.fraction(draws.bits_at(draws.turn_key(first, turns[0]), number))
            assert one[agent][0] == ("lost" if drawn < 0.5 else "heard")


points = st.dictionaries(st.floats(0, 1e6), st.floats(0, 1), min_size=1, max_size=5)


@given(points, st.floats(0, 2e6))
def test_chances_have_straight_lines_between_their_points(known, far):
    distances = sorted(known)
    chances = [known[one] for one in distances]
    found = messages.chance_at(channel([ALL], loss=list(zip(distances, chances, strict=True))), far)
    assert found == np.interp(far, distances, chances)


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 4))))
def test_messages_are_counted_by_game_and_sender(sent):
    sent.sort(key=lambda one: one[0])
    games, senders = (np.array([one[k] for one in sent], np.int64) for k in range(2))
    numbers = np.full(len(sent), -1)
    messages.count_messages(games.data, senders.data, np.full(5, 7).data, numbers.data)
    counts = Counter()
    for one, number in zip(sent, numbers.tolist(), strict=True):
        assert number == counts[one]
        counts[one] += 1


def plain(places, roles, range_m, jammers, sender, group, *, is_relayed):
    """Return what becomes of a message without losses, the plain way."""
    living = {agent for agent, place in enumerate(places) if place is not None}
    spots = [(places[agent] if agent >= 0 else (x, y, 0.0), radius) for agent, x, y, radius in jammers]
    jammed = {
        agent for agent in living for spot, radius in spots if spot is not None and dist(places[agent], spot) <= radius
    }
    meant = {agent for agent in group if agent in living and roles[agent] & ALL} - {sender}
    listening = {agent for agent in living if roles[agent] & messages.OVERHEARS} | meant
    able = (living if is_relayed else listening) - jammed - {sender}
    waves, in_reach, transmitters, wave = {}, set(), {sender}, 1
    while transmitters:
        reached = {
            agent for agent in living for by in transmitters - {agent} if dist(places[agent], places[by]) <= range_m
        }
        in_reach |= reached
        new = (reached & able) - set(waves)
        waves |= dict.fromkeys(new, wave)
        transmitters = {agent for agent in new if is_relayed and roles[agent] & messages.RELAYS}
        wave += 1
    found = {agent: ("heard" if agent in meant else "overheard", 1 + waves[agent]) for agent in listening & set(waves)}
    missed = (in_reach & meant) - set(waves)
    return found | {agent: ("jammed" if agent in jammed else "lost", None) for agent in missed}


metres = st.integers(-3, 3).map(float)
spots = st.tuples(metres, metres, metres)
ranges = st.sampled_from([0.0, 1.0, 2.0, 3.0, inf])


@st.composite
def scenes(draw):
    """Several games of as many agents, a channel, and messages."""
    agents = draw(st.integers(1, 7))
    rows = st.integers(0, agents - 1)
    games = draw(st.lists(st.lists(st.none() | spots, min_size=agents, max_size=agents), min_size=1, max_size=3))
    living = [(game, agent) for game, places in enumerate(games) for agent, one in enumerate(places) if one]
    groups = draw(st.lists(st.lists(rows, unique=True), min_size=1, max_size=3))
    number = st.integers(0, len(groups) - 1)
    sent = draw(st.lists(st.tuples(st.sampled_from(living), number), max_size=5)) if living else []
    roles = draw(st.lists(st.integers(0, 7), min_size=agents, max_size=agents))
    jammers = draw(st.lists(st.tuples(rows | st.just(-1), metres, metres, ranges), max_size=2))
    return games, roles, draw(ranges), jammers, groups, sorted((*one, group) for one, group in sent)


@given(scenes(), st.booleans(), st.booleans())
def test_messages_spread_as_in_the_plain_form_in_each_of_several_games(scene, is_relayed, needs_rows):
    games, roles, range_m, jammers, groups, sent = scene
    if not is_relayed:
        roles = [role & ~messages.RELAYS for role in roles]
    everybody = dict.fromkeys(range(len(games) * len(roles)), range(len(roles)))
    one = channel(roles, range_m, jammers=jammers, needs_rows=needs_rows, is_relayed=is_relayed)
    found, _ = spread(one, games, sent, groups, rows=everybody)
    options = {"is_relayed": is_relayed}
    for (game, sender, group), outcome in zip(sent, found, strict=True):
        assert outcome == plain(games[game], roles, range_m, jammers, sender, groups[group], **options)


@given(scenes(), st.lists(st.integers(0, 2**64 - 1), min_size=21, max_size=21), st.booleans())
def test_chance_in_a_game_among_others_is_that_of_the_game_alone(scene, keys, is_relayed):
    games, roles, range_m, jammers, groups, sent = scene
    if not is_relayed:
        roles = [role & ~messages.RELAYS for role in roles]
    agents = len(roles)
    one = channel(roles, range_m, loss=[(0.0, 0.3), (4.0, 0.9)], jammers=jammers, is_relayed=is_relayed)
    turns = [3 * game for game in range(len(games))]
    purposes = keys[: len(games) * agents]
    together, _ = spread(one, games, sent, groups, turns=turns, names=keys[-agents:], purposes=purposes)
    alone = []
    for game, places in enumerate(games):
        its = [(0, *message[1:]) for message in sent if message[0] == game]
        options = {"turns": [turns[game]], "names": keys[-agents:]}
        alone += spread(one, [places], its, groups, purposes=purposes[game * agents :][:agents], **options)[0]
    assert together == alone


# -- what can be sent ---------------------------------------------------------------------------------------------

UNLIMITED = 2**63 - 1


def admit(sent, groups, uses, there, left):
    """Return the verdicts on messages (game, sender, group, size), and how many bytes are left."""
    at, senders, which, sizes = (np.array([one[k] for one in sent], np.int64) for k in range(4))
    first = np.cumsum([0, *map(len, groups)])
    members = np.array([agent for group in groups for agent in group], np.int64)
    left, verdicts = np.array(left, np.int64), np.zeros_like(at)
    columns = flat(uses, np.uint8), flat(there, np.uint8), sizes.data, left.data, verdicts.data
    messages.admit(at.data, senders.data, which.data, first.data, members.data, *columns)
    return verdicts.tolist(), left.tolist()


def test_each_verdict_has_its_reason():
    sent = [(0, 0, group, 0) for group in (-1, 0, 1, 2, 3, 4)]
    groups = [[], [0], [0, 1], [0, 2, 1], [3]]
    verdicts, _ = admit(sent, groups, [1, 0, 1, 1], [1, 1, 1, 0], [UNLIMITED] * 4)
    admitted, for_others, for_sender, unknown = (
        messages.ADMITTED,
        messages.FOR_OTHERS,
        messages.FOR_SENDER,
        messages.UNKNOWN,
    )
    assert verdicts == [admitted, unknown, for_sender, for_others, admitted, unknown]
    assert len({admitted, for_others, for_sender, unknown}) == 4
    assert max(verdicts) < 0


def test_messages_take_bytes_until_none_are_left_and_smaller_ones_may_follow():
    sent = [(0, 0, -1, 4), (0, 0, -1, 4), (0, 0, 0, 1), (0, 0, -1, 2), (1, 0, -1, 6), (0, 0, -1, 1)]
    assert admit(sent, [[]], [1], [1, 1], [6, 6]) == ([-1, 2, messages.UNKNOWN, -1, -1, 0], [0, 0])
    assert admit([(0, 0, -1, UNLIMITED)] * 2, [], [1], [1], [UNLIMITED]) == ([-1, 0], [0])


@given(
    st.lists(st.tuples(st.integers(0, 1), st.integers(0, 2), st.integers(0, 5))),
    st.lists(st.integers(0, 9), min_size=6, max_size=6),
)
def test_no_agent_sends_more_than_it_may_and_what_is_refused_did_not_fit(sent, most):
    verdicts, left = admit([(game, sender, -1, size) for game, sender, size in sent], [], [1] * 3, [1] * 6, most)
    spent = Counter()
    for (game, sender, size), verdict in zip(sent, verdicts, strict=True):
        row = 3 * game + sender
        if verdict == messages.ADMITTED:
            spent[row] += size
        else:
            assert verdict == most[row] - spent[row] < size
    assert left == [most[row] - spent[row] for row in range(6)]
    assert min(left) >= 0
