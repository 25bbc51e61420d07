"""Language models as players: agents that ask an OpenAI-compatible server for their actions.

    strategy = gamms.llm.Strategy("http://localhost:11434/v1", "llama3.1", "Catch the blue agents.")

`strategy.py` holds the strategy; read it first. `asking.py` makes the calls for one decision. `questions.py` turns a
state into a text and a schema, and an answer into an action. `limits.py` counts tokens and money in a game.
`decisions.py` reads and writes the file of recorded decisions. `server.py` sends a request and is the only file that
knows the client library. May import: `strategies`, `recorder` and below. To describe states in another way, write a
template: see docs/llm.md.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.llm.limits import Options
from gamms.llm.server import connect
from gamms.llm.strategy import MissingDecision, Strategy

__all__ = ["MissingDecision", "Options", "Strategy", "connect"]

_suggest_names(__name__, __all__)

FOR_SCENARIOS = {"Strategy": Strategy}
"""Names that scenario files may use, if the reader of the file allows them."""
