"""Makes docs/images/ur5.webp, with which the README and the site begin.

python docs/site/moving_picture.py
"""

from pathlib import Path

import jointplay as jp
from jointplay.show import player
from jointplay.show.player.movie import Shot

TARGET = Path(__file__).parents[1] / "images" / "ur5.webp"

if __name__ == "__main__":
    scenario = jp.robot_scenario("ur5", ["elbow_joint"])
    clearance = {"joints": {"elbow_joint": {"radial_clearance": 0.1e-3}}}
    result = scenario.simulation(changes=clearance).run()
    TARGET.unlink(missing_ok=True)
    shot = Shot(speed=0.2, frames_per_second=12, size=(800, 450), signal="tool error")
    cases = {"UR5, 0.1 mm": result}
    print(player.save_movie(cases, TARGET, shot, print, progress=True))
