"""Measure pages of recordings in a headless Chromium that renders in software: size, first picture, seeking, frames.

    python benchmarks/viewer.py [game.ggr …]     # by default 1,000 agents on 20,448 edges, 300 turns

Times are those of the browser's own clock, so the machine must be quiet.
"""

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "web"))

from browser import browser

import gamms

MEASURE = """
new Promise((done) => {
  const app = gamms, middle = (values, share) => values.sort((a, b) => a - b)[Math.floor(share * values.length)];
  const timed = (work) => { const begun = performance.now(); work(); return performance.now() - begun; };
  const seeks = Array.from({length: 60}, (_, i) => timed(() => app.seek(Math.floor(app.turns * ((i * 0.618) % 1)))));
  const found = {"first picture": app.firstPaintMs};
  Object.assign(found, {"seek, median": middle(seeks, 0.5), "seek, 95 %": middle(seeks, 0.95)});
  app.seek(50);
  app.play();
  const gaps = [], paints = [];
  let last = performance.now();
  const tick = (now) => {
    gaps.push(now - last);
    paints.push(app.paintMs);
    last = now;
    if (gaps.length < 240) { requestAnimationFrame(tick); return; }
    app.pause();
    Object.assign(found, {"frame to frame, median": middle(gaps, 0.5), "frame to frame, 95 %": middle(gaps, 0.95)});
    found["script of a frame, median"] = middle(paints, 0.5);
    done(found);
  };
  requestAnimationFrame(tick);
})
"""


def many(path):
    """Record 1,000 random walkers on a grid of 72 x 72 nodes."""
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(72, 72))
        for i in range(1000):
            team, walk = ("red", "blue")[i % 2], gamms.strategies.random_walk
            ctx.agent.create_agent(f"a{i}", start_node_id=i * 5, team=team, strategy=walk)
        ctx.record.start(path)
        ctx.game.run(max_turns=300)


def main():
    """Measure each recording."""
    with tempfile.TemporaryDirectory() as folder, browser() as page:
        paths = [Path(name) for name in sys.argv[1:]]
        if not paths:
            paths = [Path(folder) / "many.ggr"]
            many(paths[0])
        for path in paths:
            out = Path(folder) / "page.html"
            with gamms.recorder.open(path) as recording:
                recording.save(out)
            page.open(out)
            page.settle()
            print(f"{path.name}: {out.stat().st_size / 1e6:.2f} MB")
            for name, value in page.value(MEASURE).items():
                print(f"  {name:<28}{value:8.1f} ms")


if __name__ == "__main__":
    main()
