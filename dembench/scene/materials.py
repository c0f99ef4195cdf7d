"""Contact law, materials and the properties of pairs of materials."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from dembench.scene.base import Model, Name, NotNegative, Positive


class HertzMindlin(Model):
    """Viscoelastic Hertz normal force, Mindlin no-slip shear spring with history, Coulomb limit.

    The variants differ in the treatment of the shear history, in the lever arm of the shear force and in tension:

    `reference` (LIGGGHTS): history projected on the tangent plane, its length not restored; lever = radius - overlap/2.
    `rescaled` (MUSEN): history projected and rescaled to its old length; lever = full radius.
    `no-tension` (Thornton, Yade): as `reference`, but the total normal force is never below 0. Its dashpot stays that
    of the others, so that bodies part before the overlap ends and rebound faster than the pair law's restitution says
    (Schwager & Poeschel 2007, doi 10.1007/s10035-007-0065-z): 0.550 for 0.5.

    All: Coulomb bound on the total normal force (spring and dashpot), shear dashpot only while sticking; the first two
    do not clip the tension at the end of a contact. Source: Dosta et al. 2024, doi 10.1016/j.cpc.2023.109066.
    """

    kind: Literal["hertz-mindlin"] = "hertz-mindlin"
    variant: Literal["reference", "rescaled", "no-tension"] = "reference"


class LinearSpring(Model):
    """Linear spring-dashpot of Cundall & Strack 1979, doi 10.1680/geot.1979.29.1.47, the same for all pairs.

    History, Coulomb bound, lever and tension are those of the reference variant of `HertzMindlin`. The dashpots give
    the restitution of the pair law; without shear stiffness there is no friction.

    Attributes:
        normal_stiffness, tangential_stiffness: Force per overlap and per tangential displacement [N/m].
    """

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
        rolling_friction: Coefficient of rolling friction [-]: the largest moment against the rolling of the two is this
            times the normal force times the reduced radius (of a body on a wall: its radius).
    """

    a: Name
    b: Name
    restitution: Annotated[float, Field(ge=0, le=1)]
    friction: NotNegative
    tangential_restitution: Annotated[float, Field(ge=-1, le=1)] | None = None
    rolling_friction: NotNegative = 0.0

    def damping_ratio(self) -> float:
        """b = -ln e/sqrt(ln^2 e + pi^2) [-], 1 for e = 0 (Y. Tsuji et al. 1992, Powder Technol. 71, 239)."""
        e = self.restitution
        return math.log(1 / e) / math.hypot(math.log(e), math.pi) if e else 1.0
