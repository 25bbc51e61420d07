"""A resumed game is typed to the end."""

import gamms


def stay(state: gamms.typing.State) -> None:
    state["action"] = state["curr_pos"]


def scores(ctx: gamms.Context) -> dict[str, float]:
    return {str(team): score for team, score in ctx.game.scores.items()}


with gamms.recorder.open("game.ggr") as recording:
    with recording.resume(20, {"red": stay}, seed=3, vis_engine=gamms.visual.Engine.NO_VIS) as ctx:
        ctx.agent.create_iter()
        ctx.game.run(max_turns=5)
        ctx.gme.run()  # type: ignore[attr-defined]
        ctx.agents  # type: ignore[attr-defined]
        ctx.seed.real + ctx.seed.name  # type: ignore[attr-defined]
    with recording.resume(20, ctx=gamms.create_context(seed=1)) as own:
        scores(own)
        own.game.end("over")
        own.game.edn("over")  # type: ignore[attr-defined]
        own.agent.create_itr()  # type: ignore[attr-defined]
    recording.resume(20, {"red": 5})  # type: ignore[dict-item]
    recording.resume(20, ctx=5)  # type: ignore[call-overload]
    recording.resume(20, vis_engine=gamms.visual.Engine.NO_VIS, ctx=own)  # type: ignore[call-overload]
