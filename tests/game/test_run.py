"""`ctx.game.run(record=…)` records the turns that it plays."""

import pytest

import gamms


@pytest.fixture
def town():
    with gamms.create_context(seed=4) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.random_walk)
        yield ctx


def test_a_run_that_fails_leaves_a_whole_recording(town, tmp_path):
    def err(ctx):
        if ctx.game.turn == 3:
            raise RuntimeError("a rule of a user's own")

    town.game.add(err)
    with pytest.raises(RuntimeError, match="a rule of a user's own"):
        town.game.run(max_turns=5, record=tmp_path / "game.ggr")
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        assert recording.turns in (2, 3)
        assert recording.is_complete


def test_a_run_records_sensor_data_if_asked(town, tmp_path):
    ben = {"eyes": gamms.sensor.agent_range(range_m=20)}
    town.agent.create_agent("ben", start_node_id=3, sensors=ben, strategy=gamms.strategies.random_walk)
    town.game.run(max_turns=5, record=tmp_path / "game.ggr", sensed=True)
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        assert list(recording.observation(3, "ben")["sensor"]) == ["eyes"]


def test_sensor_reports_without_a_recording_are_refused(town):
    with pytest.raises(ValueError, match="give record=, too"):
        town.game.run(max_turns=5, sensed=True)
    assert town.game.turn == 0


def test_a_strategy_that_reads_a_misspelt_sensor_is_told_the_names_of_its_sensors(town):
    eyes = {"eyes": gamms.sensor.agent_range(range_m=20)}
    town.agent.create_agent("ben", start_node_id=3, sensors=eyes, strategy=lambda state: state["sensor"]["eye"])
    with pytest.raises(KeyError) as caught:
        town.game.step()
    assert "Its sensors are: 'eyes'." in caught.value.__notes__[-1]
