"""Every package is typed after `import gamms`."""

import gamms

ctx = gamms.create_context(seed=1)
gamms.osm.helsinki(ctx)
gamms.strategies.chase(ctx, otherwise=gamms.strategies.stay)
gamms.rules.tag("red", "blue")
gamms.scenario.load("game.yaml").play(seed=7)
gamms.recorder.open("game.ggr")
game = gamms.scenario.load("game.yaml")
gamms.rl.parallel_env(game, team="red").reset(seed=1)
gamms.rl.parallel_env(game, teem="red")  # type: ignore[call-arg]
gamms.planning.mcts(iterations=40, opponents="gamms.strategies:flee")
gamms.planning.mcts(iteration=40)  # type: ignore[call-arg]
gamms.solve.solve(game, reward="win").value.is_integer()
gamms.solve.solve(game, reward="wins")  # type: ignore[arg-type]
gamms.llm.Strategy("http://localhost/v1", "model", "Go.", seconds=2.0)
gamms.llm.Strategy("http://localhost/v1", "model", "Go.", second=2.0)  # type: ignore[call-arg]
ctx.game.add(gamms.bridge.drive("anna", [{"x": 1.0, "y": 2.0}], limit_s=5.0))
gamms.bridge.drive("anna", [], limit=5.0)  # type: ignore[call-arg]
game.batch(10).step({"red": [0] * 10})
gamms.rulez  # type: ignore[attr-defined]
