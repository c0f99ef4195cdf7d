"""A stand-in for the program MUSEN: `musen_program.py -s=JOB -t=1`, with its files, its words and its silence.

It reads job scripts and text scenes, moves spheres without friction by the program's own scheme (half a step, then full
ones), and writes exports and logs in the program's format. Results between two scripts are pickles. The environment
variable MUSEN_STANDIN makes it misbehave: `segfault`, `wordless` (exit code 0 after an error message), `empty-scene`
(imports nothing, then never ends), `empty-export`, `short` (ends early), `defaults` (forgets pairs), `nan`.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

MODE = os.environ.get("MUSEN_STANDIN", "")
KEYS = [
    "COMPONENT",
    "SOURCE_FILE",
    "RESULT_FILE",
    "SIMULATOR_TYPE",
    "SIMULATION_STEP",
    "SAVING_STEP",
    "END_TIME",
    "EXT_ACCEL",
    "GEOMETRY_MOTION_TIME",
    "MODEL_PP",
    "MODEL_PW",
    "TIME_INTERVAL",
    "TEXT_EXPORT_PRECISION",
    "TEXT_EXPORT_OBJECTS",
    "TEXT_EXPORT_CONST",
    "TEXT_EXPORT_TD_PART",
    "TEXT_EXPORT_TD_WALL",
    "TEXT_EXPORT_SCENE",
    "TEXT_EXPORT_GEOMETRIES",
    "TEXT_EXPORT_MATERIALS",
    "TEXT_EXPORT_GENERATORS",
]
MODELS = {"ModelPPHertzMindlin", "ModelPWHertzMindlin"}
GRAIN_FIELDS = ("16", "12", "20", "18", "31", "42", "36", "37", "15")
WALL_FIELDS = ("44", "20", "18", "15")
DEFAULT_PAIR = {"200": 0.6, "201": 0.45, "202": 0.05}
Scene = dict[str, Any]


def main() -> None:
    if "-v" in sys.argv:
        print("Version: 1.74.2\nBuild: 261122.061209.")
        return
    if "-m" in sys.argv:
        print("Particle-particle contacts: \n  " + " \n  ".join(sorted(MODELS)))
        return
    script = Path(next(a for a in sys.argv if a.startswith("-s="))[3:])
    jobs: list[dict[str, Any]] = []
    for line in script.read_text().splitlines():
        key, _, value = line.strip().partition(" ")
        if key == "JOB":
            jobs.append({"motions": []})
        elif key == "GEOMETRY_MOTION_TIME":
            jobs[-1]["motions"].append(value.split())
        elif key in KEYS:
            jobs[-1][key] = value
        else:
            say(f"Unknown script key: {key}")
    say(f"Script name:    {script}\nNumber of jobs: {len(jobs)}\n")
    for number, job in enumerate(jobs, 1):
        say(f"//////////////////// Start processing job: {number} ////////////////////")
        component = {"IMPORT_FROM_TEXT": import_text, "EXPORT_TO_TEXT": export}.get(job["COMPONENT"], simulate)
        component(job, Path(job["SOURCE_FILE"]), Path(job["RESULT_FILE"]))


def say(text: str) -> None:
    print(text, flush=True)


def fail(text: str) -> None:
    print(f"Error: {text}\n", file=sys.stderr, flush=True)


# ---- import


def import_text(job: dict[str, Any], source: Path, result: Path) -> None:
    say("Import from text started")
    scene: Scene = {"objects": [], "domain": [-0.005] * 3 + [0.005] * 3, "geometries": {}, "materials": {}, "pairs": {}}
    lines = source.read_text().splitlines() if source.exists() and MODE != "empty-scene" else []
    name = ""
    for line in lines:
        words = line.split()
        if words[0] == "0":
            scene["objects"].append(import_object(words))
        elif words[0] == "22":
            scene["domain"] = list(map(float, words[1:7]))
        elif words[0] == "25":
            name = words[1]
            scene["geometries"][name] = {"ids": [], "motion": []}
        elif words[0] == "27":
            scene["geometries"][name]["ids"] = list(map(int, words[2:]))
        elif words[0] == "32":
            scene["materials"][words[1]] = dict(zip(words[3::2], map(float, words[4::2]), strict=True))
        elif words[0] == "33":
            given = {} if MODE == "defaults" else dict(zip(words[3::2], map(float, words[4::2]), strict=True))
            scene["pairs"][words[1], words[2]] = {**DEFAULT_PAIR, **given}
    result.write_bytes(pickle.dumps(scene))
    say("Import from text finished")


def import_object(words: list[str]) -> dict[str, Any]:
    k = 7 if words[3] == "1" else 5
    found: dict[str, Any] = {"id": int(words[1]), "type": words[3], "shape": words[5:k], "material": words[k + 1]}
    k += 2
    found |= {"left": 0.0, "radius": float(found["shape"][0]) if found["shape"] else 0.0}
    while k < len(words):
        width = {"24": 2, "2": 1, "12": 3, "15": 3, "16": 3, "31": 4, "44": 9}[words[k]]
        values = list(map(float, words[k + 1 : k + 1 + width]))
        if words[k] == "24":
            found["left"] = values[1]
        found[words[k]] = np.array(values)
        k += 1 + width
    return found


# ---- simulation


def simulate(job: dict[str, Any], source: Path, result: Path) -> None:
    if not source.exists():
        return fail("The source file cannot be opened. It may not exist or is not readable.")
    scene: Scene = pickle.loads(source.read_bytes())
    spheres = [o for o in scene["objects"] if o["type"] == "1"]
    triangles = [o for o in scene["objects"] if o["type"] == "14"]
    if MODE == "wordless":
        return fail("Wrong simulator type")
    if any(o["material"] not in scene["materials"] for o in scene["objects"]):
        return fail("Materials not for all particles are defined in database")
    if triangles and "MODEL_PW" not in job:
        return fail("Particle-wall contact model is not specified")
    say("Creating result file ... complete")
    if MODE == "segfault" or not {job["MODEL_PP"], job.get("MODEL_PW", "ModelPWHertzMindlin")} <= MODELS:
        os.kill(os.getpid(), signal.SIGSEGV)
    for motion in job["motions"]:
        if motion[0] in scene["geometries"]:
            scene["geometries"][motion[0]]["motion"].append(list(map(float, motion[1:])))
    say(f"Total number of particles:             {len(spheres)}")
    say(f"Total number of walls:                 {len(triangles)}")
    say("\n ==================== Simulation started  ====================")
    while not spheres:
        time.sleep(0.05)
    begin = time.monotonic()
    run(job, scene, spheres, triangles)
    result.write_bytes(pickle.dumps(scene))
    if MODE != "short":
        say(f"Elapsed time [d:h:m:s]: 00:00:00:{round(time.monotonic() - begin):02d}")
        say(" ==================== Simulation finished ====================")


def run(job: dict[str, Any], scene: Scene, spheres: list[Any], triangles: list[Any]) -> None:
    step, saving, end = (float(job[key]) for key in ("SIMULATION_STEP", "SAVING_STEP", "END_TIME"))
    gravity = np.array(list(map(float, job["EXT_ACCEL"].split())))
    place, speed, spin = (np.array([o[tag] for o in spheres]) for tag in ("12", "15", "16"))
    mass = np.array([scene["materials"][o["material"]]["0"] * 4 / 3 * math.pi * o["radius"] ** 3 for o in spheres])
    walls = np.array([o["44"] for o in triangles]).reshape(-1, 3, 3)
    moving = {}
    for geometry in scene["geometries"].values():
        rows = [k for k, o in enumerate(triangles) if o["id"] in geometry["ids"]]
        for interval in geometry["motion"]:
            moving[tuple(rows)] = interval
    there = np.array([o["left"] > 0 for o in spheres])
    force, load = np.zeros_like(place), np.zeros((len(walls), 3))
    scene["frames"] = []
    now, last, first = 0.0, 0.0, True

    def save() -> None:
        state = {"place": place, "speed": speed, "spin": spin, "force": force, "load": load, "walls": walls}
        scene["frames"].append({"time": now, **{name: array.copy() for name, array in state.items()}})

    save()
    while now < end:
        if now - last + 0.1 * step > saving:
            save()
            last = now
            say(f"Current time [s]: {now:g}")
            if MODE == "short":
                return
        outside = ((place < scene["domain"][:3]) | (place > scene["domain"][3:])).any(axis=1)
        for k in np.flatnonzero(there & outside):
            there[k] = False
            spheres[k]["left"] = now
        force[:], load[:] = 0, 0
        contacts(scene, spheres, triangles, place, speed, there, walls, force, load)
        force += mass[:, None] * gravity
        force[~there] = 0
        speed += np.where(there[:, None], force / mass[:, None] * (step / 2 if first else step), 0)
        if not first:
            place += np.where(there[:, None], speed * step, 0)
            now += step
        for rows, (begin, stop, *motion) in moving.items():
            if begin <= now <= stop:
                walls[list(rows)] = moved(walls[list(rows)], np.array(motion), step)
        first = False
        if MODE == "nan" and now > end / 2:
            place[0] = math.nan
    save()


def contacts(
    scene: Scene,
    spheres: list[Any],
    triangles: list[Any],
    place: np.ndarray,
    speed: np.ndarray,
    there: np.ndarray,
    walls: np.ndarray,
    force: np.ndarray,
    load: np.ndarray,
) -> None:
    """Adds the forces of all contacts to those of spheres and triangles."""
    edges = np.roll(walls, -1, axis=1) - walls
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    radius = np.array([o["radius"] for o in spheres])
    gaps = place[:, None] - place
    overlaps = radius[:, None] + radius - np.sqrt((gaps**2).sum(axis=2))
    for i, j in zip(*np.nonzero(np.triu(there[:, None] & there & (overlaps > 0), 1)), strict=True):
        away = gaps[i, j] / np.linalg.norm(gaps[i, j])
        push = hertz(scene, spheres[i], spheres[j], overlaps[i, j], (speed[i] - speed[j]) @ away) * away
        force[i] += push
        force[j] -= push
    for i in np.flatnonzero(there) if len(walls) else ():
        height = ((place[i] - walls[:, 0]) * normals).sum(axis=1)
        foot = place[i] - height[:, None] * normals
        over = (np.cross(edges, foot[:, None] - walls) * normals[:, None]).sum(axis=2)
        for k in np.flatnonzero((np.abs(height) < radius[i]) & (over >= 0).all(axis=1)):
            overlap = radius[i] - abs(height[k])
            push = hertz(scene, spheres[i], triangles[k], overlap, speed[i] @ normals[k]) * normals[k]
            force[i] += push
            load[k] -= push


def hertz(scene: Scene, a: Any, b: Any, overlap: float, approach: float) -> float:
    """Normal force of two spheres, or of a sphere and a wall."""
    one, two = scene["materials"][a["material"]], scene["materials"][b["material"]]
    stiff = 1 / ((1 - one["10"] ** 2) / one["7"] + (1 - two["10"] ** 2) / two["7"])
    radius, mass = a["radius"], one["0"] * 4 / 3 * math.pi * a["radius"] ** 3
    if b["type"] == "1":
        other = two["0"] * 4 / 3 * math.pi * b["radius"] ** 3
        radius, mass = radius * b["radius"] / (radius + b["radius"]), mass * other / (mass + other)
    pair = scene["pairs"].get((a["material"], b["material"])) or scene["pairs"][b["material"], a["material"]]
    beta = math.log(pair["200"]) / math.hypot(math.log(pair["200"]), math.pi)
    normal = 2 * stiff * math.sqrt(radius * overlap)
    return 2 / 3 * normal * overlap + 2 * math.sqrt(5 / 6) * beta * approach * math.sqrt(normal * mass)


def moved(vertices: np.ndarray, motion: np.ndarray, step: float) -> np.ndarray:
    """Vertices moved by a step with v, w about c (Rodrigues' formula)."""
    speed, spin, centre = motion[:3], motion[3:6], motion[6:]
    vertices = vertices + speed * step
    rate = np.linalg.norm(spin)
    if rate:
        axis, angle, arm = spin / rate, rate * step, vertices - centre
        along = (arm @ axis)[..., None] * axis
        vertices = centre + along + (arm - along) * math.cos(angle) + np.cross(axis, arm) * math.sin(angle)
    return vertices


# ---- export


def export(job: dict[str, Any], source: Path, result: Path) -> None:
    if not source.exists():
        return fail("The source file cannot be opened. It may not exist or is not readable.")
    scene: Scene = pickle.loads(source.read_bytes())
    if "/" not in job["RESULT_FILE"]:
        print("terminate called after throwing an instance of 'std::filesystem::filesystem_error'", file=sys.stderr)
        os.abort()
    result.parent.mkdir(parents=True, exist_ok=True)
    low, high = map(float, job.get("TIME_INTERVAL", "0 1e300").split())
    frames = [f for f in scene["frames"] if low <= f["time"] <= high]
    digits = int(job.get("TEXT_EXPORT_PRECISION", 6))
    say("Export to text started")
    with open(result, "w") as stream:
        if MODE != "empty-export":
            stream.writelines(line + " \n" for line in exported(job, scene, frames, digits))
    say("Export to text finished")


def exported(job: dict[str, Any], scene: Scene, frames: list[Any], digits: int) -> list[str]:
    part = job.get("TEXT_EXPORT_TD_PART", "1 1 1 0 0 0 0 0 1").split()
    wall = job.get("TEXT_EXPORT_TD_WALL", "1 1 0 0").split()
    lines = []
    rows = {"1": -1, "14": -1}
    for o in scene["objects"]:
        kind = o["type"]
        rows[kind] += 1
        if frames[0]["time"] > o["left"]:
            continue
        words = [f"0 {o['id']} 1 {kind} 5 {' '.join(o['shape'])} 23 {o['material']} 24 0 {o['left']:g}"]
        gone = 0
        for frame in frames:
            gone += frame["time"] >= o["left"]
            words.append(f"2 {frame['time']:.{digits}g}")
            fields = part_fields(part, frame, rows[kind]) if kind == "1" else wall_fields(wall, frame, rows[kind])
            for tag, values in fields:
                words.append(" ".join([tag, *(f"{0 if gone > 1 else x:.{digits}g}" for x in values)]))
        lines.append(" ".join(words))
    lines.append("22 " + " ".join(f"{x:g}" for x in scene["domain"]))
    for name, g in scene["geometries"].items():
        order = [0, 1, 2, 3, 4, 8, 9, 10, 5, 6, 7]
        motion = [f"{g['motion'][0][k]:g}" for k in order] if g["motion"] else []
        lines.append(f"25 {name} KEY 0 0 0 0 0")
        lines.append(" ".join(["26 1 1" if motion else "26 0 0", *motion]) + " ")
        lines.append(f"27 {len(g['ids'])} {' '.join(map(str, g['ids']))}")
    for key, properties in scene["materials"].items():
        lines.append(f"32 {key} {key} " + " ".join(f"{tag} {x:g}" for tag, x in {**properties, "1": 1000.0}.items()))
    for (a, b), properties in scene["pairs"].items():
        lines.append(f"33 {b} {a} " + " ".join(f"{tag} {x:g}" for tag, x in properties.items()))
    return lines


def part_fields(flags: list[str], frame: Any, row: int) -> list[tuple[str, Any]]:
    values = {"12": frame["place"][row], "15": frame["speed"][row], "16": frame["spin"][row], "20": frame["force"][row]}
    return [(tag, values[tag]) for flag, tag in zip(flags, GRAIN_FIELDS, strict=True) if flag == "1"]


def wall_fields(flags: list[str], frame: Any, row: int) -> list[tuple[str, Any]]:
    values = {"44": frame["walls"][row].ravel(), "20": frame["load"][row]}
    return [(tag, values[tag]) for flag, tag in zip(flags, WALL_FIELDS, strict=True) if flag == "1"]


if __name__ == "__main__":
    main()
