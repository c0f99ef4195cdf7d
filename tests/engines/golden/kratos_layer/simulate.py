# Scene layer: 2 bodies, 2000 steps of 5e-06 s.
# SI units throughout. Run it in this directory: OMP_NUM_THREADS=1 python simulate.py
import os
import time

clock, worked = time.perf_counter(), {"output": 0.0}
import numpy as np
import KratosMultiphysics as kratos
import KratosMultiphysics.DEMApplication as dem
from KratosMultiphysics.DEMApplication.DEM_analysis_stage import DEMAnalysisStage

dt, steps = 5e-06, 2000
lower, upper = (-0.03, -0.03, -0.03), (0.03, 0.03, 0.03)
frames = range(0, 2001, 200)

# ---- the program reads bodies, walls, materials and parameters
kratos.Logger.GetDefaultOutput().SetSeverity(kratos.Logger.Severity.WARNING)
with open("parameters.json") as stream:
    stage = DEMAnalysisStage(kratos.Model(), kratos.Parameters(stream.read()))
stage.Initialize()
solver, balls, values = stage._GetSolver(), stage.spheres_model_part, kratos.VariableUtils()

# ---- dashpots of the scene's own law instead of those that give the restitution where the tension is clipped
damping = {(1, 1): 0.19668147588043666, (2, 1): 0.2556020283429724, (1, 2): 0.2556020283429724}
for one in balls.Properties:
    for pair in one.GetSubProperties():
        if (one.Id, pair.Id) in damping:
            pair[dem.DAMPING_GAMMA] = damping[one.Id, pair.Id]
walls = stage.rigid_face_model_part
left = np.arange(2)


def note(text):
    with open("progress.txt", "a") as stream:
        stream.write(text + "\n")


def places(part):
    return np.array(values.GetCurrentPositionsVector(part.Nodes, 3)).reshape(-1, 3)


def states(variable):
    return np.array(values.GetSolutionStepValuesVector(balls.Nodes, variable, 0, 3)).reshape(-1, 3)


def fail(reason, detail):
    note(f"ERROR {reason}: {detail}")
    raise RuntimeError(detail)


def write(step):
    begun = time.perf_counter()
    place = places(balls)
    for axis in [0, 1]:
        place[:, axis] = lower[axis] + (place[:, axis] - lower[axis]) % (upper[axis] - lower[axis])
    found = np.hstack([place, states(kratos.VELOCITY), states(kratos.ANGULAR_VELOCITY)])
    if not np.isfinite(found).all():
        fail("nan", f"a state is not a number at step {step}")
    if step in frames:
        out = ~((place >= lower) & (place <= upper)).all(axis=1)
        if out.any():
            fail("lost particles", f"body {left[np.argmax(out)]} is outside the domain at t = {step * dt:g} s")
        np.savez("frames/part.npz", body=left, state=found)
        os.replace("frames/part.npz", f"frames/{step}.npz")
    worked["output"] += time.perf_counter() - begun


# ---- the steps; neighbours are sought in those before which bodies may have come nearer to each other by the skin
skin, never, sought = 0.0003, 2**30, None
parts = [balls]


def due():
    """Whether neighbours are to be sought in the coming step, which may be as long as two of the last."""
    if sought is None or len(sought[0]) != len(left):
        return True
    way = 0.0
    for part, before in zip(parts, sought):
        velocity = np.array(values.GetSolutionStepValuesVector(part.Nodes, kratos.VELOCITY, 0, 3)).reshape(-1, 3)
        moved = places(part) - before
        for axis in [0, 1]:
            moved[:, axis] -= (upper[axis] - lower[axis]) * np.round(moved[:, axis] / (upper[axis] - lower[axis]))
        way += farthest(moved) + 2 * dt * farthest(velocity)
    if not np.isfinite(way):
        fail("nan", f"a body's place is not a number at step {step - 1}")
    return way > skin / 2


def farthest(vectors):
    return np.sqrt((vectors**2).sum(axis=1).max(initial=0.0))


worked["start"], worked["cpu"] = time.perf_counter(), time.process_time()
worked["set-up"], worked["searches"], told = worked["start"] - clock, 0, worked["start"]
write(0)
note("step 0")
for step in range(1, steps + 1):
    search = due()
    balls.ProcessInfo[kratos.TIME_STEPS] = never - 2 if search else 0
    solver._UpdateTimeInModelParts(step * dt)
    solver.InitializeSolutionStep()
    solver.Predict()
    try:
        solver.SolveSolutionStep()
    except RuntimeError as error:
        if np.isfinite(places(balls)).all():
            fail("engine error", str(error).splitlines()[0])
        fail("nan", f"a body's place is not a number at step {step}")
    solver.FinalizeSolutionStep()
    if search:
        sought, worked["searches"] = [places(part) for part in parts], worked["searches"] + 1
    if step % 200 == 0:
        write(step)
    if time.perf_counter() - told > 1:
        note(f"step {step}")
        told = time.perf_counter()
worked["loop"] = time.perf_counter() - worked["start"] - worked["output"]
note(f"step {steps}")
note(f"searches {worked['searches']}")
note(f"set-up {worked['set-up']} loop {worked['loop']} output {worked['output']} cpu {time.process_time() - worked['cpu']}")
