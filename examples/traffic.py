"""A courier drives through Helsinki while another process, which this file starts, slows streets and closes them."""

import json
import sys

import gamms

FROM, TO = "Mannerheimintie & Kaivokatu", "Unioninkatu & Aleksanterinkatu"


def be_the_traffic(jam: list[int], works: list[int]) -> None:
    """Answer each line that says which turn it is with what changes on the roads before it."""
    for line in sys.stdin:
        turn = json.loads(line)["turn"]
        roads = {"type": "roads", "turn": turn}
        if turn == 1:
            roads["travel_time"] = dict.fromkeys(jam, 12.0)  # seconds for some ten metres
        if turn == 4:
            roads["close"] = works
        print(json.dumps(roads), flush=True)


def play(title: str, rule=None) -> None:
    game = {"speed_unit": "metres_per_second", "turn_seconds": 10.0, "weight": "travel_time"}
    with gamms.create_context(seed=1, game=game) as ctx:
        gamms.osm.helsinki(ctx)
        start, goal = (ctx.graph.find(name).nodes[0] for name in (FROM, TO))
        courier = {"speed": 14.0, "team": "couriers", "strategy": lambda state: state.update(action=goal)}
        ctx.agent.create_agent("courier", start_node_id=start, **courier)
        ctx.game.add(gamms.rules.reach("couriers", goal))
        if rule is not None:
            ctx.game.add(rule, phase="before")
        streets = {}

        @ctx.game.add
        def note_streets(ctx):
            for leg in ctx.game.moves["courier"].legs:
                streets[ctx.graph.edge_attributes(leg.edge).get("name", "?")] = None

        result = ctx.game.run(max_turns=90)
        print(f"{title}: {result.reason} after {result.turns * 10} seconds by {', '.join(streets)}")
        print(f"  {len(ctx.graph.closed_roads)} edges are closed")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        be_the_traffic(*json.loads(sys.argv[1]))
        sys.exit()
    with gamms.create_context() as ctx:
        gamms.osm.helsinki(ctx)
        streets = [ctx.graph.find(name).edges for name in ("Aleksanterinkatu", "Pohjoisesplanadi")]
    play("free roads")
    with gamms.bridge.Process([sys.executable, __file__, json.dumps(streets)]) as link:
        play("traffic", gamms.bridge.traffic(link, wait_s=60.0))
