"""Whether the bodies of a scene fit into it: inside domain and walls, and hardly overlapping at the start."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from dembench.scene.features import features
from dembench.scene.files import SceneError
from dembench.scene.materials import HertzMindlin
from dembench.scene.mesh import Mesh, closest_points
from dembench.scene.scene import Scene
from dembench.scene.shape_overlap import Shaped

LARGEST_OVERLAP = 0.01
"""Largest overlap in radii that any start may have [-]."""
STRONGEST = 5.0
"""Largest overlap of a packing at rest, in those of its lowest contacts on average; 3 was found in a silo [-]."""
SOLID_FRACTION = 0.6


def check_scene(scene: Scene) -> None:
    """Checks the initial state of a scene.

    A centre must lie in the domain and on the void's side of every wall. Two particles may overlap by 1 % of the
    smaller radius, a particle and a wall by 1 % of its radius; soft particles by as much as their weight makes them
    (`accepted_overlap`). A mesh need not be closed and so has no outside: with
    it only the overlap counts. Particles that are no spheres touch with their surface, but 1 % is that of the radius
    that holds them.

    Raises:
        SceneError: One line per kind of fault: how many particles have it, the worst one and what is accepted.
    """
    overlaps = _shape_faults if features(scene).shapes else _overlaps
    faults = [*_outside_domain(scene), *_wall_faults(scene), *overlaps(scene)]
    if faults:
        raise SceneError("\n".join(f"{scene.name}: bodies.position: {fault}" for fault in faults))


def accepted_overlap(scene: Scene) -> float:
    """Largest overlap of a start in radii [-]: 1 %, or what a packing of soft particles has at rest.

    Weight above the lowest particles of radius r gives the pressure p = 0.6 rho g h, and each of their contacts the
    force p (2 r)^2, as in a simple cubic packing; the overlap is Hertz's, (3 F/(4 E* sqrt(r/2)))^(2/3), and that of
    the strongest contacts five times as large.
    """
    found, gravity = LARGEST_OVERLAP, np.array(scene.gravity)
    if not isinstance(scene.law, HertzMindlin) or not gravity.any():
        return found
    for k, own in enumerate(scene.species):
        here = scene.bodies.species == k
        if here.any():
            material, radius = scene.material(own.material), float(scene.radii()[here].max())
            weight = SOLID_FRACTION * material.density * float(np.ptp(scene.bodies.position[here] @ gravity))
            modulus = material.young / (2 * (1 - material.poisson**2))
            overlap = (3 * weight * (2 * radius) ** 2 / (4 * modulus * (radius / 2) ** 0.5)) ** (2 / 3)
            found = max(found, STRONGEST * overlap / radius)
    return found


def _outside_domain(scene: Scene) -> Iterator[str]:
    position, domain = scene.bodies.position, scene.domain
    beyond = np.maximum(np.array(domain.lower) - position, position - np.array(domain.upper))
    for axis in range(3):
        count = int(np.count_nonzero(beyond[:, axis] > 0))
        if count:
            worst = int(np.argmax(beyond[:, axis]))
            yield (
                f"{count} of {len(position)} particles are outside the domain; worst is particle {worst} with "
                f"{'xyz'[axis]} = {position[worst, axis]:g} m, accepted is {domain.lower[axis]:g} to "
                f"{domain.upper[axis]:g} m"
            )


def _wall_faults(scene: Scene) -> Iterator[str]:
    # what touches walls: the bodies themselves, or the spheres on the surface of those that have a shape
    accepted = accepted_overlap(scene)
    position, reach, radius = scene.bodies.position, scene.radii(), scene.radii()
    owner = np.arange(len(position))
    if features(scene).shapes:
        found = [_shaped(scene).probes(i) for i in range(len(position))]
        owner = np.repeat(owner, [len(probes) for probes in found])
        position, reach, radius = np.vstack(found)[:, :3], np.vstack(found)[:, 3], radius[owner]
    if not len(position):
        return
    for wall in scene.walls:
        if isinstance(wall, Mesh):
            distance = _mesh_distance(wall, position, reach)
        else:
            distance = wall.signed_distance(position)
            outside = distance < -LARGEST_OVERLAP * (radius - reach)
            if outside.any():
                worst = int(np.argmin(distance))
                yield (
                    f"{len(np.unique(owner[outside]))} of {len(scene.bodies)} particles are outside wall {wall.name}; "
                    f"worst is particle {owner[worst]} at {_point(scene.bodies.position[owner[worst]])}, "
                    f"{-distance[worst]:.4g} m beyond it"
                )
            distance = np.where(outside, np.inf, distance)
        overlap = (reach - distance) / radius
        count = len(np.unique(owner[overlap > accepted]))
        if count:
            worst = int(np.argmax(overlap))
            yield (
                f"{count} of {len(scene.bodies)} particles overlap wall {wall.name} by more than "
                f"{accepted:.0%} of their radius; worst is particle {owner[worst]} at "
                f"{_point(scene.bodies.position[owner[worst]])} with {overlap[worst]:.2%}"
            )


def _shaped(scene: Scene) -> Shaped:
    bodies = scene.bodies
    return Shaped(scene.species, bodies.species, bodies.position, bodies.orientation)


def _shape_faults(scene: Scene) -> Iterator[str]:
    radius = scene.radii()
    found = [(depth / min(radius[i], radius[j]), i, j) for i, j, depth in _shaped(scene).overlaps(scene.domain)]
    found = [fault for fault in found if fault[0] > LARGEST_OVERLAP]
    if found:
        share, i, j = max(found)
        yield (
            f"{len(found)} pairs of particles overlap by more than {LARGEST_OVERLAP:.0%} of the smaller radius; worst "
            f"are particles {min(i, j)} and {max(i, j)} with {share:.2%}"
        )


def _mesh_distance(wall: Mesh, position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Distance to the nearest triangle [m], shape (n,), where it is below the radius; infinity elsewhere."""
    distance = np.full(len(position), np.inf)
    centre = wall.triangles.mean(axis=1)
    reach = np.linalg.norm(wall.triangles - centre[:, None], axis=2).max(axis=1) + radius.max()
    near = cKDTree(position).query_ball_point(centre, reach)
    for triangle, indices in zip(wall.triangles, near, strict=True):
        if indices:
            points = position[indices]
            found = np.linalg.norm(points - closest_points(points, triangle), axis=1)
            distance[indices] = np.minimum(distance[indices], found)
    return np.where(distance < radius, distance, np.inf)


