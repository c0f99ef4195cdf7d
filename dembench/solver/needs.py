"""What a simulation needs: the features of its scene, and those that an ablation forces on it."""

from __future__ import annotations

from dataclasses import dataclass

from dembench.scene import Scene, features
from dembench.scene.features import Features, entailed


@dataclass(frozen=True)
class Needs:
    """What decides about buffers and kernels.

    Attributes:
        present: Features of the scene and those forced.
        force: Names of the forced ones.
        loads: Forces on bodies are kept from step to step, whether or not some come from outside.
        impulses: Contacts remember the impulses of the last step, whatever the law.
    """

    present: Features
    force: tuple[str, ...] = ()
    loads: bool = True
    impulses: bool = False

    @classmethod
    def of(cls, scene: Scene, force: tuple[str, ...] = (), loads: bool = True, impulses: bool = False) -> Needs:
        """The needs of a scene; `force` adds features, names of `FORCEABLE`."""
        return cls(features(scene).forced(force), tuple(force), loads, impulses)

    def forces(self, name: str) -> bool:
        """Whether a feature is there because it, or one that entails it, was forced."""
        return bool(self.force) and name in entailed(self.force)

    @property
    def friction(self) -> bool:
        """Whether contacts have a tangential part."""
        return self.present.friction or self.present.rolling_friction

    @property
    def rotation(self) -> bool:
        """Whether bodies have spins, torques and moments of inertia."""
        return self.present.rotation

    @property
    def history(self) -> bool:
        """Whether contacts have a memory."""
        return self.friction or self.impulses or self.present.shapes

    @property
    def radii(self) -> bool:
        """Whether the radius is read body by body."""
        return self.present.polydisperse
