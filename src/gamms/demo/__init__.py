"""The demo: capture the flag between two teams on the streets of a city. A client of clients: it plays a scenario.

The game is a file, `data/capture_the_flag.yaml`. Read `match.py` first, which changes it to what was asked for, then
`strategies.py`. `show.py` draws, `report.py` tells what happened.
"""

from gamms.demo.match import FILE, Team, capture_the_flag, check_ways

__all__ = ["FILE", "Team", "capture_the_flag", "check_ways"]
