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


def compare(teams, scored):
    """Make the rule that collects the worst idleness of the teams every ten turns; that of one team is the score."""

    def prepare(ctx):
        for team in teams:
            ctx.game.collect(f"worst_{team}", lambda ctx, team=team: worst_idleness(ctx, team), every=10)

    def comparison(ctx):
        ctx.game.scores[scored] = worst_idleness(ctx, scored)

    comparison.prepare = prepare
    return comparison


def worst_idleness(ctx, team):
    """Return the longest time for which a team has left a node alone, in seconds."""
    return float(idleness_table(ctx, team)["worst"].max()) * ctx.game.turn_seconds
