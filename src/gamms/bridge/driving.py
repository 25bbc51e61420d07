"""Agents that are played by robots: send moves as waypoints, and hold each turn until the robots have arrived."""

from collections.abc import Sequence
from functools import partial
from math import inf
from typing import Any, Self

import numpy as np

from gamms.arguments import as_name, as_range, explain_call_errors
from gamms.bridge.feeds import Feed, Message, Send, Source, as_feed
from gamms.bridge.matching import XY, FixChecks, PositionTracker, RoadRoute, RoutePoint, find_route, find_route_along
from gamms.clocks import Clock, WallClock
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.game.settings import RuleSpec, declared
from gamms.text import shown
from gamms.typing import AgentType, IAgent
from gamms.typing.game import Move
from gamms.visual.constants import Layer
from gamms.visual.legend import SIGN, LegendRow, LegendRows

ROBOTS = "robots"  # in `ctx.game.data`: agent -> measured position and status of its robot
_TICK_S = 0.05
_REPEAT_S = 1.0  # seconds after which waypoints are sent again, in case the robot has lost them
_MOST_POINTS = (
    500  # points in one message, so that it fits into a line; the next message continues from the robot's position
)
_DECIMALS = 3
_DEGREES = 8
_MARK_PX = 9.0
_LINE_PX = 2
_WAY_PX = 4


@explain_call_errors
def drive(
    agent: IAgent | str,
    feed: Feed | Source,
    *,
    send: Send | None = None,
    limit_s: float = 60.0,
    arrive_m: float = 3.0,
    checks: FixChecks | None = None,
    clock: Clock | None = None,
) -> "Drive":
    """Make a rule by which a robot plays an agent: add it with `ctx.game.add(drive("anna", feed))`.

    When all agents have decided, the rule sends the agent's move to the robot as waypoints along the road. The turn
    waits for all robots at once until each has arrived; meanwhile the picture is updated. If a robot has not arrived
    within the limit, its move is refused: the agent stays, or is put on the last node that the robot has passed, and
    an event `robot_late` is emitted. The robot's route begins at the robot, even if its agent is elsewhere.

    `ctx.game.data["robots"]` holds for each agent the measured position of its robot, the age of that fix, and the
    matched position on the roads; see docs/bridge.md.

    Args:
        agent: an agent on the ground, or its name.
        feed: the fixes of the robot: a `Feed`, a function that returns new fixes, or an iterable, which is read in a
            thread; a fix is a mapping with `x` and `y`, or `lat` and `lon`, and `t`.
        send: called with each message for the robot; None: the `send` of the feed, if it has one.
        limit_s: the longest wait of a turn in seconds.
        arrive_m: the distance from the end of its route in meters at which a robot has arrived.
        checks: the conditions for fixes to count.
        clock: the clock for the age of fixes and the wait of turns; None: that of the feed, or of the machine.

    Raises:
        BadType, BadValue: an argument has a wrong type or value.
        UnknownName (KeyError): the agent does not exist, when the rule is added to a game.
    """
    name = as_name(getattr(agent, "name", agent), "an agent")
    own = as_feed(feed, clock)
    if send is not None and not callable(send):
        raise BadType(f"send must be a function that takes a message, not {shown(send)}.")
    limits = as_range(limit_s, "limit_s"), as_range(arrive_m, "arrive_m")
    if limits[0] == inf:
        raise BadValue("limit_s must be finite: a robot that never arrives would hold the game forever.")
    if checks is not None and not isinstance(checks, FixChecks):
        raise BadType(f"checks must be gamms.bridge.FixChecks(…), not {shown(checks)}.")
    return Drive(name, own, send or own.send, limits, (checks or FixChecks()).checked())


