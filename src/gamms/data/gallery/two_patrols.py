"""Guards that follow one cycle, guards that wander, and the rule that compares how long they leave nodes alone."""

from gamms.rules import idleness_table


def cycle(rows, columns):
    """Return a cycle through all nodes of a grid with an even number of rows: along the rows, back by column 0."""
    nodes = [0]
    for row in range(rows):
        along = range(1, columns) if row % 2 == 0 else range(columns - 1, 0, -1)
        nodes += [columns * row + column for column in along]
    return nodes + [columns * row for row in range(rows - 1, 0, -1)]


def follow(rows, columns):
    """Make the strategy of guards that follow the cycle."""
    nodes = cycle(rows, columns)
    place = {node: number for number, node in enumerate(nodes)}

    def strategy(state):
        here = place[state["curr_pos"]]
        state["action"] = [nodes[(here + step) % len(nodes)] for step in (1, 2)]

    return strategy


def wander(ctx):
    """Make the strategy of guards that turn into a random street at each node."""

    def strategy(state):
        here = state["curr_pos"]
        ahead = state["edge"][1] if state["edge"] else state["draw"].choice(sorted(ctx.graph.get_neighbors(here)))
        state["action"] = [ahead, state["draw"].choice(sorted(ctx.graph.get_neighbors(ahead)))]

    return strategy


def compare(teams, turns):
    """Make the rule that scores the longest time for which each team leaves a node alone, and collects it."""

    def prepare(ctx):
        for team in teams:
            ctx.game.collect(f"worst_{team}", lambda ctx, team=team: ctx.game.scores[team], every=10)

    def comparison(ctx):
        for team in teams:
            ctx.game.scores[team] = float(idleness_table(ctx, team)["worst"].max()) * ctx.game.turn_seconds
        if ctx.game.turn == turns:
            ctx.game.end("the patrols are over", winner=min(teams, key=lambda team: ctx.game.scores[team]))

    comparison.prepare = prepare
    return comparison
