"""What programs share that a script of the deck drives: the initial state, the steps at which it writes, what it wrote.

Frames are arrays of NumPy, the tracks one binary file, and notes tell of its progress.
"""

from __future__ import annotations

import re
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from dembench.engines.base import FRAMES, Engine, Frame, FrameFiles, Series, Timing, Tracks, end_of
from dembench.engines.scene_queries import every_of, in_sink, materials_of, observed_walls, steps_of
from dembench.scene import Region, Scene

DECK, TRACKS, NOTES = "simulate.py", "tracks.bin", "progress.txt"
IDS_PER_LINE = 1000


class ScriptEngine(Engine):
    """An engine whose deck is a script that writes frames, tracks and notes by itself."""

    def read(self, scene: Scene, settings: Any, directory: Path) -> Series:
        """See `Engine.read`: complete frames and tracks so far, the script's own timing, its errors."""
        frames = read_frames(scene, settings.dt, directory)
        tracks, gone = read_tracks(scene, settings.dt, directory)
        path = directory / NOTES
        notes = path.read_text(errors="replace") if path.exists() else ""
        failure, detail = ("lost particles", gone) if gone else failure_in(notes)
        timing = timing_in(notes)
        if failure is None and timing and len(frames) < len(scene.frame_times()):
            failure, detail = "no output", f"{len(frames)} of {len(scene.frame_times())} frames were written"
        time = last_step(notes) * settings.dt
        return Series(frames, tracks, timing or Timing(), time, failure, detail, counters_in(notes))

    def reached(self, settings: Any, directory: Path) -> float | None:
        """See `Engine.reached`."""
        return last_step(end_of(directory / NOTES)) * settings.dt or None


def write_bodies(scene: Scene, path: Path) -> None:
    """The initial state of a scene, every number to its last bit; fixed bodies do not move."""
    bodies = scene.bodies
    fixed = [b for c in scene.constraints if c.kind == "fixed" for b in c.bodies]
    still = np.isin(np.arange(len(bodies)), fixed)[:, None]
    names = [m.name for m in materials_of(scene)]
    kinds = np.array([names.index(s.material) for s in scene.species])[bodies.species]
    motion = np.column_stack([bodies.velocity, bodies.angular_velocity])
    table = np.column_stack([kinds, scene.radii(), bodies.position, np.where(still, 0, motion)])
    np.savetxt(path, table, fmt="%d" + 10 * " %.17g", header="material radius x y z vx vy vz wx wy wz")


def schedule(steps: list[int]) -> str:
    """Steps as a Python expression: a range where they are evenly spaced."""
    gaps = set(np.diff(steps).tolist())
    if len(gaps) == 1:
        return repr(range(steps[0], steps[-1] + 1, gaps.pop()))
    return "{" + ", ".join(map(str, steps)) + "}" if steps else "()"


def sampling(scene: Scene, dt: float) -> dict[str, Any]:
    """What a script needs to know of its steps: how many there are, and those at which it writes."""
    steps = steps_of(np.array([scene.duration]), dt)[0]
    tracked = list(scene.tracked_bodies())
    frames, tracks = steps_of(scene.frame_times(), dt), steps_of(scene.track_times(), dt) if tracked else []
    return {
        "steps": steps,
        "frames": schedule(frames),
        "tracks": schedule(tracks),
        "tracked": tracked,
        "every": every_of(sorted({*frames, *tracks}), steps),
    }


def within(region: Region) -> str:
    """Which of the arrays x, y, z lie in a region, as a Python expression."""
    terms = [
        f"({bound!r} <= {axis})" if side == 0 else f"({axis} <= {bound!r})"
        for side, bounds in enumerate((region.lower, region.upper))
        for axis, bound in zip("xyz", bounds, strict=True)
        if bound is not None
    ]
    return f"({' & '.join(terms) or 'np.isfinite(x)'})"


def rendered(template: str, values: dict[str, Any], **more: Any) -> str:
    """A template of this folder with values; one that is missing is an error."""
    text = files("dembench.engines").joinpath(template).read_text()
    made = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True).from_string(text)
    return made.render(values, **more)


def read_frames(scene: Scene, dt: float, directory: Path) -> FrameFiles:
    """The frames of a scene that are completely written so far: files get their names when they are complete."""
    known = []
    for step, time in zip(steps_of(scene.frame_times(), dt), scene.frame_times(), strict=True):
        path = directory / FRAMES / f"{step}.npz"
        if not path.exists():
            break
        known.append((step, float(time), path))
    return FrameFiles(known, partial(_load_frame, scene))


def _load_frame(scene: Scene, step: int, time: float, path: Path) -> Frame:
    with np.load(path) as file:
        body, state = file["body"].astype(np.intp), file["state"]
        forces = file["forces"] if "forces" in file else np.empty((0, 3))
    left = ~in_sink(scene, state[:, :3])
    body, state = body[left], state[left]
    by_wall = dict(zip(observed_walls(scene), forces, strict=True))
    return Frame(step, time, body, state[:, :3], state[:, 3:6], state[:, 6:], by_wall)


def read_tracks(scene: Scene, dt: float, directory: Path) -> tuple[Tracks | None, str]:
    """The tracks written so far, None where the scene tracks no body; and which tracked body is gone, if one is."""
    bodies = scene.tracked_bodies()
    if not bodies:
        return None, ""
    path, width = directory / TRACKS, 1 + 6 * len(bodies)
    data = path.read_bytes() if path.exists() else b""
    rows = np.frombuffer(data, "<f8", len(data) // (8 * width) * width).reshape(-1, width)
    values = rows[:, 1:].reshape(-1, len(bodies), 2, 3)
    position = values[:, :, 0]
    gone = np.isnan(position).all(axis=2) | in_sink(scene, position.reshape(-1, 3)).reshape(position.shape[:2])
    first = int(np.argmax(gone.any(axis=1))) if gone.any() else len(rows)
    times = scene.track_times()[:first]
    tracks = Tracks(rows[:first, 0].astype(np.int64), times, position[:first], values[:first, :, 1])
    if first == len(rows):
        return tracks, ""
    return tracks, f"tracked body {bodies[int(np.argmax(gone[first]))]} is gone by t = {scene.track_times()[first]:g} s"


def last_step(notes: str) -> int:
    """The last step that the notes tell of."""
    return max((int(step) for step in re.findall(r"^step (\d+)$", notes, re.M)), default=0)


def failure_in(notes: str) -> tuple[str | None, str]:
    """Reason (one of `FAILURES`) and detail of a failure that the notes tell of, or (None, "")."""
    if found := re.search(r"^ERROR ([a-z ]+): (.*)$", notes, re.M):
        return found[1], found[2]
    return None, ""


def timing_in(notes: str) -> Timing | None:
    """Where the time went, by the script's own clock; None where the run has not ended."""
    found = re.search(r"^set-up (\S+) loop (\S+) output (\S+) cpu (\S+)$", notes, re.M)
    if found is None:
        return None
    set_up, loop, output, cpu = map(float, found.groups())
    return Timing(set_up=set_up, loop=loop, output=output, loop_cpu=cpu, source="engine")


def counters_in(notes: str) -> dict[str, float]:
    """The script's own figures: how often it sought neighbours."""
    found = re.search(r"^searches (\d+)$", notes, re.M)
    return {"neighbour searches": float(found[1])} if found else {}
