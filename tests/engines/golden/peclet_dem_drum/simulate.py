# Scene drum: 5 bodies, 2000 steps of 5e-06 s.
# SI units throughout. Run it in this directory: OMP_NUM_THREADS=1 OMP_PROC_BIND=false python simulate.py
import os
import time

clock, worked = time.perf_counter(), {"output": 0.0, "output cpu": 0.0}

import numpy as np
from peclet import dem

steps = 2000
lower, upper = np.array([-0.03, -0.03, -0.03]), np.array([0.03, 0.03, 0.03])
frames = range(0, 2001, 200)


def single(values):
    return np.ascontiguousarray(values, dtype=np.float32)


# ---- initial state: bodies are spheres of radius 1 in units of the smallest radius; positions reset all else
bodies = np.loadtxt("bodies.txt", ndmin=2)
material, radius = bodies[:, 0].astype(int), bodies[:, 1]
sim = dem.Simulation(capacity=5)
sim.initialize_shape("sphere", 1.0)
sim.set_global_scale(0.0015)
sim.set_domain(min=tuple(lower), max=tuple(upper))
sim.set_periodic(False, False, False)
sim.set_positions(single(bodies[:, 2:5]))
sim.set_scales(single(radius / 0.0015))
mass = np.array([2500.0, 7200.0])[material] * 4 / 3 * np.pi * radius**3
inverse_mass, inverse_inertia = 1 / mass, np.repeat((2.5 / (mass * radius**2))[:, None], 3, axis=1)
sim.set_inv_mass(single(inverse_mass))
sim.set_inv_inertia(single(inverse_inertia))
sim.set_velocities(single(bodies[:, 5:8]))
sim.set_angular_velocities(single(bodies[:, 8:11]))

# ---- materials, and what belongs to each pair of them
sim.set_material_params(restitution_normal=0.0, restitution_tangent=0.0, friction=0.0)
sim.set_material_ids(material.tolist())
sim.set_hertz_material(0, youngs=10000000.0, poisson=0.2)  # glass
sim.set_hertz_material(1, youngs=210000000000.0, poisson=0.2)  # steel
sim.set_pair_material(0, 0, restitution=0.5, friction=0.3)  # glass, glass
sim.set_pair_material(1, 0, restitution=0.4, friction=0.2)  # steel, glass

# ---- walls: distances on grids; their materials come last, since walls that are added or moved forget them
wall = np.asfortranarray(np.load("wall_drum_0.npy"))
sim.add_sdf_wall(wall, (-0.12, -0.072, -0.12), (0.06, 0.012, 0.06))
wall = np.asfortranarray(np.load("wall_drum_1.npy"))
sim.add_sdf_wall(wall, (-0.032, -0.06, -0.032), (0.001, 0.06, 0.001))
sim.set_wall_velocity(0, (0.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 0.0))
sim.set_wall_velocity(1, (0.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 0.0))
sim.set_wall_material_id(0, 1)
sim.set_wall_material_id(1, 1)

# ---- the step
sim.set_gravity((0.0, 0.0, -9.81))
sim.set_sleeping(False)
sim.set_dt(5e-06)


def advance(n):
    sim.step_hertz(n, skin_frac=0.3)


# ---- what is done between steps
left = np.ones(5, dtype=bool)


def note(text):
    with open("progress.txt", "a") as stream:
        stream.write(text + "\n")


def fail(reason, text):
    note(f"ERROR {reason}: {text}")
    raise SystemExit(f"{reason}: {text}")


def states():
    """Positions, velocities and spins of all bodies."""
    found = np.hstack([sim.get_positions(), sim.get_velocities(), sim.get_angular_velocities()]).astype(float)
    bad = left & ~np.isfinite(found).all(axis=1)
    if bad.any():
        fail("nan", f"the state of body {np.argmax(bad)} is not a number at t = {at * 5e-06:g} s")
    return found


def write(found):
    if at in frames:
        place = found[:, [0, 1, 2]]
        out = left & ~((place >= lower[[0, 1, 2]]) & (place <= upper[[0, 1, 2]])).all(axis=1)
        if out.any():
            fail("lost particles", f"body {np.argmax(out)} is outside the domain at t = {at * 5e-06:g} s")
        np.savez("frames/part.npz", body=np.flatnonzero(left), state=found[left])
        os.replace("frames/part.npz", f"frames/{at}.npz")


# ---- the run
beats = range(0, steps, 2000)
at = 0
worked["start"], worked["cpu"] = time.perf_counter(), time.process_time()
worked["set-up"] = worked["start"] - clock
for stop in sorted({*frames, *beats, steps}):
    if stop > at:
        advance(stop - at)
        at = stop
    begun, begun_cpu = time.perf_counter(), time.process_time()
    found = states()
    write(found)
    note(f"step {at}")
    worked["output"] += time.perf_counter() - begun
    worked["output cpu"] += time.process_time() - begun_cpu
loop = time.perf_counter() - worked["start"] - worked["output"]
cpu = time.process_time() - worked["cpu"] - worked["output cpu"]
note(f"set-up {worked['set-up']} loop {loop} output {worked['output']} cpu {cpu}")
