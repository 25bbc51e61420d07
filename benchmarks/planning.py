"""Search against scripts, in scenarios that come with GAMMS, and what a turn of a model costs.

    python benchmarks/planning.py grid_tag              # 20 games by the script and by the search, the same seeds
    python benchmarks/planning.py pursuit --games 4
    python benchmarks/planning.py speed                 # a turn of a model, in turn with `ctx.game.step`

Scenarios, teams, seeds and budgets are fixed here. Each game is played twice with one seed: the team as its file says,
and by a plan of `gamms.planning.mcts`; the other team is that of the file. The figure is the mean difference of the
team's scores, with a bootstrap interval of 95 %.
"""

import argparse
import json
import os
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import gamms
from gamms import planning, scenario

DATA = Path(gamms.__file__).parent / "data"
HUNT = {"rollout": "gamms.strategies:chase", "opponents": "gamms.strategies:flee", "value": "gamms.planning:closeness"}
CASES = {  # scenario -> team, and keywords of `mcts`
    "grid_tag": ("red", {"iterations": 40, "depth": 8, **HUNT}),
    "pursuit": ("pursuers", {"iterations": 40, "depth": 8, **HUNT}),
    "helsinki_pursuit": ("red", {"iterations": 40, "depth": 20, **HUNT}),
}
FIRST_SEED = 1000


def loaded(name):
    """Return a scenario; one that `gamms new` copies, with its code in a folder."""
    code = DATA / f"{name}.py.txt"
    if not code.exists():
        return scenario.load(DATA / f"{name}.yaml")
    folder = Path(tempfile.gettempdir()) / f"gamms_planning_{os.getuid()}_{name}"
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.yaml").write_bytes((DATA / f"{name}.yaml").read_bytes())
    (folder / "strategies.py").write_bytes(code.read_bytes())
    return scenario.load(folder / f"{name}.yaml")


def scores(job):
    """Return the score of the team by its script and by the search, and the seconds of CPU of the latter."""
    name, seed = job
    team, options = CASES[name]
    found = []
    for searches in (False, True):
        began = time.process_time()
        with loaded(name).build(seed) as ctx:
            ctx.logger.setLevel("ERROR")
            if searches:
                ctx.game.command(team, planning.mcts(**options))
            found.append(ctx.game.run().scores.get(team, 0))
    return *found, time.process_time() - began


def compare(name, games):
    """Play games by both, and print a line of JSON."""
    with ProcessPoolExecutor() as pool:
        pairs = np.array(list(pool.map(scores, [(name, FIRST_SEED + number) for number in range(games)])))
    gains = pairs[:, 1] - pairs[:, 0]
    means = np.random.default_rng(1).choice(gains, (10_000, games)).mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    record = {"scenario": name, "team": CASES[name][0], "games": games, "script": pairs[:, 0].mean()}
    record |= {"search": pairs[:, 1].mean(), "gain": gains.mean(), "from": low, "to": high, "cpu_s": pairs[:, 2].mean()}
    print(json.dumps({key: round(one, 3) if isinstance(one, float) else one for key, one in record.items()}))


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

    with loaded(name).build(1, {"red_0": look}) as ctx, loaded(name).build(1) as played:
        chase, flee = gamms.strategies.chase(ctx), gamms.strategies.flee(ctx)
        ctx.game.step()
    per_turn = {what: 1e6 * spent[what] / rounds / turns for what in ("model", "game")}
    print(
        f"{name}: a turn of a model {per_turn['model']:.0f} us, of ctx.game.run {per_turn['game']:.0f} us; a world "
        f"{1e6 * spent['world'] / rounds:.0f} us; a model {1e3 * spent['fork']:.1f} ms"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", choices=[*CASES, "speed"])
    parser.add_argument("--games", type=int, default=20)
    given = parser.parse_args()
    speed() if given.case == "speed" else compare(given.case, given.games)