class Drive:
    """The rule that `drive` makes.

    Attributes:
        agent: the name of the agent.
        feed: the fixes of its robot.
        limit_s: the longest wait of a turn for the robot in seconds.
        is_late: whether the robot has been late in this turn.
        rank: runs before the other rules after a turn.
    """

    rank = -1
    __name__ = "drive"

    def __init__(
        self, agent: str, feed: Feed, send: Send | None, limits: tuple[float, float], checks: FixChecks
    ) -> None:
        self.agent = agent
        self.feed = feed
        self.limit_s, self._arrive_m = limits
        self._send = send
        self._checks = checks
        self._tracker: PositionTracker | None = None  # None: the rule belongs to a fork, in which no robot drives
        self._route: RoadRoute | None = None
        self._on: RoutePoint | None = None  # position of the robot on the route
        self._turn = -1  # the turn in which the robot last got waypoints
        self._way = 0  # number of the route
        self._told_at = 0.0  # time when the route was sent
        self.is_late = False  # whether the robot has been late in this turn: teams that move in turn have several waits
        self._put_on: int | None = None  # node on which the agent of a late robot is to be put
        self._has_warned = False  # about degrees on a map without a CRS
        self.key = ("robot", agent)
        declared(self, RuleSpec())
        self.drawer = partial(self._draw)
        legend = LegendRows("", (LegendRow(SIGN, "robot, as measured", sign="plus"),))
        self.drawer.__dict__.update(artist=f"robot {agent}", layer=Layer.FLAGS, legend=legend)

    def __repr__(self) -> str:
        return f"drive({self.agent!r}, …)"

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return the rule for a fork of the game, which controls no robot."""
        return type(self)(self.agent, Feed(clock=self.feed.clock), None, (self.limit_s, self._arrive_m), self._checks)

    @property
    def counts(self) -> dict[str, int]:
        """Counts of fixes: received, taken, and rejected by reason."""
        own = {} if self._tracker is None else self._tracker.counts
        return {**self.feed.counts, **own}

    # -- hooks that the game calls ------------------------------------------------------------------------------

    def prepare(self, ctx: Context) -> None:
        """Check the agent and the clocks of other robots, and start to track the robot."""
        one = ctx.agent.get_agent(self.agent)
        if one.type == AgentType.AERIAL:
            raise BadType(f"Agent {self.agent!r} flies, and gamms.bridge.drive is for agents on the ground.")
        for other in list_drives(ctx):
            clocks = self.feed.clock, other.feed.clock
            if clocks[0] is not clocks[1] and not all(isinstance(clock, WallClock) for clock in clocks):
                raise BadValue(
                    f"The robots of {other.agent!r} and {self.agent!r} have different clocks, and wait for each other: "
                    "give both the same, with clock=…."
                )

        def to_xy(lat: float, lon: float) -> XY:
            if ctx.graph.crs is None and not self._has_warned:
                self._has_warned = True
                ctx.logger.warning(
                    f"The robot of {self.agent!r} sends latitude and longitude, and the map has no CRS: set "
                    "ctx.graph.graph.crs, such as to 'EPSG:32635', or send x and y."
                )
            x, y = ctx.graph.graph.from_latlon(lat=lat, lon=lon)
            return float(x), float(y)

        self._tracker = PositionTracker(self._checks, to_xy)

    def check(self, ctx: Context) -> None:
        """Hold the turn for all robots of the game; only the first of their rules does so."""
        phase = next(one.phase for one in ctx.game.rules if one.rule is self)
        if phase != "after":
            raise BadValue(
                f"{self!r} was added with phase={phase!r}, and it puts the agent of a late robot where that is after a "
                "turn: add it with ctx.game.add(rule), without phase=."
            )
        drives = [one for one in list_drives(ctx) if one._tracker is not None]
        if drives and drives[0] is self:
            wait_for_robots(ctx, drives)

    def __call__(self, ctx: Context) -> None:
        """Put the agent of a late robot on the last node that the robot has passed."""
        node = self._put_on
        self._put_on = None
        if node is not None and self.agent in ctx.agent.agents:  # a rule may have deleted it meanwhile
            ctx.agent.get_agent(self.agent).current_node_id = node

    # -- a turn -------------------------------------------------------------------------------------------------

    def begin(self, ctx: Context, move: Move | None) -> bool:
        """Send the robot its waypoints; return whether the turn has to wait for it."""
        is_new = self._turn != ctx.game.turn
        self._turn = ctx.game.turn
        self.is_late = self.is_late and not is_new
        is_staying = move is not None and len(move.path) == 1 and not move.legs
        if move is None or (is_staying and not is_new):
            return False  # the agent is out of the game, or its team has moved before
        self.read()
        columns = ctx.graph.columns()
        self._route = self._find_route_from_robot(ctx, find_route(ctx.graph.graph, columns, move))
        self._on = None
        self.read()
        if self.has_arrived():
            return False
        self._way += 1
        self._send_waypoints(ctx)
        return True

    def remind(self, ctx: Context) -> None:
        """Send the waypoints again if the last message is old."""
        if self.feed.clock.now() - self._told_at >= _REPEAT_S:
            self._send_waypoints(ctx)

    def read(self) -> None:
        """Take the received fixes, and match the robot to its route."""
        tracker = self._tracker
        route = self._route
        if tracker is None:
            return
        before = tracker.last
        tracker.take(self.feed.take())
        place = tracker.last
        if route is None or place is None or (place is before and self._on is not None):
            return
        low = 0.0
        high = inf
        if self._on is not None and before is not None:
            slack = self._checks.within_m
            low = self._on.along - slack
            high = self._on.along + slack + self._checks.max_speed * (place.at - before.at)
        self._on = route.find_nearest(place.xy, low, high)

    def note(self, ctx: Context, waited_s: float) -> None:
        """Write the robot's position and status to `ctx.game.data`, for rules, pictures and recordings."""
        tracker = self._tracker
        if tracker is None:
            return
        now = self.feed.clock.now()
        place = tracker.last
        noted: dict[str, Any] = {"status": self._describe_status(now), "waited_s": round(waited_s, _DECIMALS)}
        if place is not None:
            noted |= {"x": round(place.xy[0], _DECIMALS), "y": round(place.xy[1], _DECIMALS)}
            noted["age_s"] = round(tracker.compute_age(now), _DECIMALS)
            noted |= {} if place.heading is None else {"heading": round(place.heading, _DECIMALS)}
            on = self._find_matched_xy()
            near = ctx.graph.routes.nearest_edge(*on, self._checks.within_m)
            if near is not None:
                noted |= {"edge": near.edge_id, "offset_m": round(near.offset, _DECIMALS)}
                noted["off_m"] = round(float(np.hypot(on[0] - place.xy[0], on[1] - place.xy[1])) + near.distance, 3)
        ctx.game.data.setdefault(ROBOTS, {})[self.agent] = noted

    def give_up(self, ctx: Context, waited_s: float) -> None:
        """Refuse the move of a late robot."""
        route = self._route
        on = self._on
        passed = None
        if route is not None and on is not None and on.off <= self._checks.within_m:
            passed = route.find_last_node(on.along + self._arrive_m)
        status = self._describe_status(self.feed.clock.now())
        here = ctx.agent.get_agent(self.agent).current_node_id
        ctx.game.refuse(self.agent, f"its robot has not arrived after {waited_s:g} s ({status})")
        self._put_on = passed if passed != here else None
        node = here if passed is None else passed
        if not self.is_late:
            ctx.game.emit("robot_late", agent=self.agent, node=node, status=status, waited_s=round(waited_s, _DECIMALS))
        self.is_late = True

    # -- parts --------------------------------------------------------------------------------------------------

    def has_arrived(self) -> bool:
        """Return whether the robot is at the end of its route."""
        route = self._route
        on = self._on
        tracker = self._tracker
        if route is None or on is None or tracker is None or self._is_stale(self.feed.clock.now()):
            return False
        bound = self._checks.within_m if route.length else self._arrive_m
        return on.off <= bound and on.along >= route.length - self._arrive_m

    def _is_stale(self, now: float) -> bool:
        return self._tracker is None or self._tracker.compute_age(now) > self._checks.max_age_s

    def _describe_status(self, now: float) -> str:
        if self._tracker is None or self._tracker.last is None:
            return "off map" if self._tracker is not None and self._tracker.counts["off_map"] else "no fix"
        if self._is_stale(now):
            return "stale"
        return "off road" if self._on is None or self._on.off > self._checks.within_m else "ok"

    def _find_matched_xy(self) -> XY:
        """Return the robot's matched position on its route, or its measured position if that is far from the route."""
        place = self._tracker.last if self._tracker is not None else None
        if self._route is not None and self._on is not None and self._on.off <= self._checks.within_m:
            return self._route.find_point(self._on.along)
        return (0.0, 0.0) if place is None else place.xy

    def _find_route_from_robot(self, ctx: Context, planned: RoadRoute) -> RoadRoute:
        """Return the planned route; or, if the robot is far from it, a route to the same end from the robot's edge."""
        place = None if self._tracker is None else self._tracker.last
        if place is None or planned.find_nearest(place.xy).off <= self._checks.within_m:
            return planned
        near = ctx.graph.routes.nearest_edge(*place.xy, self._checks.within_m)
        if near is None:
            return planned
        graph = ctx.graph.graph
        end = planned.nodes[-1]
        edge = graph.get_edge(near.edge_id)
        ways = [(edge.length - near.offset + graph.distance(edge.target, end), edge.source, edge.target)]
        if edge.source in graph.neighborhoods[edge.target]:
            ways.append((near.offset + graph.distance(edge.source, end), edge.target, edge.source))
        far, behind, ahead = min(ways)
        if far == inf:
            return planned
        return find_route_along(ctx.graph.columns(), (behind, *graph.shortest_path(ahead, end)))

    def _send_waypoints(self, ctx: Context) -> None:
        """Send the robot the rest of its route as waypoints."""
        self._told_at = self.feed.clock.now()
        if self._send is None or self._route is None:
            return
        along = self._on.along if self._on is not None and self._on.off <= self._checks.within_m else 0.0
        points = self._route.get_rest(along)[:_MOST_POINTS]
        message: Message = {"gamms": 1, "type": "waypoints", "agent": self.agent, "turn": ctx.game.turn}
        message["way"] = self._way
        message["points"] = points.round(_DECIMALS).tolist()
        if ctx.graph.crs is not None:
            lat, lon = ctx.graph.graph.to_latlon(points[:, 0], points[:, 1])
            message["latlon"] = np.column_stack([lat, lon]).round(_DEGREES).tolist()
        self._send(message)

    def _draw(self, ctx: Context, data: dict[str, Any]) -> None:  # noqa: ARG002 - as drawers are called
        """Draw the measured position as a plus, a line to it from the agent, and the rest of the route."""
        place = None if self._tracker is None else self._tracker.last
        if place is None or self.agent not in ctx.agent.agents:
            return
        visual = ctx.visual
        color = visual.drawing.group_colors().get(str(ctx.agent.get_agent(self.agent).team), (90, 90, 90))
        rest = self._route.get_rest(self._on.along) if self._route is not None and self._on is not None else ()
        if len(rest) > 1:
            visual.render_linestring([(x, y) for x, y in rest], color, _WAY_PX)
        visual.render_linestring([visual.drawing.position_of(self.agent), place.xy], color, _LINE_PX)
        for line in ([(-_MARK_PX, 0.0), (_MARK_PX, 0.0)], [(0.0, -_MARK_PX), (0.0, _MARK_PX)]):
            visual.drawing.render_symbols([place.xy], line, color, _LINE_PX)


