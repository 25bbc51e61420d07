"""The listings of the paper run as printed; the misprints that were mended are marked `# mended`.

Left out: loading a place.
"""

# ruff: noqa: Q000 - single quotes, as printed

import random
import types

import pytest

import gamms
from gamms import sensor

RED_STRATEGY = """
# red_strategy.py - Modular strategy implementation
import random                     # mended: the listing begins below its imports
from gamms import sensor          # mended
def strategy(state):
    sensor_data = state['sensor']
    for sensor_type, data in sensor_data.values():
        if sensor_type == sensor.SensorType.NEIGHBOR:
            choice = random.choice(range(len(data)))
            state['action'] = data[choice]
            break
def map_strategy(agent_config):
    strategies = {}
    for name in agent_config.keys():
        strategies[name] = strategy
    return strategies
"""


# fmt: off
def create_grid(graph, n):
  count = 0 # initialize the edge count to 0
  for i in range(n):
    for j in range(n):
      graph.add_node({'id': i * n + j, 'x': i, 'y': j})
  for i in range(n):
    for j in range(n):
      for di, dj in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        if 0 <= i + di < n and 0 <= j + dj < n:
          graph.add_edge({'id': count, 'source': i * n + j, 'target': (i + di) * n + j + dj, 'length': 1.0})
          count += 1
# fmt: on


@pytest.fixture
def red_strategy():
    module = types.ModuleType("red_strategy")
    exec(RED_STRATEGY, vars(module))
    return module


@pytest.fixture
def ctx():
    random.seed(1)
    ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
    yield ctx
    ctx.terminate()


# fmt: off
def test_a_camera_and_its_picture_take_one_line_each(ctx):
    create_grid(ctx.graph.graph, 5)
    ctx.sensor.create_sensor(
      'camera', type=gamms.sensor.SensorType.ARC, sensor_range=50, fov=2.5
    ) # Creates sensor named 'camera' that senses nodes and edges in range
    ctx.visual.set_sensor_visual(
      'camera', node_color=(0, 255, 0), edge_color=(0, 255, 0)
    ) # Highlights the nodes and edges sensed by the sensor
    camera = ctx.sensor.get_sensor('camera')
    assert (camera.range, camera.fov) == (50.0, 2.5)
    camera.sense(12)
    assert set(camera.data) == {'nodes', 'edges'}


def test_an_agent_is_one_line_and_so_is_its_look(ctx):
    create_grid(ctx.graph.graph, 2)
    # Single line to create an agent
    ctx.agent.create_agent("agent_0", start_node_id=0)
    # Visualize agent_0 in red color on the graph
    ctx.visual.set_agent_visual(name='agent_0',color=(255, 0, 0),size=10)
    assert ctx.agent.get_agent("agent_0").current_node_id == 0


def test_an_aerial_agent_is_one_line_too(ctx):
    create_grid(ctx.graph.graph, 2)
    ctx.agent.create_agent(
      'aerial', agent_type=gamms.agent.AgentType.AERIAL,
      start_node_id=0, speed=1.0
    ) # Creates an aerial agent that starts on the ground
    aerial = ctx.agent.get_agent('aerial')
    assert (aerial.type, aerial.position) == (gamms.agent.AgentType.AERIAL, (0.0, 0.0, 0.0))


def test_teams_are_given_their_strategies(ctx, red_strategy):
    create_grid(ctx.graph.graph, 3)
    sensor_config = {f'near_{i}': {'type': sensor.SensorType.NEIGHBOR} for i in range(4)}
    agent_config = {
        f'agent_{i}': {'meta': {'team': i % 2}, 'start_node': i, 'sensors': [f'near_{i}']} for i in range(4)
    }
    # Sensor system setup with validation
    for sensor_name, config in sensor_config.items():
        ctx.sensor.create_sensor(sensor_name, config['type'], **config)
    # Agent initialization with sensor registration
    for agent_name, config in agent_config.items():
        agent = ctx.agent.create_agent(agent_name, start_node_id=config['start_node'])  # mended: start_node=
        for sensor_name in config['sensors']:
            sensor_obj = ctx.sensor.get_sensor(sensor_name)
            agent.register_sensor(sensor_name, sensor_obj)
    # Team-based strategy assignment
    red_agents = {name: config for name, config in agent_config.items()
                  if config['meta']['team'] == 1}
    strategies = red_strategy.map_strategy(red_agents)
    for agent in ctx.agent.create_iter():
        agent_strategy = strategies.get(agent.name, None)
        agent.register_strategy(agent_strategy)
    assert [agent.strategy for agent in ctx.agent.create_iter()] == [None, red_strategy.strategy] * 2


