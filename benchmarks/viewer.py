"""Measure pages of recordings in a headless Chromium that renders in software: size, first picture, seeking, frames.

    python benchmarks/viewer.py [game.ggr …]     # by default two games of 300 turns: 10 agents in Helsinki with its
                                                 # buildings as walls, and 1,000 agents on 20,448 edges

Times are those of the browser's own clock, so the machine must be quiet for them; processor times, of the thread that
runs the viewer and of all threads of the page with what they rasterize, hold on a busy one, too.
"""

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "web"))

from browser import browser

import gamms

SEEKS, FRAMES = 60, 240
SEEK = f"""
(() => {{
  const middle = (values, share) => values.sort((a, b) => a - b)[Math.floor(share * values.length)];
  const timed = (work) => {{ const begun = performance.now(); work(); return performance.now() - begun; }};
  const turns = Array.from({{length: {SEEKS}}}, (_, i) => Math.floor(gamms.turns * ((i * 0.618) % 1)));
  const seeks = turns.map((turn) => timed(() => gamms.seek(turn)));
  return {{"seek, median": middle(seeks, 0.5), "seek, 95 %": middle(seeks, 0.95)}};
}})()
"""
PAINT = f"""
(async () => {{
  const middle = (values, share) => values.sort((a, b) => a - b)[Math.floor(share * values.length)];
  const frame = () => new Promise(requestAnimationFrame);
  const range = document.querySelector("input[type=range]");
  const times = [];
  for (let i = 0; i < {SEEKS}; i++) {{
    await frame();
    const begun = performance.now();
    range.value = Math.floor(gamms.turns * ((i * 0.618) % 1));
    range.dispatchEvent(new Event("input"));
    await frame();  // which is painted then
    await frame();
    times.push(performance.now() - begun);
  }}
  return {{"seek by the timeline until painted, median": middle(times, 0.5),
           "seek by the timeline until painted, 95 %": middle(times, 0.95)}};
}})()
"""
PLAY = f"""
new Promise((done) => {{
  const middle = (values, share) => values.sort((a, b) => a - b)[Math.floor(share * values.length)];
  gamms.seek(50);
  gamms.play();
  const gaps = [], paints = [];
  let last = performance.now();
  const tick = (now) => {{
    gaps.push(now - last);
    paints.push(gamms.paintMs);
    last = now;
    if (gaps.length < {FRAMES}) {{ requestAnimationFrame(tick); return; }}
    gamms.pause();
    done({{"frame to frame, median": middle(gaps, 0.5), "frame to frame, 95 %": middle(gaps, 0.95),
           "frame to frame, 99 %": middle(gaps, 0.99), "script of a frame, median": middle(paints, 0.5)}});
  }};
  requestAnimationFrame(tick);
}})
"""


def measured(page):
    """Return milliseconds by what they are of."""
    before = processor_ms(page)
    found = {"first picture": page.value("gamms.firstPaintMs"), "… until all is read, processor": before["thread"]}
    found |= page.value(SEEK)
    found["seek, processor"] = (processor_ms(page)["thread"] - before["thread"]) / SEEKS
    before = processor_ms(page)
    found |= page.value(PAINT)
    found["seek by the timeline, processor"] = (processor_ms(page)["all"] - before["all"]) / SEEKS
    before = processor_ms(page)
    found |= page.value(PLAY)
    after = processor_ms(page)
    found["frame, processor, thread"] = (after["thread"] - before["thread"]) / FRAMES
    found["frame, processor, all of the page"] = (after["all"] - before["all"]) / FRAMES
    return found


def processor_ms(page):
    """Return the processor time that the page has taken, of its main thread and of all."""
    metrics = {one["name"]: 1000.0 * one["value"] for one in page.call("Performance.getMetrics")["metrics"]}
    return {"thread": metrics["TaskDuration"], "all": metrics["ProcessTime"]}


def helsinki(path):
    """Record 300 turns of capture the flag in Helsinki, with its buildings as walls, and what was sensed."""
    from gamms.demo import Team, capture_the_flag

    game = capture_the_flag([Team("red", 5), Team("blue", 5)], 300).replace(map={"helsinki": {"buildings": True}})
    with game.build(1) as ctx:
        ctx.record.start(path, sensed=True)
        ctx.game.run()


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
            paths = [Path(folder) / "helsinki.ggr", Path(folder) / "many.ggr"]
            helsinki(paths[0])
            many(paths[1])
        for path in paths:
            out = Path(folder) / "page.html"
            with gamms.recorder.open(path) as recording:
                recording.save(out)
                turns = recording.turns
            page.call("Performance.enable", timeDomain="threadTicks")
            page.open(out)
            page.settle()
            print(f"{path.name}: {turns} turns, {out.stat().st_size / 1e6:.2f} MB")
            for name, value in measured(page).items():
                print(f"  {name:<44}{value:8.1f} ms")


if __name__ == "__main__":
    main()
