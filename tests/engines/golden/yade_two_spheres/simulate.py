# Scene two_spheres: 2 bodies, 2000 steps of 5e-06 s.
# SI units throughout. Run it in this directory: yade -n -x -j1 simulate.py
import os
import time

import numpy as np

clock, worked = time.perf_counter(), {"output": 0.0}
O.dt, steps = 5e-06, 2000
lower, upper = (-0.03, -0.03, -0.03), (0.03, 0.03, 0.03)
frames = range(0, 2001, 200)

# ---- materials, and what belongs to each pair of them
m = {}
m["glass"] = O.materials.append(FrictMat(label="glass", young=10000000.0, poisson=0.2, density=2500.0, frictionAngle=0))
en = MatchMaker(matches=[
    (m["glass"], m["glass"], 0.5),
])

# ---- initial state: material, radius, position, velocity and spin of each body
for row in np.loadtxt("bodies.txt", ndmin=2):
    made = sphere(tuple(row[2:5]), row[1], material=list(m.values())[int(row[0])], color=(1, 1, 1), mask=1)
    made.state.vel, made.state.angVel = tuple(row[5:8]), tuple(row[8:11])
    O.bodies.append(made)
left = list(range(2))

# ---- what is done between the forces of a step and its motion
free = np.array(["x" not in O.bodies[body].state.blockedDOFs for body in left])[:, None]
turning = np.array(["X" not in O.bodies[body].state.blockedDOFs for body in left])[:, None]
kick = 0.5 * O.dt * free / np.array([[O.bodies[body].state.mass] for body in left])
twist = 0.5 * O.dt * turning / np.array([[O.bodies[body].state.inertia[0]] for body in left])
fall = 0.5 * O.dt * free * (0.0, 0.0, 0.0)


def note(text):
    with open("progress.txt", "a") as stream:
        stream.write(text + "\n")


def states(which):
    """Positions, velocities and spins. The program's velocities are half a step behind: the forces make up for it."""
    found = np.array([(*s.pos, *s.vel, *s.angVel) for s in (O.bodies[b].state for b in which)]).reshape(-1, 9)
    if O.iter > 0:
        found[:, 3:] += halves(which)
    return found


def halves(which):
    """Changes of velocity and spin in half a step."""
    acting = np.array([(*O.forces.f(b), *O.forces.t(b)) for b in which]).reshape(-1, 6)
    return np.hstack([kick[which] * acting[:, :3] + fall[which], twist[which] * acting[:, 3:]])


def write():
    begun = time.perf_counter()
    if O.iter in frames:
        found = states(left)
        out = ~((found[:, :3] >= lower) & (found[:, :3] <= upper)).all(axis=1)
        if out.any():
            note(f"ERROR lost particles: body {left[np.argmax(out)]} is outside the domain at t = {O.iter * O.dt:g} s")
            raise RuntimeError("a body is outside the domain")
        np.savez("frames/part.npz", body=left, state=found)
        os.replace("frames/part.npz", f"frames/{O.iter}.npz")
    worked["output"] += time.perf_counter() - begun
    if O.iter == steps:
        worked["loop"] = time.perf_counter() - worked["start"] - worked["output"]


def begin():
    """Takes the velocities back by half a step."""
    for body, (v, w) in zip(left, halves(left).reshape(-1, 2, 3)):
        O.bodies[body].state.vel -= Vector3(*v)
        O.bodies[body].state.angVel -= Vector3(*w)


def look():
    note(f"step {O.iter}")
    if not np.isfinite(newton.maxVelocitySq):
        note(f"ERROR nan: a speed is not a number at step {O.iter}")
        raise RuntimeError("a speed is not a number")


# ---- the step
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()], verletDist=0.00075),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False)],
        [Ip2_FrictMat_FrictMat_MindlinPhys(en=en, es=en)],
        [Law2_ScGeom_MindlinPhys_Mindlin()],
    ),
    PyRunner(command="write()", iterPeriod=200, initRun=True),
    PyRunner(command="begin()", iterPeriod=1, initRun=True, nDo=1),
    NewtonIntegrator(damping=0, gravity=(0.0, 0.0, 0.0), label="newton"),
    PyRunner(command="look()", realPeriod=1, initRun=True),
]
worked["start"], worked["cpu"] = time.perf_counter(), time.process_time()
worked["set-up"] = worked["start"] - clock
O.run(steps + 1, True)
note(f"step {steps}")
note(f"set-up {worked['set-up']} loop {worked['loop']} output {worked['output']} cpu {time.process_time() - worked['cpu']}")
