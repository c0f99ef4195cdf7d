"""What a scene needs, computed and never declared: everything else is left out."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dembench.scene.base import Model
from dembench.scene.materials import HertzMindlin, Rigid
from dembench.scene.mesh import Mesh
from dembench.scene.scene import Scene
from dembench.scene.sdf import Sdf
from dembench.scene.walls import Cylinder, Frustum, geometry_moves

FORCEABLE = (
    "friction",
    "rolling_friction",
    "rotation",
    "polydisperse",
    "pair_table",
    "walls",
    "curved_walls",
    "mesh_walls",
    "sdf_walls",
    "moving_walls",
    "moving_geometry",
    "periodic",
)
"""Features that can be computed in a scene without them, to measure what leaving them out saves. The others decide
about no buffer and no kernel, or are nothing without what they act on, as constraints and sinks."""


class Features(Model):
    """What decides which kernels, buffers, deck commands, observables and report sections exist.

    Attributes:
        friction: Some pair that can touch has sliding friction.
        tangential_history: Friction, and a law that keeps a shear spring.
        rolling_friction: Some pair has rolling friction.
        rotation: Spins matter: there is friction, rolling friction or a shape, or a body starts with a spin.
        shapes: Some body is no sphere.
        polydisperse: Bodies have different radii.
        pair_table: More than one pair law is in use between particles.
        walls, moving_walls, curved_walls, mesh_walls, sdf_walls: Kinds of walls present.
        moving_geometry: Some wall changes where it is, beyond a motion of its surface.
        sinks, constraints, periodic, gravity: Present or not.
    """

    friction: bool
    tangential_history: bool
    rolling_friction: bool
    rotation: bool
    shapes: bool
    polydisperse: bool
    pair_table: bool
    walls: bool
    moving_walls: bool
    moving_geometry: bool
    curved_walls: bool
    mesh_walls: bool
    sdf_walls: bool
    sinks: bool
    constraints: bool
    periodic: bool
    gravity: bool

    def names(self) -> list[str]:
        """Names of the features that are present."""
        return [name for name, value in self if value]

    def absent(self) -> list[str]:
        """Names of the features that are left out."""
        return [name for name, value in self if not value]

    def forced(self, names: Iterable[str]) -> Features:
        """These features and those of the names with what they entail: an ablation computes what a scene leaves out."""
        return self.model_copy(update=dict.fromkeys(entailed(names), True))


_ENTAILED = {
    "friction": ("tangential_history", "rotation"),
    "rolling_friction": ("friction", "tangential_history", "rotation"),
    "moving_walls": ("walls",),
    "moving_geometry": ("moving_walls", "walls"),
    "curved_walls": ("walls",),
    "mesh_walls": ("walls",),
    "sdf_walls": ("walls",),
}


def entailed(names: Iterable[str]) -> set[str]:
    """Features and those without which they cannot be: friction has a history and turns bodies."""
    return {found for name in names for found in (name, *_ENTAILED.get(name, ()))}


def features(scene: Scene) -> Features:
    """The features of a scene."""
    particle_materials = {s.material for k, s in enumerate(scene.species) if (scene.bodies.species == k).any()}
    touching = particle_materials | {w.material for w in scene.walls}
    laws = [p for p in scene.pair_laws if {p.a, p.b} <= touching and {p.a, p.b} & particle_materials]
    friction = any(p.friction > 0 for p in laws)
    rolling = any(p.rolling_friction > 0 for p in laws)
    shapes = any(s.shape is not None and (scene.bodies.species == k).any() for k, s in enumerate(scene.species))
    radii = scene.radii()
    return Features(
        friction=friction,
        tangential_history=friction and not isinstance(scene.law, Rigid) and _has_shear_spring(scene),
        rolling_friction=rolling,
        rotation=friction or rolling or shapes or bool(np.any(scene.bodies.angular_velocity != 0)),
        shapes=shapes,
        polydisperse=bool(len(radii)) and bool(np.ptp(radii) > 0),
        pair_table=len(particle_materials) > 1,
        walls=bool(scene.walls),
        moving_walls=any(w.motion is not None for w in scene.walls),
        moving_geometry=any(geometry_moves(w) for w in scene.walls),
        curved_walls=any(isinstance(w, Cylinder | Frustum) for w in scene.walls),
        mesh_walls=any(isinstance(w, Mesh) for w in scene.walls),
        sdf_walls=any(isinstance(w, Sdf) for w in scene.walls),
        sinks=bool(scene.sinks),
        constraints=bool(scene.constraints),
        periodic=any(scene.domain.periodic),
        gravity=any(scene.gravity),
    )


def _has_shear_spring(scene: Scene) -> bool:
    return isinstance(scene.law, HertzMindlin) or getattr(scene.law, "tangential_stiffness", 0) > 0
