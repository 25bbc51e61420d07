"""A strategy that is an object may add rules and collectors when the game begins: by its `prepare(ctx)`."""

import gamms


class Counting:
    """Stays, and has a rule that counts its turns."""

    def prepare(self, ctx):
        if all(named.rule != self.count for named in ctx.game.rules):
            ctx.game.add(self.count)

    def __call__(self, state):
        state["action"] = state["curr_pos"]

    def count(self, ctx):
        ctx.game.scores["turns"] += 1


def new_game(strategy, *names):
    ctx = gamms.create_context(seed=1)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    for name in names:
        ctx.agent.create_agent(name, start_node_id=0, strategy=strategy)
    return ctx


def test_a_strategy_that_several_agents_share_is_prepared_once():
    with new_game(Counting(), "anna", "bert") as ctx:
        assert ctx.game.run(3).scores == {"turns": 3}


def test_a_strategy_that_comes_later_is_prepared_at_the_next_turn():
    with new_game(None, "anna") as ctx:
        ctx.game.run(2)
        ctx.agent.get_agent("anna").register_strategy(Counting())
        assert ctx.game.run(2).scores == {"turns": 2}


def test_the_strategy_of_a_team_is_prepared_too():
    with new_game(None, "anna") as ctx:
        ctx.agent.create_team("red", [1, 2], strategy=Counting())
        assert ctx.game.run(2).scores == {"turns": 2}


def test_a_reset_game_keeps_additions_before_its_first_turn():
    with new_game(Counting(), "anna") as ctx:
        first = ctx.game.run(2)
        ctx.game.reset()
        assert ctx.game.run(2) == first
        assert len(ctx.game.rules) == 1


def test_a_fork_prepares_its_own_strategies():
    with new_game(Counting(), "anna") as ctx:
        ahead = ctx.game.fork(1)
        assert ahead.run(2).scores == {"turns": 2}
        assert ctx.game.rules == ()


class Drawing:
    """Goes to a node that it has drawn before the first turn."""

    def prepare(self, ctx):
        self.goal = int(ctx.rng.integers(9))

    def __call__(self, state):
        state["action"] = state["legal"][self.goal % len(state["legal"])]


def places(ctx):
    ctx.game.run(1)
    return ctx.agent.get_agent("anna").current_node_id


def test_a_strategy_that_draws_in_preparation_draws_again_after_each_reset():
    seeds = [1, 2, 3, 4, 1]
    with new_game(Drawing(), "anna") as ctx:
        again = [(ctx.game.reset(seed), places(ctx))[1] for seed in seeds]
    alone = []
    for seed in seeds:
        with new_game(Drawing(), "anna") as ctx:
            ctx.game.reset(seed)
            alone.append(places(ctx))
    assert again == alone
    assert len({*alone}) > 1
