"""WHAT is simulated: an engine-neutral scene as frozen data in SI units."""

from dembench.scene.arrays import scene_from_arrays
from dembench.scene.bodies import Bodies
from dembench.scene.checks import check_scene
from dembench.scene.features import FORCEABLE, Features, features
from dembench.scene.files import SceneError, load_scene, save_scene, scene_from, scene_schema
from dembench.scene.materials import HertzMindlin, LinearSpring, Material, PairLaw, Rigid
from dembench.scene.mesh import Mesh
from dembench.scene.observables import (
    CentreOfMass,
    Count,
    ElasticEnergy,
    Energy,
    Overlap,
    Region,
    Snapshot,
    Trajectory,
    WallForce,
    ZoneCount,
)
from dembench.scene.scene import Constraint, Domain, Scene, Sink, Species
from dembench.scene.sdf import Sdf
from dembench.scene.shapes import Clump, Grain
from dembench.scene.wall import Motion
from dembench.scene.walls import Box, Cylinder, Frustum, Plane, geometry_moves

__all__ = [
    "FORCEABLE",
    "Bodies",
    "Box",
    "CentreOfMass",
    "Clump",
    "Constraint",
    "Count",
    "Cylinder",
    "Domain",
    "ElasticEnergy",
    "Energy",
    "Features",
    "Frustum",
    "Grain",
    "HertzMindlin",
    "LinearSpring",
    "Material",
    "Mesh",
    "Motion",
    "Overlap",
    "PairLaw",
    "Plane",
    "Region",
    "Rigid",
    "Scene",
    "SceneError",
    "Sdf",
    "Sink",
    "Snapshot",
    "Species",
    "Trajectory",
    "WallForce",
    "ZoneCount",
    "check_scene",
    "features",
    "geometry_moves",
    "load_scene",
    "save_scene",
    "scene_from",
    "scene_from_arrays",
    "scene_schema",
]
