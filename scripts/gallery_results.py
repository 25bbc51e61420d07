"""Plays games of the gallery with the seeds 0 to 99 and writes into `results.json` who wins.

`python scripts/gallery_results.py patrol search` plays two games, and without names all. For each it prints the results
as `docs/gallery.md` has them.
"""

import json
import sys
from typing import Any

from gamms import scenario
from gamms.cli.gallery import list_statistics
from gamms.experiment.statistics import estimate_mean, estimate_rate

GAMES = 100


def main(names: list[str]) -> None:
    """Play the games, all without names, and replace their results in the file."""
    file = next(iter(scenario.gallery().values())).with_name("results.json")
    results = json.loads(file.read_text(encoding="utf-8"))
    for name in names or scenario.gallery():
        results[name] = measured(name)
        file.write_text(json.dumps(dict(sorted(results.items())), indent=1) + "\n", encoding="utf-8")
        print(f"{name}: {list_statistics()[name]}")


def measured(name: str, games: int = GAMES) -> dict[str, Any]:
    """Return the results of a game; games without winners have scores instead."""
    game = scenario.from_gallery(name)
    if name == "language_model":  # no server answers there, so that the fallback plays
        game = game.replace(**{"teams.hunters.strategy.with.client": "http://127.0.0.1:9/v1"})
    with game.build(0) as ctx:
        ctx.logger.setLevel("CRITICAL")
        results = []
        for seed in range(games):
            ctx.game.reset(seed)
            results.append(ctx.game.run())
    turns = sorted(result.turns for result in results)[games // 2]
    winners = [result.winner or "" for result in results]
    found: dict[str, Any] = {"games": games, "wins": {}, "turns": turns}
    if any(winners):
        teams = [*game.spec.teams, ""]
        rates = {team: estimate_rate(winners.count(team), games) for team in teams if team in winners}
        found["wins"] = {team: [winners.count(team), *_ends(rate)] for team, rate in rates.items()}
    else:
        means = {key: estimate_mean([result.scores[key] for result in results]) for key in results[0].scores}
        found["scores"] = {key: [round(mean.value, 3), *_ends(mean)] for key, mean in means.items()}
    return found


def _ends(interval: Any) -> list[float]:
    return [round(interval.low, 3), round(interval.high, 3)]


if __name__ == "__main__":
    main(sys.argv[1:])
