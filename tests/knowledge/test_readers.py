"""Readers of knowledge agree: beliefs, cuts and reports."""

import io

from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import belief, recorder

ERRORS = st.sampled_from([{}, {"detection": 0.6}, {"team": "blue"}, {"delay_turns": 1}, {"position_noise_m": 9.0}])


@settings(max_examples=10)
@given(ERRORS, st.sampled_from(["agent_range", "occluded_agent", "agent_arc"]), st.integers(0, 999))
def test_a_belief_has_seen_the_agents_of_its_team_s_cut_unless_the_sensor_errs(errors, kind, seed):
    seen = {}

    def watch(state):
        last = belief.observe(ctx, state).last_seen
        seen[state["turn"]] = {name: one.node for name, one in last.items() if one.turn == state["turn"]}
        state["action"] = state["draw"].choice(state["legal"])

    whole = io.BytesIO()
    cut = io.BytesIO()
    with gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 4))
        eyes = ctx.sensor.create_sensor("eyes", kind, range_m=21.0, **errors)
        ctx.agent.create_agent("ann", start_node_id=7, team="red", sensors={"eyes": eyes}, strategy=watch)
        for name, node in (("bob", 0), ("bea", 12), ("ben", 19)):
            ctx.agent.create_agent(name, start_node_id=node, team="blue", strategy=gamms.strategies.random_walk)
        ctx.record.start(whole)
        assert ctx.game.run(4).errors == []
        ctx.record.stop()
    with recorder.open(io.BytesIO(whole.getvalue())) as recording:
        recording.cut(cut, "red")
    errs = "delay_turns" in errors or "position_noise_m" in errors
    with recorder.open(io.BytesIO(cut.getvalue())) as recording:
        for turn in range(4):
            agents = recording[turn].agents
            shown = dict(zip(agents["name"].tolist(), agents["node"].tolist(), strict=True))
            del shown["ann"]
            assert seen[turn] == ({} if errs else shown)
