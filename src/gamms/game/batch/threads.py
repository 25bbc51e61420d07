"""Games shared out among threads, in functions of the core, which let other threads go on meanwhile."""

from collections.abc import Callable
from threading import Thread


def in_threads(play: Callable[[int, int, int], object], games: int, threads: int) -> None:
    """Call `play(thread, begin, end)` for equal parts of the games, each part in a thread of its own.

    What several raise is raised of the first one, when all have ended.

    Args:
        play: is called with the number of the thread and of the first game, and that behind the last one.
        games: how many there are.
        threads: how many play; the last part is played by this thread.
    """
    bounds = [games * part // threads for part in range(threads + 1)]
    errors: dict[int, BaseException] = {}

    def play_part(number: int) -> None:
        try:
            play(number, bounds[number], bounds[number + 1])
        except BaseException as error:  # noqa: BLE001 - raised below
            errors[number] = error

    others = [Thread(target=play_part, args=(number,)) for number in range(threads - 1)]
    for one in others:
        one.start()
    play_part(threads - 1)
    for one in others:
        one.join()
    if errors:
        raise errors[min(errors)]