def test_the_loop_runs_until_a_rule_ends_it(ctx, red_strategy):
    create_grid(ctx.graph.graph, 4)
    for i in range(3):
        ctx.sensor.create_sensor(f'near_{i}', gamms.sensor.SensorType.NEIGHBOR)
        ctx.agent.create_agent(f'agent_{i}', start_node_id=i, sensors=[f'near_{i}'])
        ctx.agent.get_agent(f'agent_{i}').register_strategy(red_strategy.strategy)
    visited = set()
    def rule1(ctx, turn_count):
        visited.update(agent.current_node_id for agent in ctx.agent.create_iter())
        if turn_count == 30:
            ctx.terminate()
    turn_count = 0
    while not ctx.is_terminated():
        turn_count += 1
        # Agent observation and decision phase
        for agent in ctx.agent.create_iter():
            state = agent.get_state()  # Collect sensor data Dict[str, Any]
            agent.strategy(state) # Updates state with 'action' entry
            agent.set_state() # Processes the updated 'action' entry
        rule1(ctx, turn_count) # Call the rule which is just a function
        ctx.visual.simulate() # Visualization and recording
    assert turn_count == 30
    assert len(visited) > 5


def test_tag_is_played_on_a_grid(ctx, red_strategy):
    red_team = ['red_0', 'red_1']; blue_team = ['blue_0', 'blue_1']  # noqa: E702 - as printed
    start = {'red_0': 0, 'red_1': 19, 'blue_0': 1, 'blue_1': 399}
    tags = []
    def tag_rule(ctx):
      for red in red_team:
        for blue in blue_team:
          ragent = ctx.agent.get_agent(red)
          bagent = ctx.agent.get_agent(blue)
          if ragent.current_node_id == bagent.current_node_id:
            tags.append((red, blue))
            for agent in (ragent, bagent): # Reset to starting positions
              agent.current_node_id = agent.prev_node_id = start[agent.name]
    create_grid(ctx.graph.graph, 20) # Generate a 20x20 grid
    graph_artist = ctx.visual.set_graph_visual(width=400, height=400)
    # ... create agents and set color according to team
    for name, node in start.items():
      ctx.sensor.create_sensor(f'near_{name}', sensor.SensorType.NEIGHBOR)
      ctx.agent.create_agent(name, start_node_id=node, sensors=[f'near_{name}'])
      ctx.visual.set_agent_visual(name, color=(255, 0, 0) if name in red_team else (0, 0, 255))
    turns = 0
    while not ctx.is_terminated(): # run loop until context is terminated
      for agent in ctx.agent.create_iter():
        red_strategy.strategy(agent.get_state())
        agent.set_state()
      tag_rule(ctx) # Check for taggings
      turns += 1
      if turns == 200:
        ctx.terminate()
    assert graph_artist.get_layer() == 10
    assert ('red_0', 'blue_0') in tags


def test_flags_are_drawn_by_an_artist(ctx):
    create_grid(ctx.graph.graph, 5)
    drawn = []
    def draw_flags(ctx, data): # Example artist for drawing flags
      red_id = data.get('red_id') # Node id for red flag
      blue_id = data.get('blue_id') # Node id for blue flag
      blue = ctx.graph.graph.get_node(blue_id)
      red = ctx.graph.graph.get_node(red_id)
      ctx.visual.render_rectangle(blue.x, blue.y, 10, 10, color=(0,255,0))
      ctx.visual.render_rectangle(red.x, red.y, 10, 10, color=(255,0,0))
      drawn.append((red_id, blue_id))
    # Create artist with layer above the graph
    capturable_artist = gamms.visual.Artist(ctx,drawer=draw_flags,layer=35)
    capturable_artist.data['red_id'] = 3  # mended: the closing quote of the key
    capturable_artist.data['blue_id'] = 21  # mended
    ctx.visual.add_artist('capturable_artist', capturable_artist)
    ctx.visual.simulate()
    ctx.visual.draw_commands()
    assert drawn == [(3, 21)]
# fmt: on
