"""The demo: capture the flag between two teams on the streets of a city. A guest: it uses a context as you would.

Read `match.py` first (one game from start to end, in the paper's own loop), then `strategies.py`. `world.py` places
flags and teams, `rules.py` tags and scores, `show.py` draws, `report.py` tells what happened.
"""

from gamms.demo.match import Match, play
from gamms.demo.world import Team, World

__all__ = ["Match", "Team", "World", "play"]
