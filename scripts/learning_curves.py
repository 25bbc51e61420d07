"""Train the examples of learning with five seeds, and draw their curves for docs/learning.md.

    python scripts/learning_curves.py              # trains for some minutes of CPU time, and writes benchmarks/results
    python scripts/learning_curves.py --draw       # only draws docs/figures/learning_curves from these results

Needs the extras `train` and `rl`. Each seed gives the same curve again.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

Curves = dict[str, list[list[float]]]  # example -> for each seed, a number for each iteration

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "figures" / "learning_curves" / "numbers.json"
FIGURES = ROOT / "docs" / "figures" / "learning_curves"
COMMAND = "python scripts/learning_curves.py"
SEEDS = (1, 2, 3, 4, 5)
LABELS = {  # example -> the title of its figure, and the name of its numbers
    "many_maps": ("One policy for many maps", "evaders caught in training"),
    "self_play": ("Self-play in a small pursuit", "gap to best responses"),
}


def train_all() -> Curves:
    """Train all examples with all seeds, and return their curves."""
    sys.path.insert(0, str(ROOT / "examples" / "rl"))
    import many_maps
    import self_play

    found: Curves = {name: [] for name in LABELS}
    for seed in SEEDS:
        with TemporaryDirectory() as folder:
            shares = many_maps.learn(Path(folder) / "policy.safetensors", seed, iterations=20, num_games=64)
        found["many_maps"].append([round(share, 4) for share in shares])
        gaps = self_play.play_itself(seed=seed)
        found["self_play"].append([round(float(most - least), 4) for most, least in gaps])
    return found


def draw(curves: Curves, folder: Path) -> None:
    """Draw a figure for each example: the curve of each seed, and their mean."""
    from matplotlib import pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    for name, (title, numbers) in LABELS.items():
        figure, axes = plt.subplots(figsize=(5.2, 3.2), layout="constrained")
        for values in curves[name]:
            axes.plot(range(1, len(values) + 1), values, color="tab:blue", linewidth=0.8, alpha=0.4)
        means = [sum(column) / len(column) for column in zip(*curves[name], strict=True)]
        axes.plot(range(1, len(means) + 1), means, color="tab:blue", linewidth=2.0)
        axes.set(title=title, xlabel="iteration", ylabel=numbers, ylim=(0.0, 1.0))
        axes.grid(alpha=0.3)
        figure.savefig(folder / f"{name}.png", dpi=110, metadata={"Software": None})
        plt.close(figure)


def main() -> None:
    """Train, unless `--draw` is given, and draw."""
    if "--draw" not in sys.argv:
        RESULTS.write_text(json.dumps({"command": COMMAND, "seeds": SEEDS, "curves": train_all()}) + "\n")
    draw(json.loads(RESULTS.read_text())["curves"], FIGURES)


if __name__ == "__main__":
    main()
