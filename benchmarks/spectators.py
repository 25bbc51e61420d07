"""Measure what spectators cost a game that is served: turn times with 100 of them, with one, and with none.

    python benchmarks/spectators.py [SPECTATORS] [PAIRS]

The game is that of `gamms demo`, 300 turns. The spectators are in a process of their own and read all that they are
sent. Games with none, one and all take turns. Two figures for each: the processor time of the thread that plays,
and the time that passes, which other processes on the same cores make longer.
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
    """Return the milliseconds of a turn, of the thread's own and that pass, and how many bytes were sent."""
    with game.build(1) as ctx, web.serve(ctx, speed=None) as live:
        ctx.game.step()
        watching = subprocess.Popen(
            [sys.executable, __file__, "--watch", live.url, str(spectators)], stdout=subprocess.PIPE, text=True
        )
        while len(live.connections) < spectators:
            time.sleep(0.01)
        time.sleep(1.0)  # until all have been sent the map
        own, passed = 0.0, 0.0
        for _ in range(TURNS):
            begun, begun_own = time.perf_counter(), time.thread_time()
            ctx.game.step()
            own, passed = own + time.thread_time() - begun_own, passed + time.perf_counter() - begun
            if speed is not None:
                time.sleep(1.0 / speed)
        dropped = sum(connection.counts["dropped"] for connection in live.connections)
    sent = int(watching.communicate(timeout=60)[0])
    return 1000 * own / TURNS, 1000 * passed / TURNS, sent, dropped


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
    """Play pairs of games, as fast as possible and at the pace of people."""
    spectators, pairs = (int(text) for text in (*sys.argv[1:], "100", "5")[:2])
    game = capture_the_flag((Team("red", 5), Team("blue", 5)), 2 * TURNS)
    for speed in (None, 20.0):
        ratios = []
        for _ in range(pairs):
            unseen, alone, watched = (play(game, count, speed) for count in (0, 1, spectators))
            ratios.append([watched[i] / alone[i] for i in range(2)])
            print(
                f"speed {speed}: {unseen[0]:.2f}, {alone[0]:.2f}, {watched[0]:.2f} ms of its own; "
                f"{unseen[1]:.2f}, {alone[1]:.2f}, {watched[1]:.2f} ms pass; "
                f"{watched[2] / 1e6:.1f} MB sent, {watched[3]} turns dropped",
                flush=True,
            )
        own, passed = (statistics.median(column) for column in zip(*ratios, strict=True))
        print(f"speed {speed}: {own:.2f} times the thread's own time, {passed:.2f} times the time that passes")


if __name__ == "__main__":
    if "--watch" in sys.argv:
        asyncio.run(watch(sys.argv[2], int(sys.argv[3])))
    else:
        main()
