"""Rumors: in each turn, each person who knows one tells it to another one, drawn among all, who may know it already.

The mean number of turns until all know it follows from the numbers of people who hear it in a turn, which are counted
call by call (Frieze and Grimmett, The shortest-path problem for graphs with random arc-lengths, Discrete Applied
Mathematics 10, 1985). Calls are messages on a channel.
"""

from functools import cache
from pathlib import Path

from gamms import experiment
from gamms.scenario import Scenario


def tell(state):
    """Pass the rumor on to a random other person."""
    memory = state["memory"]
    own = int(state["name"].split("_")[1])
    memory["knows"] = own == 0 or bool(state["inbox"]) or memory.get("knows", False)
    if memory["knows"]:
        other = (own + state["draw"].below(state["facts"]["people"] - 1) + 1) % state["facts"]["people"]
        state["outbox"].append({"channel": "talk", "to": f"people_{other}", "body": "rumor"})
    state["action"] = state["curr_pos"]


def listen(ctx, people):
    """End the game when all have heard the rumor."""
    heard = {name for message in ctx.game.messages for name in message["heard"]}
    if len(heard | {"people_0"}) == people:
        ctx.game.end("all know")


def find_hearers(knowing, people):
    """Return the probability of each number of people who know after a turn."""
    shares = {knowing: 1.0}
    for _ in range(knowing):
        after = {}
        for known, share in shares.items():
            is_new = (people - known) / (people - 1)
            after[known] = after.get(known, 0.0) + share * (1.0 - is_new)
            after[known + 1] = after.get(known + 1, 0.0) + share * is_new
        shares = after
    return shares


@cache
def find_mean(knowing, people):
    """Return the expected number of turns until all know."""
    if knowing == people:
        return 0.0
    shares = find_hearers(knowing, people)
    stays = shares.pop(knowing)
    return (1.0 + sum(share * find_mean(known, people) for known, share in shares.items() if share)) / (1.0 - stays)


if __name__ == "__main__":
    rows = []
    for people in (4, 8):
        crowd = Scenario(
            folder=Path(__file__).parent,
            map={"grid": {"rows": 3, "columns": 4}},
            teams={"people": {"count": people, "strategy": "rumors:tell"}},
            channels={"talk": {"range_m": 1000.0}},
            facts={"people": people},
            rules=[{"rule": "rumors:listen", "with": {"people": people}}],
        )
        means = experiment.run(crowd, range(300)).summary(metrics=["turns"], confidence=0.99)
        *_, ours, low, high = (column[0] for column in means.values())
        expected = find_mean(1, people)
        rows.append({"result": f"turns until all of {people} people know a rumor", "expected": expected, "ours": ours})
        rows[-1] |= {"low": low, "high": high, "agrees": low <= expected <= high}
    print(experiment.Table.of(rows))
