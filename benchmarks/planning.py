"""Search against scripts, in scenarios that come with GAMMS, and what a turn of a model costs.

    python benchmarks/planning.py grid_tag              # 24 games by the script and by the search, the same seeds
    python benchmarks/planning.py pursuit --games 4 --first 1
    python benchmarks/planning.py speed                 # a turn of a model, in turn with `ctx.game.step`
    python benchmarks/planning.py gains                 # 24 games of each scenario
    python benchmarks/planning.py budget --seconds 0.05 --games 500   # how long decisions take, by CPU and wall time

Scenarios, teams, seeds and budgets are fixed here; settings were chosen on other seeds. Each game is played twice with
one seed: the team by the strategy of its file, and by a plan of `gamms.planning.mcts` whose rollout policy is that same
strategy, and whose opponents do what the file says, without seeing more than in the game. The figures are the mean
differences of the team's points and of its wins, with bootstrap intervals of 95 %.
"""

import argparse
import itertools
import json
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import gamms
from gamms import planning, scenario

PURSUIT = {"value": "gamms.planning:closeness"}
CASES = {  # scenario -> team, and keywords of `mcts`
    "grid_tag": ("red", {"iterations": 16, "depth": 8, **PURSUIT}),
    "pursuit": ("pursuers", {"iterations": 16, "depth": 8, **PURSUIT}),
    "people_and_machines": ("runner", {"iterations": 24, "depth": 15}),
    "helsinki_pursuit": ("red", {"iterations": 12, "depth": 15, **PURSUIT}),
}
FIRST_SEED = 1000


def searched(name, **options):
    """Return a scenario of the gallery in which a team searches, on top of the strategy that its file gives it."""
    given, team = scenario.from_gallery(name), CASES[name][0]
    teams = given.to_dict()["teams"]
    script = {one: about["strategy"] for one, about in teams.items()}
    script = {one: {"function": how} if isinstance(how, str) else how for one, how in script.items()}
    own = {key: value for key, value in teams[team].items() if key != "strategy"}
    options |= {"rollout": script.pop(team), "opponents": script}
    return given.replace(**{f"teams.{team}": {**own, "plan": {"function": "gamms.planning:mcts", "with": options}}})


def played(job):
    """Return the points of the team, whether it has won, the turns of the game, and the seconds of CPU."""
    name, seed, by = job
    team, options = CASES[name]
    began = time.process_time()
    game = scenario.from_gallery(name) if by == "script" else searched(name, **options)
    result = game.play(seed)
    return result.scores.get(team, 0), result.winner == team, result.turns, time.process_time() - began


def compare(name, games, first, workers):
    """Play games by both, and print a line of JSON."""
    seeds = range(first, first + games)
    with ProcessPoolExecutor(workers) as pool:
        jobs = [(name, seed, by) for by in ("script", "search") for seed in seeds]
        found = np.array(list(pool.map(played, jobs)), float).reshape(2, games, 4)
    record = {"scenario": name, "team": CASES[name][0], "games": games}
    for by, means in zip(("script", "search"), found.mean(axis=1), strict=True):
        whats = ("points", "wins", "turns", "cpu_s")
        record |= {f"{what} of {by}": mean for what, mean in zip(whats, means, strict=True)}
    for column, what in enumerate(("points", "wins")):
        gains = found[1, :, column] - found[0, :, column]
        means = np.random.default_rng(1).choice(gains, (10_000, games)).mean(axis=1)
        record[f"gain in {what}"] = [gains.mean(), *np.percentile(means, [2.5, 97.5])]
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
    """Print how long decisions with a budget take, in shares of it: by the clock, and by that of the CPU.

    On a busy machine the clock counts others, too; CPU time cannot be less than what the search took itself.
    """
    took = []
    for seed in itertools.count(1):
        with searched(name, seconds=seconds, **{**CASES[name][1], "iterations": None}).build(seed) as ctx:
            ctx.logger.setLevel("ERROR")
            team = CASES[name][0]
            plan = ctx.game.plans[team].function

            def decide(states, plan=plan):
                began, cpu = time.perf_counter(), time.process_time()
                plan(states)
                took.append((time.perf_counter() - began, time.process_time() - cpu))

            decide.prepare = plan.prepare
            ctx.game.command(team, decide)
            ctx.game.run(min(60, decisions - len(took)))
        if len(took) >= decisions:
            break
    for clock, spent in zip(("clock", "CPU"), np.array(took).T / seconds, strict=True):
        parts = zip(("median", "99 %", "most"), np.percentile(spent, [50, 99, 100]), strict=True)
        print(f"{name}, {decisions} decisions of {seconds} s, by the {clock}:", end=" ")
        print(*(f"{part} {value:.2f}" for part, value in parts), f"above 1.1: {(spent > 1.1).sum()}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", choices=[*CASES, "gains", "speed", "budget"])
    parser.add_argument("--games", type=int, default=24)
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="the seed of the first game")
    parser.add_argument("--workers", type=int, default=None, help="processes; as many as there are cores")
    parser.add_argument("--seconds", type=float, nargs="+", default=[0.05], help="budgets of each decision")
    given = parser.parse_args()
    if given.case == "budget":
        for seconds in given.seconds:
            budget(seconds, given.games)
    elif given.case == "speed":
        speed()
    else:
        for name in CASES if given.case == "gains" else [given.case]:
            compare(name, given.games, given.first, given.workers)
