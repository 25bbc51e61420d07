"""The game of examples/patrolling.py without GAMMS: dicts and a loop."""

from keyed import Draw, stream


def play(seed, posts, starts, needed, on, is_clever, turns):
    """Yield after each turn: agent -> node of those that are there, and the scores.

    Args:
        seed: of the game.
        posts: how many nodes the fence has, joined in a circle.
        starts: robot -> node.
        needed: turns that an intruder needs.
        on: how probably a robot goes on.
        is_clever: whether the intruder comes where a robot has just left.
        turns: how many.
    """
    robots, ways = dict(starts), dict.fromkeys(starts, 1)
    intruder, since, scores = None, 0, {}
    for turn in range(1, turns + 1):
        before = dict(robots)
        for name, post in before.items():
            if Draw(seed, name, turn - 1).random() >= on:
                ways[name] = -ways[name]
            robots[name] = (post + ways[name]) % posts
        if intruder is not None and intruder in robots.values():
            intruder = None
            scores["robots"] = scores.get("robots", 0) + 1
        if intruder is not None and turn - since >= needed:
            intruder = None
            scores["intruders"] = scores.get("intruders", 0) + 1
        elif intruder is None:
            options = sorted(before.values()) if is_clever else range(posts)
            options = [post for post in options if post not in robots.values()]
            if options:
                intruder, since = options[stream(seed, "intrusion", turn).integers(len(options))], turn
        yield {**robots, **({} if intruder is None else {"intruder": intruder})}, dict(scores)
