"""Strategies that need no map: staying, and walking at random."""

from math import cos, pi, sin

from gamms.strategies.knowledge import State, drawn_below, drawn_fraction, is_flying, legal_nodes


def stay(state: State) -> None:
    """Stay where it is; it decides always."""
    state["action"] = (0.0, 0.0, 0.0) if is_flying(state) else state["curr_pos"]


def random_walk(state: State) -> None:
    """Go to one of the legal nodes, its own included, each as likely; a flyer goes in any horizontal direction.

    Without `state["legal"]`, the legal nodes are those that a NEIGHBOR sensor shows.

    Raises:
        MissingKey: there is neither `state["draw"]` nor `state["rng"]`, or nothing that says where it may go.
    """
    if is_flying(state):
        angle = 2.0 * pi * drawn_fraction(state, "random_walk")
        state["action"] = (cos(angle), sin(angle), 0.0)
    else:
        legal = legal_nodes(state, "random_walk")
        state["action"] = legal[drawn_below(state, len(legal), "random_walk")]
