"""What every wall has: a name, a material and perhaps a motion."""

from __future__ import annotations

from dembench.scene.base import Model, Name, NotNegative, Vector


class Motion(Model):
    """Prescribed motion of a wall: a translation, a rotation about an axis and a harmonic oscillation, added.

    Attributes:
        velocity: Constant velocity [m/s].
        angular_velocity: Rotation vector [rad/s].
        centre: A point on the rotation axis [m].
        amplitude: Amplitude vector of the oscillation amplitude * sin(2 pi frequency t) [m].
        frequency: Frequency of the oscillation [Hz].
        surface: Only the surface moves, and the wall stays where it is: a conveyor belt.
    """

    velocity: Vector = (0.0, 0.0, 0.0)
    angular_velocity: Vector = (0.0, 0.0, 0.0)
    centre: Vector = (0.0, 0.0, 0.0)
    amplitude: Vector = (0.0, 0.0, 0.0)
    frequency: NotNegative = 0.0
    surface: bool = False


class Wall(Model):
    """A named wall of one material, at rest unless it has a motion."""

    name: Name
    material: Name
    motion: Motion | None = None
