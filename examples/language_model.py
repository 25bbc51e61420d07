"""Two pursuers that ask a language model what to do.

    python examples/language_model.py

So that this runs anywhere, the model is a small server on this machine with scripted answers: it reads the text that
it gets, as a model does, and chooses the move nearest to an agent in sight. For a real one, replace
`with scripted_server() as address:` by the address of a server with the interface of OpenAI's chat completions, such as

    address = "http://localhost:11434/v1"    # Ollama; the model is then "llama3.1", for example
    address = "https://api.openai.com/v1"    # with key_variable="OPENAI_API_KEY" below, never the key itself

and leave all else as it is.
"""

import json
import re
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from math import hypot

import gamms

INSTRUCTIONS = (
    "You hunt the agents of team blue together with your mates of team red. Be on the node of one to catch it."
)


def main():
    """Play a game with the model, and the same game again without it."""
    with scripted_server() as address:
        result = play(address)
    table = result.table("llm")
    print(result.headline())
    print(
        f"{len(table['turn'])} decisions, {table['input_tokens'].sum()} tokens in, {table['output_tokens'].sum()} out"
    )
    print(f"cost: {table['cost'].sum():.4f}, fallbacks: {(table['outcome'] != 'answer').sum()}")
    print("the same without the server:", play(None) == result)


def play(address):
    """Play two pursuers against an evader that walks at random; without an address, by what was asked before."""
    pursuer = gamms.llm.Strategy(
        address,
        "scripted",
        INSTRUCTIONS,
        fallback=gamms.strategies.random_walk,
        calls="pursuit.jsonl",
        seconds=20,
        max_cost=0.10,
        price_in=0.15,
        price_out=0.60,
    )
    with gamms.create_context(seed=2, logger_config={"level": "WARNING"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6))
        for name, team, node in (("anna", "red", 0), ("bert", "red", 35), ("cleo", "blue", 14)):
            eyes = ctx.sensor.create_sensor(f"eyes of {name}", "agent_range", sensor_range=60)
            strategy = pursuer if team == "red" else gamms.strategies.random_walk
            ctx.agent.create_agent(name, start_node_id=node, team=team, sensors={"eyes": eyes}, strategy=strategy)
        ctx.game.add(gamms.rules.tag("red", "blue", then="eliminate"))
        ctx.game.add(gamms.rules.last_team())
        return ctx.game.run(max_turns=40)


# -- the scripted model -----------------------------------------------------------------------------------------

MOVE = re.compile(r"^(\d+): go to node \d+ at \((\S+), (\S+)\)", re.MULTILINE)
HERE = re.compile(r"at node \d+ at \((\S+), (\S+)\)")
BLUE = re.compile(r'of team "blue", node \d+ at \((\S+), (\S+)\)')


def answer(text):
    """Return the move that is nearest to an agent of team blue, or the last one where none is in sight."""
    here = [float(one) for one in HERE.search(text).groups()]
    moves = {0: here, **{int(number): (float(x), float(y)) for number, x, y in MOVE.findall(text)}}
    seen = [(float(x), float(y)) for x, y in BLUE.findall(text)]
    if not seen:
        return {"move": max(moves)}
    return {"move": min(moves, key=lambda move: min(hypot(moves[move][0] - x, moves[move][1] - y) for x, y in seen))}


class Handler(BaseHTTPRequestHandler):
    """Answers chat completions."""

    def do_POST(self):
        """Answer one request."""
        request = json.loads(self.rfile.read(int(self.headers["content-length"])))
        content = json.dumps(answer(request["messages"][-1]["content"]))
        usage = {"prompt_tokens": len(str(request["messages"])) // 4, "completion_tokens": len(content) // 4}
        body = json.dumps(
            {"choices": [{"message": {"role": "assistant", "content": content}}], "usage": usage}
        ).encode()
        self.send_response(200)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        """Print nothing for each request."""


@contextmanager
def scripted_server():
    """Serve the scripted model on a free port, and yield its address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/v1"
        finally:
            server.shutdown()
            thread.join()


if __name__ == "__main__":
    main()
