"""The rule of an infection: people change their teams, from healthy to infected to immune."""

from gamms.rules import contacts


def infection(radius, chance, turns, most):
    """Make the rule of an infection, which ends the game when nobody is infected any more.

    Args:
        radius: metres within which an infected person infects a healthy one.
        chance: the probability of this in a turn.
        turns: the duration of an infection.
        most: the share of people who may have been infected if the vaccinators are to win.
    """

    def prepare(ctx):
        ctx.game.data["since"] = {agent.name: 0 for agent in ctx.agent.teams["infected"]}

    def infection(ctx):
        since = ctx.game.data["since"]
        rng = ctx.stream("infection", ctx.game.turn)
        meetings = contacts(ctx, "infected", "healthy", euclid=radius, passing=False)
        caught = {meeting.b for meeting in meetings if rng.random() < chance}
        protected = {meeting.b for meeting in contacts(ctx, "vaccinators", "healthy")}
        for agent in ctx.game.agents:
            is_over = agent.team == "infected" and ctx.game.turn - since[agent.name] == turns
            if is_over or agent.name in protected:
                agent.team = "immune"
            elif agent.name in caught:
                agent.team = "infected"
                since[agent.name] = ctx.game.turn
                ctx.game.emit("infected", agent=agent.name, node=agent.current_node_id)
        ctx.game.scores["infected"] = len(since)
        people = [agent for agent in ctx.game.agents if agent.team != "vaccinators"]
        if not any(agent.team == "infected" for agent in people):
            is_contained = len(since) <= most * len(people)
            ctx.game.end("nobody is infected", winner="vaccinators" if is_contained else "infected")

    infection.prepare = prepare
    return infection
