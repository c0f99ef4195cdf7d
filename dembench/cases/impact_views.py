"""What the page of the particle impact shows beside the path of the ball: the bed cut open at the deepest point."""

from __future__ import annotations

from dembench.cases import impact_scores
from dembench.cases.publication import published
from dembench.cases.published_results import PublishedResult, recorded
from dembench.cases.views import Picture
from dembench.scene import Box, Scene, Snapshot

SNAPSHOT = "deepest"
SPRAY = 0.03
"""Height above the resting bed that is seen [m]."""
WALL = 0.002
RECORDED = {"time_of_deepest": ("Time of the deepest point", "s")}
"""Title and unit of what is on record of others beside the quantities of the case."""


def pictures(scene: Scene) -> list[Picture]:
    """The bed cut open at the time of the deepest point; none where that time is not recorded."""
    times = [o.times for o in scene.observables if isinstance(o, Snapshot) and o.name == SNAPSHOT]
    if not times:
        return []
    box = next(wall for wall in scene.walls if isinstance(wall, Box))
    ball = scene.tracked_bodies()[0]
    top = float(scene.bodies.position[[k for k in range(len(scene.bodies)) if k != ball], 2].max())
    return [
        Picture(
            name="cut-open",
            title=f"The bed cut open at {1e3 * times[0][0]:g} ms",
            caption="Grains behind the plane through the middle of the bed, and the ball.",
            snapshot=SNAPSHOT,
            times=times[0][:1],
            x=(box.lower[0] - WALL, box.upper[0] + WALL),
            z=(box.lower[2] - WALL, top + SPRAY),
            cut=0.0,
            colour="speed",
            always=(ball,),
        )
    ]


def published_results(bed: str) -> list[PublishedResult]:
    """Deepest points, end points and gaps to the floor that are on record of single codes."""
    numbers = published("impact")
    conditions = f"mean over ten initial conditions (nine for LIGGGHTS); doi {numbers['doi']}"
    ensembles = [
        {
            "code": entry["code"],
            "deepest": {"mean": entry["mean"], "deviation": entry["deviation"]},
            "time_of_deepest": entry["time"],
            "source": conditions,
        }
        for entry in (numbers["deepest_25k"] if bed == "25k" else ())
    ]
    runs = [entry for entry in numbers["runs"] if entry["bed"] == bed]
    return recorded([*ensembles, *runs], {**impact_scores.QUANTITIES, **RECORDED})
