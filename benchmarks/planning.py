"""Search against scripts, in scenarios that come with GAMMS, and what a turn of a model costs.

    python benchmarks/planning.py grid_tag              # 20 games by the script and by the search, the same seeds
    python benchmarks/planning.py pursuit --games 4 --first 1
    python benchmarks/planning.py speed                 # a turn of a model, in turn with `ctx.game.step`
    python benchmarks/planning.py budget --seconds 0.05 --games 300   # how long decisions take, by CPU time

Scenarios, teams, seeds and budgets are fixed here; settings were chosen on other seeds. Each game is played three times
with one seed: the team as its file says, by the rollout policy of the search alone, and by a plan of
`gamms.planning.mcts`; the other team is that of the file. The figures are the mean differences of the team's scores,
with bootstrap intervals of 95 %.
"""

import argparse
import itertools
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import gamms
from gamms import planning, scenario


def hunt(ctx):
    """Cut off the enemies in sight; without any, go to places that are drawn."""
    return gamms.strategies.intercept(ctx, otherwise=gamms.strategies.random_waypoints(ctx))


HUNT = {"rollout": hunt, "opponents": "gamms.strategies:flee", "value": "gamms.planning:closeness"}
CASES = {  # scenario -> team, and keywords of `mcts`
    "grid_tag": ("red", {"iterations": 16, "depth": 8, **HUNT}),
    "pursuit": ("pursuers", {"iterations": 16, "depth": 8, **HUNT}),
    "helsinki_pursuit": ("red", {"iterations": 12, "depth": 15, **HUNT}),
}
FIRST_SEED = 1000
CHASE = {"teams.red.strategy": "gamms.strategies:chase", "teams.blue.speed": None}
SCRIPTS = {"grid_tag": CHASE, "helsinki_pursuit": CHASE}  # what is searched against, in place of the files' own


def played(job):
    """Return the score of the team, the turns of the game, and the seconds of CPU."""
    name, seed, by = job
    team, options = CASES[name]
    began = time.process_time()
    with scenario.from_gallery(name).replace(**SCRIPTS.get(name, {})).build(seed) as ctx:
        ctx.logger.setLevel("ERROR")
        if by == "search":
            ctx.game.command(team, planning.mcts(**options))
        elif by == "rollout":
            policy = options["rollout"](ctx)
            for agent in ctx.agent.create_iter():
                if agent.team == team:
                    agent.register_strategy(policy)
        result = ctx.game.run()
    return result.scores.get(team, 0), result.turns, time.process_time() - began


def compare(name, games, first):
    """Play games by all three, and print a line of JSON."""
    seeds = range(first, first + games)
    with ProcessPoolExecutor() as pool:
        jobs = [(name, seed, by) for by in ("script", "rollout", "search") for seed in seeds]
        found = np.array(list(pool.map(played, jobs))).reshape(3, games, 3)
    script, rollout, search = found[:, :, 0]
    record = {"scenario": name, "team": CASES[name][0], "games": games}
    for by, (score, turns, seconds) in zip(("script", "rollout", "search"), found.mean(axis=1), strict=True):
        record |= {by: score, f"turns of {by}": turns, f"cpu_s of {by}": seconds}
    for by, others in (("script", script), ("rollout", rollout)):
        gains = search - others
        means = np.random.default_rng(1).choice(gains, (10_000, games)).mean(axis=1)
        record[f"gain on {by}"] = [gains.mean(), *np.percentile(means, [2.5, 97.5])]
    print(json.dumps(record, default=float), flush=True)


def speed(name="grid_tag", turns=20, rounds=40):
    """Print what a turn costs in a model and in its game, where all agents go by the same strategies, and a world."""
    spent = {"model": 0.0, "game": 0.0, "world": 0.0, "fork": 0.0}

    def timed(what, play):
        began = time.process_time()
        play()
        spent[what] += time.process_time() - began

    def look(state):
        model = []
        timed("fork", lambda: model.append(planning.Model(state, rollout=chase, opponents=flee)))
        for number in range(rounds):
            timed("world", lambda number=number: model[0].sample(number))
            timed("model", lambda: model[0].play(turns))
            played.game.reset(number)
            timed("game", lambda: played.game.run(turns))
        state["action"] = state["curr_pos"]

    with scenario.from_gallery(name).build(1, {"red_0": look}) as ctx, scenario.from_gallery(name).build(1) as played:
        chase, flee = gamms.strategies.chase(ctx), gamms.strategies.flee(ctx)
        ctx.game.step()
    per_turn = {what: 1e6 * spent[what] / rounds / turns for what in ("model", "game")}
    print(
        f"{name}: a turn of a model {per_turn['model']:.0f} us, of ctx.game.run {per_turn['game']:.0f} us; a world "
        f"{1e6 * spent['world'] / rounds:.0f} us; a model {1e3 * spent['fork']:.1f} ms"
    )


def budget(seconds, decisions, name="grid_tag"):
    """Print how long decisions with a budget take, in shares of it: by the CPU's clock, for machines that are busy."""
    sys.modules["gamms.planning.mcts"].perf_counter = time.process_time
    team, options = CASES[name]
    timed, took = {key: value for key, value in options.items() if key != "iterations"}, []
    for seed in itertools.count(1):
        plan = planning.mcts(seconds=seconds, **timed)

        def decide(states, plan=plan):
            began = time.process_time()
            plan(states)
            took.append(time.process_time() - began)

        decide.prepare = plan.prepare
        with scenario.from_gallery(name).replace(**SCRIPTS.get(name, {})).build(seed) as ctx:
            ctx.logger.setLevel("ERROR")
            ctx.game.command(team, decide)
            ctx.game.run(min(60, decisions - len(took)))
        if len(took) >= decisions:
            break
    shares = np.array(took) / seconds
    print(f"{name}: {decisions} decisions of {seconds} s take", end=" ")
    print(
        *(
            f"{part} {value:.2f}"
            for part, value in zip(("p50", "p99", "most"), np.percentile(shares, [50, 99, 100]), strict=True)
        )
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", choices=[*CASES, "speed", "budget"])
    parser.add_argument("--games", type=int, default=20)
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="the seed of the first game")
    parser.add_argument("--seconds", type=float, default=0.05, help="the budget of each decision")
    given = parser.parse_args()
    if given.case == "budget":
        budget(given.seconds, given.games)
    elif given.case == "speed":
        speed()
    else:
        compare(given.case, given.games, given.first)
