"""A server of language models on this machine, which answers as a test says."""

import json
import socket
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import gamms

KEY = "sk-loopback-0123456789"


class Refusal(Exception):
    """A response that is no success: a status, a body, and headers."""

    def __init__(self, status, body=b"", **headers):
        super().__init__(status)
        self.status, self.body, self.headers = status, body, headers


class LoopbackServer:
    """Answers requests by `script(request)`, which returns the answer of the model, bytes, or a whole response.

    Attributes:
        requests: all that came, as plain values.
        headers: of each.
        most_at_once: how many were under way at the same time.
    """

    def __init__(self):
        self.requests, self.headers, self.script = [], [], lambda request: {"move": 0}
        self.most_at_once, self._now, self._lock = 0, 0, threading.Lock()
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                with outer._lock:
                    outer._now += 1
                    outer.most_at_once = max(outer.most_at_once, outer._now)
                try:
                    request = json.loads(self.rfile.read(int(self.headers["content-length"])))
                    outer.requests.append(request)
                    outer.headers.append({name.lower(): value for name, value in self.headers.items()})
                    outer.respond(self, request)
                except OSError:  # the client has gone
                    pass
                finally:
                    with outer._lock:
                        outer._now -= 1

            def log_message(self, *_):
                pass

        self._http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._http.daemon_threads, self._http.block_on_close = True, False
        self.url = f"http://127.0.0.1:{self._http.server_port}/v1"
        self._thread = threading.Thread(target=self._http.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        self._thread.start()

    def respond(self, handler, request):
        status, headers = 200, {}
        try:
            answer = self.script(request)
        except Refusal as refusal:
            status, answer, headers = refusal.status, refusal.body, refusal.headers
        if callable(answer):  # writes to the socket itself
            answer(handler.wfile)
            return
        body = answer if isinstance(answer, bytes) else json.dumps(completion(answer)).encode()
        handler.send_response(status)
        for name, value in {"content-length": str(len(body)), **headers}.items():
            handler.send_header(name.replace("_", "-"), value)
        handler.end_headers()
        handler.wfile.write(body)

    def close(self):
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()


def completion(answer, tokens=(100, 10)):
    """Return the response to a chat completion; an answer that is no text is written as JSON."""
    if isinstance(answer, dict) and "choices" in answer:
        return answer
    text = answer if isinstance(answer, str) else json.dumps(answer)
    usage = {"prompt_tokens": tokens[0], "completion_tokens": tokens[1]}
    return {"choices": [{"index": 0, "message": {"role": "assistant", "content": text}}], "usage": usage}


def text_of(request):
    """Return what a request says of the state."""
    return request["messages"][1]["content"]


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def new_game(strategy, names=("anna",), seed=1, **options):
    """Return a road of ten nodes, with agents of the team red at its beginning."""
    ctx = gamms.create_context(seed=seed, logger_config={"level": "ERROR"}, **options)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
    for name in names:
        ctx.agent.create_agent(name, start_node_id=0, team="red", strategy=strategy)
    return ctx


def outcomes(result):
    """Return the outcome of each decision."""
    return [event["outcome"] for event in result.events if event["kind"] == "llm"]


def wait_until(is_so):
    end = time.monotonic() + 60
    while not is_so() and time.monotonic() < end:
        time.sleep(0.005)
    assert is_so()
