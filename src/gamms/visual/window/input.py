"""Input by keys, mouse and window buttons, and the questions that a person answers."""

from collections.abc import Callable, Mapping
from itertools import product
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.backends.pygame_backend import load
from gamms.visual.camera import Point, WindowCamera, find_nearest_point
from gamms.visual.keys import find_actions

if TYPE_CHECKING:
    from pygame.event import Event

Answer = int | tuple[float, float, float]
_UP = (0, 0, 1)
_DOWN = (0, 0, -1)


class NodeChoice:
    """A choice of a node for an agent on the ground: 0 stays, 1 and up are its out-neighbors, in order.

    A number is typed digit by digit; it counts as soon as no longer one could be meant, or with Enter.

    Args:
        ctx: the context.
        name: of the agent.
        here: the node it is on.
    """

    def __init__(self, ctx: IContext, name: str, here: int) -> None:
        graph = ctx.graph.graph
        self.name = name
        self.answer = None
        self.typed = ""
        self.hint = ""
        others = [node for node in graph.get_neighbors(here) if node != here]
        self.options = dict(enumerate([here, *others]))
        self.places: FloatArray = np.asarray(graph.positions(list(self.options.values())), np.float64)

    answer: Answer | None

    @property
    def words(self) -> str:
        """The text of the question."""
        last = len(self.options) - 1
        typed = f" {self.typed}_" if self.typed else ""
        return f"{self.name}: click a node, or type its number (0 stays{f', 1 to {last}' if last else ''}){typed}"

    def type_digit(self, digit: int) -> None:
        """Add a digit; if no option begins with the number, clear it."""
        self.hint = ""
        for typed in (f"{self.typed}{digit}", str(digit)):
            meant = [number for number in self.options if str(number).startswith(typed)]
            if meant:
                self.typed = typed
                if len(meant) == 1:
                    self.confirm()
                return
        self.typed = ""
        self.refuse(str(digit))

    def refuse(self, key: str) -> None:
        """Show the possible keys, after an invalid one."""
        last = len(self.options) - 1
        self.hint = f"{key} is no choice: there is 0{f' to {last}' if last else ', to stay'}"

    def erase(self) -> None:
        """Forget the last digit."""
        self.typed = self.typed[:-1]

    def confirm(self) -> None:
        """Choose the typed number."""
        if self.typed:
            self.answer = self.options.get(int(self.typed))
            self.typed = ""

    def choose(self, number: int) -> None:
        """Choose the option of that number."""
        self.answer = self.options[number]


class FlightChoice:
    """A choice of a direction for a flying agent: toward a point, up, down, or none."""

    def __init__(self, name: str, here: tuple[float, float, float]) -> None:
        self.name = name
        self.here = here
        self.hint = ""
        self.answer: Answer | None = None

    @property
    def words(self) -> str:
        """The text of the question."""
        return f"{self.name}: click where to fly; up and down arrow climb and descend; 0 stays"

    def point_at(self, x: float, y: float) -> None:
        """Fly towards a world point."""
        self.answer = (x - self.here[0], y - self.here[1], 0)

    def climb(self, step: int) -> None:
        """Fly up (1) or down (-1)."""
        self.answer = _UP if step > 0 else _DOWN

    def type_digit(self, digit: int) -> None:
        """Answer "stay" for the digit 0; other digits are invalid."""
        if digit == 0:
            self.answer = (0, 0, 0)
        else:
            self.refuse(str(digit))

    def refuse(self, key: str) -> None:
        """Show the possible keys, after an invalid one."""
        self.hint = f"{key} is no choice: there are the arrows up and down, and 0"


Question = NodeChoice | FlightChoice


def make_question(ctx: IContext, name: str, state: dict[str, Any]) -> Question:
    """Return the question about an agent.

    Raises:
        UnknownName (KeyError): the agent does not exist, or its node does not.
    """
    agent = ctx.agent.get_agent(name)
    if agent.type == AgentType.AERIAL:
        return FlightChoice(name, state["curr_pos"])
    return NodeChoice(ctx, name, state["curr_pos"])


# of a notch of the wheel, and a tap on a key, which is mostly held
_ZOOM = 1.25
_TAP = 1.05
_KEY_ZOOM = 4.0  # per second
_CLICK_PX = 4.0  # a press that moves less is a click
_CLOSEST = 2.0  # world units: half the width of the closest look that the wheel gives, where the map is not smaller
_ACROSS = 60.0  # how many times smaller than the map

