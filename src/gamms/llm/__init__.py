"""Language models as players: agents that ask an OpenAI-compatible server what to do.

    strategy = gamms.llm.Strategy("http://localhost:11434/v1", "llama3.1", "Catch the blue agents.")

`strategy.py` has the strategy; read it first. `asking.py` has the calls for a decision, `questions.py` makes a text and
a schema of a state, and an action of an answer; `limits.py` counts tokens and money in a game; `decisions.py` has the
file of what was decided; `server.py` sends a request, and is the only file that knows the client library. A client of
strategies, the game and the recorder: May import: `strategies`, `recorder` and below. To describe states in another
way, write a template: see docs/llm.md.
"""

from gamms.llm.limits import Options
from gamms.llm.server import connect
from gamms.llm.strategy import MissingDecision, Strategy

__all__ = ["MissingDecision", "Options", "Strategy", "connect"]

FOR_SCENARIOS = {"Strategy": Strategy}
"""What scenario files may name, where their reader allows it."""
