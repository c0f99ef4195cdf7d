"""Contact law, materials and the properties of pairs of materials."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from dembench.scene.base import Model, Name, NotNegative, Positive


class HertzMindlin(Model):
    """Viscoelastic Hertz normal force, Mindlin no-slip shear spring with history, Coulomb limit.

    The variants differ in the treatment of the shear history and in the lever arm of the shear force:

    `reference`: history projected on the tangent plane, its length not restored; lever = radius - overlap/2.
    `rescaled`: history projected and rescaled to its old length; lever = full radius.

    Both: Coulomb bound on the total normal force (spring and dashpot), shear dashpot only while sticking, tension
    at the end of a contact not clipped. Source: Dosta et al. 2024, doi 10.1016/j.cpc.2023.109066.
    """

    kind: Literal["hertz-mindlin"] = "hertz-mindlin"
    variant: Literal["reference", "rescaled"] = "reference"


class LinearSpring(Model):
    """Linear spring-dashpot of Cundall & Strack 1979 with constant normal and shear stiffness [N/m]."""

    kind: Literal["linear"] = "linear"
    normal_stiffness: Positive
    tangential_stiffness: NotNegative


class Rigid(Model):
    """Unilateral contact with Newton restitution and Coulomb friction; no stiffness."""

    kind: Literal["rigid"] = "rigid"


Law = Annotated[HertzMindlin | LinearSpring | Rigid, Field(discriminator="kind")]


class Material(Model):
    """An isotropic elastic material.

    Attributes:
        name: Identifier.
        density: Mass density [kg/m^3].
        young: Young's modulus [Pa].
        poisson: Poisson's ratio [-], above -1 and at most 0.5.
    """

    name: Name
    density: Positive
    young: Positive
    poisson: Annotated[float, Field(gt=-1, le=0.5)]


class PairLaw(Model):
    """Properties of a pair of materials; the order of the two names does not matter.

    Attributes:
        a, b: Names of the two materials.
        restitution: Normal coefficient of restitution [-], 0 to 1.
        friction: Coulomb sliding friction coefficient [-].
        tangential_restitution: Tangential restitution of an impulse law [-]; None means 0.
        rolling_friction: Coefficient of rolling friction [-].
    """

    a: Name
    b: Name
    restitution: Annotated[float, Field(ge=0, le=1)]
    friction: NotNegative
    tangential_restitution: Annotated[float, Field(ge=-1, le=1)] | None = None
    rolling_friction: NotNegative = 0.0
