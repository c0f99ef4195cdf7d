"""Motion of walls: their poses at a time, and bounds of their speed."""

from typing import Any

import numpy as np
import warp as wp

from dembench.scene import Motion, Scene, geometry_moves
from dembench.solver.units import Units
from dembench.solver.walls.records import Pose, WallMotion, Walls


@wp.func
def place(walls: Walls, first: int, time: wp.float64, moment: wp.float64):
    """Writes the poses of a thread, which begin at `first`: the places at `time`, the velocities at `moment`."""
    for m in range(walls.motions.shape[0]):
        motion = walls.motions[m]
        pose = Pose()
        pose.start = motion.centre
        pose.centre = motion.centre
        pose.turn = wp.quatd(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
        pose.velocity = motion.velocity + (motion.rate * wp.cos(motion.rate * moment)) * motion.amplitude
        pose.spin = motion.spin
        pose.stays = motion.stays
        if motion.stays == 0:
            pose.centre = motion.centre + time * motion.velocity + wp.sin(motion.rate * time) * motion.amplitude
            rate = wp.length(motion.spin)
            if rate > wp.float64(0.0):
                pose.turn = wp.quat_from_axis_angle(motion.spin / rate, rate * time)
        walls.poses[first + m] = pose


@wp.kernel(enable_backward=False, module="unique")
def place_all(
    # inputs
    threads: int,
    time: wp.float64,
    # outputs
    walls: Walls,
):
    """Poses of all threads at a time; launched with dim = 1."""
    for p in range(threads):
        place(walls, p * walls.motions.shape[0], time, time)


class Motions:
    """Motions of the walls of a scene, each once.

    Attributes:
        found: The motions that are there.
        moved: For each, whether it changes where some wall is.
    """

    def __init__(self, scene: Scene):
        self.found: list[Motion] = []
        self.moved: list[bool] = []
        for wall in scene.walls:
            if wall.motion is not None and self.of(wall) < 0:
                self.found.append(wall.motion)
                self.moved.append(geometry_moves(wall))

    def of(self, wall: Any) -> int:
        """Index of the motion of a wall, -1 where it is at rest."""
        for k, motion in enumerate(self.found):
            if motion == wall.motion and self.moved[k] == geometry_moves(wall):
                return k
        return -1

    @property
    def timed(self) -> bool:
        """Whether some place or speed changes with time."""
        return any(self.moved) or any(m.frequency and any(m.amplitude) for m in self.found)

    def records(self, units: Units) -> list[Any]:
        """The motions in scene units, as WallMotion records."""
        found = []
        for motion, moved in zip(self.found, self.moved, strict=True):
            record = WallMotion()
            record.velocity = wp.vec3d(*(v / units.velocity for v in motion.velocity))
            record.amplitude = wp.vec3d(*(a / units.length for a in motion.amplitude))
            record.rate = 2 * np.pi * motion.frequency * units.time
            record.spin = wp.vec3d(*(w * units.time for w in motion.angular_velocity))
            record.centre = wp.vec3d(*(x / units.length for x in motion.centre))
            record.stays = int(not moved)
            found.append(record)
        return found

    def largest_speed(self, units: Units, time: float, low: np.ndarray, high: np.ndarray) -> float:
        """Bound of the speed at which walls that change their place pass points between low and high [scene units].

        The signed distance of a point to a wall changes at most as fast as the wall's surface would move at the point.
        """
        largest = 0.0
        for motion, moved in zip(self.found, self.moved, strict=True):
            if moved:
                velocity, amplitude = np.array(motion.velocity), np.array(motion.amplitude)
                phase = 2 * np.pi * motion.frequency * units.time * time
                centre = np.array(motion.centre) + velocity * units.time * time + amplitude * np.sin(phase)
                corner = np.maximum(np.abs(low - centre / units.length), np.abs(high - centre / units.length))
                speed = np.linalg.norm(velocity) + 2 * np.pi * motion.frequency * np.linalg.norm(amplitude)
                turning = np.linalg.norm(motion.angular_velocity) * units.time * np.linalg.norm(corner)
                largest = max(largest, float(speed / units.velocity + turning))
        return largest