_CHARACTERS = range(33, 127)  # keys named by their character

_MOVES = {  # action of keys that are held -> across, up, out
    "move up": (0, 1, 0),
    "move down": (0, -1, 0),
    "move left": (-1, 0, 0),
    "move right": (1, 0, 0),
    "zoom in": (0, 0, -1),
    "zoom out": (0, 0, 1),
}
_NAMES = {  # key -> the names of its keys in pygame, if they are not its name in capitals
    " ": ("SPACE",),
    ",": ("COMMA",),
    ".": ("PERIOD", "KP_PERIOD"),
    "[": ("LEFTBRACKET",),
    "]": ("RIGHTBRACKET",),
    "+": ("PLUS", "KP_PLUS"),
    "=": ("EQUALS",),
    "-": ("MINUS", "KP_MINUS"),
    "0": ("0", "KP0"),
    "?": ("QUESTION", "SLASH"),  # ? is shift and / on many keyboards
    **{f"arrow{way}": (way.upper(),) for way in ("up", "down", "left", "right")},
}


def _bind_keys(pygame: ModuleType) -> dict[int, str]:
    """Return the code of a key in pygame -> its action."""
    bound = {}
    for key, action in find_actions("window").items():
        for name in _NAMES.get(key, (key if len(key) == 1 else key.upper(),)):
            bound[getattr(pygame, f"K_{name}")] = action
    return bound


class Handlers(NamedTuple):
    """The functions that keys, mouse and window events call."""

    actions: Mapping[str, Callable[[], None]]  # by the names of actions in `visual.keys`
    click: Callable[[Point], None]  # on a point of the screen
    take: Callable[[Point], bool]  # press on a point of the screen that belongs to the timeline
    drag: Callable[[Point], None]  # move of the pressed pointer
    release: Callable[[], None]  # end of the press
    quit: Callable[[], None]
    resize: Callable[[int, int], None]  # to a width and height, pixels
    question: Callable[[], Question | None]  # that the person is asked
    map_extent: Callable[[], float | None]  # world units
    is_over: Callable[[], bool]