def _overlaps(scene: Scene) -> Iterator[str]:
    radius, accepted = scene.radii(), accepted_overlap(scene)
    count, worst, pair = 0, 0.0, (0, 0)
    for a, b, distance in _near_pairs(scene, radius):
        overlap = (radius[a] + radius[b] - distance) / np.minimum(radius[a], radius[b])
        too_much = overlap > accepted
        count += int(np.count_nonzero(too_much))
        if too_much.any() and overlap.max() > worst:
            k = int(np.argmax(overlap))
            worst, pair = float(overlap[k]), (int(a[k]), int(b[k]))
    if count:
        i, j = sorted(pair)
        touching = radius[i] + radius[j]
        distance = touching - worst * min(radius[i], radius[j])
        yield (
            f"{count} pairs of particles overlap by more than {accepted:.0%} of the smaller radius; worst are "
            f"particles {i} and {j} with {worst:.2%}, {distance:.6g} m apart where their radii add to {touching:.6g} m"
        )


def _near_pairs(scene: Scene, radius: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Pairs that may touch: indices of both, shape (k,), and their distance [m].

    Particles are handled in classes of similar radius, so that one large ball does not make every grain a candidate.
    """
    if not len(radius):
        return
    domain = scene.domain
    size = np.array(domain.upper) - np.array(domain.lower)
    box = np.where(domain.periodic, size, 0.0)
    position = scene.bodies.position - np.array(domain.lower)
    position = np.where(domain.periodic, np.mod(position, size), position)
    level = np.floor(np.log2(radius / radius.min())).astype(int)
    members = [np.flatnonzero(level == k) for k in np.unique(level)]
    trees = [cKDTree(position[m], boxsize=box) for m in members]
    for k, own in enumerate(members):
        pairs = trees[k].query_pairs(2 * radius[own].max(), output_type="ndarray")
        yield own[pairs[:, 0]], own[pairs[:, 1]], _distance(position, own[pairs[:, 0]], own[pairs[:, 1]], box)
        for j, others in enumerate(members[:k]):
            near = trees[j].query_ball_point(position[own], radius[own] + radius[others].max())
            a = np.repeat(own, [len(n) for n in near])
            b = others[np.concatenate([np.asarray(n, dtype=int) for n in near])]
            yield a, b, _distance(position, a, b, box)


def _distance(position: np.ndarray, a: np.ndarray, b: np.ndarray, box: np.ndarray) -> np.ndarray:
    offset = position[a] - position[b]
    with np.errstate(divide="ignore", invalid="ignore"):
        image = np.where(box > 0, box * np.round(offset / box), 0.0)
    return np.linalg.norm(offset - image, axis=1)


def _point(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:g}" for x in point) + ") m"
