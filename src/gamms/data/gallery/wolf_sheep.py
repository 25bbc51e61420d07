"""Sheep that graze, wolves that hunt, and the rule by which animals eat, are born and die."""

from gamms.visual.legend import LegendRow, LegendRows

GRASS = (80, 170, 60)


def graze(state):
    """Go to grass beside the sheep, or anywhere if there is none."""
    green = [node for node in state["legal"] if node not in state["facts"]["bare"]]
    state["action"] = state["draw"].choice(green or state["legal"])


def hunt(state):
    """Go to a sheep beside the wolf, or anywhere if there is none."""
    near = [node for node in state["legal"] if node in state["facts"]["flock"]]
    state["action"] = state["draw"].choice(near or state["legal"])


def life(regrow, food, birth):
    """Make the rule of life and death.

    Args:
        regrow: the turns after which eaten grass is back.
        food: team -> the energy of a meal; a turn takes 1.
        birth: team -> the energy with which an animal has a young one, which gets half of it.
    """

    def prepare(ctx):
        energy = {agent.name: birth[agent.team] // 2 for agent in ctx.game.agents}
        ctx.game.data["life"] = {"energy": energy, "bare": {}, "born": 0}
        tell(ctx)

    def tell(ctx):
        flock = [agent.current_node_id for agent in ctx.agent.teams.get("sheep", ())]
        ctx.game.publish(bare=frozenset(ctx.game.data["life"]["bare"]), flock=frozenset(flock))

    def life(ctx):
        data = ctx.game.data["life"]
        energy = data["energy"]
        sheep = [agent for agent in ctx.game.agents if agent.team == "sheep"]
        prey = {agent.current_node_id: agent.name for agent in sheep}
        data["bare"] = {node: turn for node, turn in data["bare"].items() if ctx.game.turn - turn < regrow}
        for animal in sheep + [agent for agent in ctx.game.agents if agent.team == "wolves"]:
            here = animal.current_node_id
            energy[animal.name] -= 1
            if animal.team == "sheep" and here not in data["bare"]:
                energy[animal.name] += food["sheep"]
                data["bare"][here] = ctx.game.turn
            elif animal.team == "wolves" and here in prey:
                energy[animal.name] += food["wolves"]
                energy[prey.pop(here)] = 0
        for animal in ctx.game.agents:
            if energy[animal.name] <= 0:
                del energy[animal.name]
                ctx.agent.delete_agent(animal.name)
            elif energy[animal.name] >= birth[animal.team]:
                data["born"] += 1
                young = f"{animal.team}_born_{data['born']}"
                energy[animal.name] = energy[young] = energy[animal.name] // 2
                ctx.agent.create_agent(
                    young, start_node_id=animal.current_node_id, team=animal.team, strategy=animal.strategy
                )
        for team, other in (("sheep", "wolves"), ("wolves", "sheep")):
            if not ctx.agent.teams.get(team):
                ctx.game.end(f"no {team} are left", winner=other)
        tell(ctx)

    def draw(ctx, _):
        for node in set(ctx.graph.get_nodes()) - set(ctx.game.data["life"]["bare"]):
            at = ctx.graph.get_node(node)
            ctx.visual.render_circle(at.x, at.y, 4, (*GRASS, 110))

    draw.legend = LegendRows("", (LegendRow(GRASS, "grass"),))
    life.prepare = prepare
    life.drawer = draw
    return life
