"""Measure what spectators cost a game that is served: turn times with 100 of them, one, none, and not served at all.

    python benchmarks/spectators.py [SPECTATORS] [ROUNDS]

The game is that of `gamms demo`, 300 turns. The spectators are in a process of their own and read all that they are
sent. The four take turns. Two figures for each: the processor time of the thread that plays, as a mean of all turns,
and the time that passes, as their median, for other processes on the same cores stretch some of them.
"""

import asyncio
import json
import statistics
import subprocess
import sys
import time

from gamms import web
from gamms.demo import Team, capture_the_flag

TURNS = 300


def play(game, spectators, speed):
    """Return the milliseconds of a turn, of the thread's own and that pass, and what was sent; None: not served."""
    with game.build(1) as ctx:
        if spectators is None:
            ctx.game.step()
            return (*turn_times(ctx, speed), 0, 0)
        with web.serve(ctx, speed=None) as live:
            ctx.game.step()
            watching = subprocess.Popen(
                [sys.executable, __file__, "--watch", live.url, str(spectators)], stdout=subprocess.PIPE, text=True
            )
            while len(live.connections) < spectators:
                time.sleep(0.01)
            time.sleep(1.0)  # until all have been sent the map
            times = turn_times(ctx, speed)
            dropped = sum(connection.counts["dropped"] for connection in live.connections)
        return (*times, int(watching.communicate(timeout=60)[0]), dropped)


def turn_times(ctx, speed):
    """Play, and return the milliseconds of a turn: the mean of the thread's own, the median of those that pass."""
    passed, own = [], 0.0
    for _ in range(TURNS):
        begun, begun_own = time.perf_counter(), time.thread_time()
        ctx.game.step()
        own += time.thread_time() - begun_own
        passed.append(time.perf_counter() - begun)
        if speed is not None:
            time.sleep(1.0 / speed)
    return 1000 * own / TURNS, 1000 * statistics.median(passed)


async def watch(url, spectators):
    """Read what is sent to so many spectators, and print how many bytes that were."""
    from websockets.asyncio.client import connect

    address, _, token = url.partition("#")

    joining = asyncio.Semaphore(16)  # a server lets few join at once

    async def read():
        size = 0
        async with joining:
            socket = await connect(address.replace("http", "ws") + "live", proxy=None, max_size=None)
            await socket.send(json.dumps({"token": token}))
            await socket.recv()
        async with socket:
            try:
                async for message in socket:
                    size += len(message)
            except Exception:  # noqa: BLE001 - the server has ended
                return size
        return size

    print(sum(await asyncio.gather(*(read() for _ in range(spectators)))))


def main():
    """Play rounds of games, as fast as possible and at the pace of people."""
    spectators, rounds = (int(text) for text in (*sys.argv[1:], "100", "5")[:2])
    counts = (None, 0, 1, spectators)
    game = capture_the_flag((Team("red", 5), Team("blue", 5)), 2 * TURNS)
    for speed in (None, 20.0):
        found = [[play(game, count, speed) for count in counts] for _ in range(rounds)]
        for count, games in zip(counts, zip(*found, strict=True), strict=True):
            name = "not served" if count is None else f"{count} spectators"
            own, passed = (statistics.median(one[i] for one in games) for i in range(2))
            ratios = [
                statistics.median(one[i] / none[1][i] for one, none in zip(games, found, strict=True)) for i in range(2)
            ]
            print(
                f"speed {speed}, {name}: {own:.2f} ms of its own ({ratios[0]:.2f} of none), {passed:.2f} ms pass "
                f"({ratios[1]:.2f}); {games[0][2] / 1e6:.1f} MB sent, {games[0][3]} turns dropped",
                flush=True,
            )


if __name__ == "__main__":
    if "--watch" in sys.argv:
        asyncio.run(watch(sys.argv[2], int(sys.argv[3])))
    else:
        main()
