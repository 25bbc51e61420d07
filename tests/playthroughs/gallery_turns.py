"""Which turns of the gallery's games are stored as text, and which agents are shown."""

from pathlib import Path
from typing import NamedTuple

GOLDEN = Path(__file__).parent / "golden"


class Turns(NamedTuple):
    """The first turns of a game, and later ones in which something happens.

    Attributes:
        later: the number of turns before the later ones.
        agents: the names of the agents that are shown.
    """

    later: int
    agents: str

    first = 2  # how many turns are shown at first
    more = 1  # and how many later

    @property
    def names(self):
        """The names in a list."""
        return self.agents.split()


GAMES = {  # without the language model, which needs a server
    "bomb_disposal": Turns(6, "experts_1 experts_2 thugs_0"),
    "capture_the_flag": Turns(40, "blue_0 blue_1 red_0"),
    "checkpoints": Turns(13, "evader_0 officer_east police_0 traffic_3"),
    "collecting": Turns(20, "blue_0 red_0 red_1"),
    "competition": Turns(34, "attackers_1 attackers_2 defenders_0"),
    "convoy": Turns(37, "escorts_3 raiders_5 trucks_2"),
    "cops_and_robber": Turns(30, "cops_0 cops_1 robber"),
    "epidemic": Turns(3, "healthy_46 infected_0 vaccinators_0"),
    "firefighters": Turns(10, "fires_0 firefighters_0 firefighters_1"),
    "grid_tag": Turns(34, "blue_0 blue_1 red_0"),
    "helsinki_pursuit": Turns(20, "blue_0 red_0 red_1"),
    "herding": Turns(51, "dogs_0 sheep_10 sheep_17"),
    "hide_and_seek": Turns(48, "hiders_0 seekers_0 seekers_1"),
    "hunt_in_fog": Turns(39, "deer_0 deer_1 hunters_0"),
    "interception": Turns(30, "guards_0 runners_2 runners_4"),
    "interdiction": Turns(30, "police_0 smugglers_1 smugglers_4"),
    "network": Turns(4, "engineers_0 intruders_0 relays_0"),
    "patrol": Turns(6, "guards_0 robbers_1 sites_0"),
    "people_and_machines": Turns(5, "coins_5 hunters_0 runner"),
    "perimeter": Turns(3, "attackers_0 attackers_17 defenders_0"),
    "pursuit": Turns(33, "evaders_0 evaders_1 pursuers_2"),
    "rumors": Turns(2, "gossips_0 checkers_0 people_0"),
    "sabotage": Turns(19, "couriers_0 couriers_2 saboteur_0"),
    "scotland_yard": Turns(7, "detectives_0 detectives_1 mr_x"),
    "search": Turns(53, "drone_0 lost_2 rescuers_1"),
    "search_by_drones": Turns(15, "drone_0 hiker robot_1"),
    "segregation": Turns(10, "blue_0 red_0 red_1"),
    "selfish_routing": Turns(2, "planned_0 selfish_0 selfish_19"),
    "target_guarding": Turns(7, "guards_0 guards_1 intruder_0"),
    "territory": Turns(10, "blue_0 red_0 red_1"),
    "two_patrols": Turns(10, "cyclic_0 random_0 random_1"),
    "wolf_sheep": Turns(3, "sheep_0 sheep_1 wolves_0"),
}