class Input:
    """Converts input events to actions of the window.

    Attributes:
        pointer: where the mouse is, in pixels; None while it is elsewhere.
        has_moved_camera: whether the person has moved or zoomed; the engine sets it back.
    """

    def __init__(self, camera: WindowCamera, handlers: Handlers) -> None:
        self._camera = camera
        self._do = handlers
        self.pointer: Point | None = None
        self._held: set[int] = set()
        self._drag: Point | None = None
        self._dragged_px = 0.0
        self._has_taken = False  # the timeline
        self.has_moved_camera = False  # since everything was seen
        pygame = load()
        self._events = self._make_event_actions(pygame)
        actions: dict[str, Callable[[], None]] = {
            **handlers.actions,
            "zoom in": lambda: self._zoom(1 / _TAP),
            "zoom out": lambda: self._zoom(_TAP),
        }
        bound = _bind_keys(pygame)
        self._ways = {code: _MOVES[action] for code, action in bound.items() if action in _MOVES}
        self._keys = {code: actions[action] for code, action in bound.items() if action in actions}
        self._digits = {
            getattr(pygame, f"K_{prefix}{digit}"): digit for prefix, digit in product(("", "KP"), range(10))
        }

    def _make_event_actions(self, pygame: ModuleType) -> dict[int, Callable[[Any], None]]:
        return {
            pygame.QUIT: self._quit,
            pygame.KEYDOWN: self._press,
            pygame.KEYUP: self._release,
            pygame.MOUSEBUTTONDOWN: self._handle_button,
            pygame.MOUSEBUTTONUP: self._release_button,
            pygame.MOUSEMOTION: self._move,
            pygame.MOUSEWHEEL: self._handle_wheel,
            pygame.WINDOWLEAVE: self._leave,
            pygame.WINDOWFOCUSLOST: self._lose_focus,
            pygame.VIDEORESIZE: self._resize,
        }

    def handle(self, events: list[Any]) -> None:
        """Handle events in order; stop after the window was closed."""
        for event in events:
            if self._do.is_over():
                return
            action = self._events.get(event.type)
            if action is not None:
                action(event)

    def glide(self, seconds: float) -> None:
        """Move the camera by the keys that are held: in a second, by a quarter of the width or four times nearer."""
        view = self._camera
        across, up, out = (sum(self._ways[key][axis] for key in self._held) for axis in range(3))
        if out:
            self._zoom(_KEY_ZOOM ** (out * seconds))
        if across or up:
            self.has_moved_camera = True
            view.camera_x += across * view.camera_size / 2 * seconds
            view.camera_y += up * view.camera_size / 2 * seconds

    # -- the window ------------------------------------------------------------------------------------------

    def _quit(self, event: "Event") -> None:  # noqa: ARG002
        self._do.quit()

    def _resize(self, event: "Event") -> None:
        self._do.resize(event.w, event.h)

    def _leave(self, event: "Event") -> None:  # noqa: ARG002
        self.pointer = None
        self._drag = None
        self._release_taken()

    def _release_taken(self) -> None:
        if self._has_taken:
            self._has_taken = False
            self._do.release()

    def _lose_focus(self, event: "Event") -> None:
        """Release all keys and buttons: another window gets the events of their release."""
        self._leave(event)
        self._held.clear()

    # -- keys ------------------------------------------------------------------------------------------------

    def _press(self, event: "Event") -> None:
        if self._answer_by_key(event.key):
            return
        if event.key in self._ways:
            self._held.add(event.key)
        if event.key in self._keys:
            self._keys[event.key]()
        elif (asked := self._do.question()) is not None and event.key not in self._ways and event.key in _CHARACTERS:
            asked.refuse(chr(event.key).upper())

    def _release(self, event: "Event") -> None:
        self._held.discard(event.key)

    def _answer_by_key(self, key: int) -> bool:
        pygame = load()
        asked = self._do.question()
        if asked is None:
            return False
        if key in self._digits:
            asked.type_digit(self._digits[key])
        elif isinstance(asked, FlightChoice) and key in (pygame.K_UP, pygame.K_DOWN):
            asked.climb(1 if key == pygame.K_UP else -1)
        elif isinstance(asked, NodeChoice) and key in (pygame.K_RETURN, pygame.K_KP_ENTER):
            asked.confirm()
        elif isinstance(asked, NodeChoice) and key == pygame.K_BACKSPACE:
            asked.erase()
        else:
            return False
        return True

    # -- mouse -----------------------------------------------------------------------------------------------

    def _handle_button(self, event: "Event") -> None:
        if event.button in (1, 2, 3):
            self.pointer = event.pos
            self._has_taken = event.button == 1 and self._do.take(event.pos)
            if self._has_taken or (event.button == 1 and self._answer_by_click(*event.pos)):
                return
            self._drag = event.pos
            self._dragged_px = 0.0

    def _answer_by_click(self, x: float, y: float) -> bool:
        asked = self._do.question()
        view = self._camera
        if isinstance(asked, FlightChoice):
            asked.point_at(*view.screen_to_world(x, y))
            return True
        if isinstance(asked, NodeChoice):
            option = find_nearest_point(view.camera().to_screen(asked.places), x, y)
            if option is not None:
                asked.choose(option)
                return True
        return False

    def _move(self, event: "Event") -> None:
        self.pointer = event.pos
        if self._has_taken:
            self._do.drag(event.pos)
        if self._drag is None:
            return
        right = event.pos[0] - self._drag[0]
        down = event.pos[1] - self._drag[1]
        self._dragged_px += abs(right) + abs(down)
        if self._dragged_px >= _CLICK_PX:
            self.has_moved_camera = True
            self._camera.move_by(right, down)
            self._drag = event.pos

    def _release_button(self, event: "Event") -> None:
        is_click = self._drag is not None and self._dragged_px < _CLICK_PX
        self._drag = None
        self._release_taken()
        if is_click and event.button == 1:
            self._do.click(event.pos)

    def _handle_wheel(self, event: "Event") -> None:
        notches = getattr(event, "precise_y", 0.0) or event.y
        self._zoom(_ZOOM**-notches)

    def _zoom(self, factor: float) -> None:
        extent = self._do.map_extent() or _CLOSEST * _ACROSS
        self.has_moved_camera = True
        self._camera.zoom(factor, self.pointer, min(_CLOSEST, extent / _ACROSS))