def list_drives(ctx: Context) -> list[Drive]:
    """Return the `Drive` rules of a game, in their order."""
    return [one.rule for one in ctx.game.rules if isinstance(one.rule, Drive)]


def wait_for_robots(ctx: Context, drives: Sequence[Drive]) -> None:
    """Send robots their waypoints, and wait until each has arrived or is late."""
    clock = drives[0].feed.clock
    moves = ctx.game.moves
    began = clock.now()
    waited = 0.0
    going = [one for one in drives if one.begin(ctx, moves.get(one.agent))]
    while True:
        for one in going:
            one.read()
        arrived = [one for one in going if one.has_arrived()]
        late = [one for one in going if one not in arrived and (one.is_late or waited >= one.limit_s)]
        for one in late:
            one.give_up(ctx, waited)
        going = [one for one in going if one not in arrived and one not in late]
        if not going:
            break
        for one in going:
            one.remind(ctx)
        ctx.visual.update()
        if getattr(ctx.visual, "is_closing", False):  # a person has closed the window
            for one in going:
                one.give_up(ctx, waited)
            break
        step = min(_TICK_S, min(one.limit_s for one in going) - waited)
        before = clock.now()
        clock.sleep(step)
        now = clock.now()
        waited = now - began if now > before else waited + step  # a step may be too short for the digits of a clock
    for one in drives:
        one.read()
        one.note(ctx, waited)
