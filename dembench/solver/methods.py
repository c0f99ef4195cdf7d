"""Methods: which state and which stepper carry a scene, by what the user chooses and what the scene needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import warp as wp

from dembench.scene import FORCEABLE, Rigid, Scene, WallForce, features
from dembench.solver import soft
from dembench.solver.full import FullSpheres
from dembench.solver.full_impulse import SWEEPS, FullImpulses
from dembench.solver.full_state import FullState
from dembench.solver.guard import SolverError
from dembench.solver.impulse import compliant_stepper as compliant
from dembench.solver.impulse import stepper as rigid
from dembench.solver.laws import LawOptions
from dembench.solver.needs import Needs
from dembench.solver.shapes.stepper import ImpulseShapes, SoftShapes, refuse_for_shapes
from dembench.solver.state import State
from dembench.solver.units import Units

METHODS, ROWS = ("soft-sphere", "impulse"), ("compliant", "rigid")


@dataclass(frozen=True)
class Method:
    """How a scene is solved; the fields are arguments of `Simulation`, without a choice left open.

    Attributes:
        name, rows: Of METHODS and ROWS; rows are of the impulse solver.
        lists, device, threads, precision, midpoint: See `Simulation`.
        substeps: Substeps of a step with compliant rows; None where the stiffest contact decides.
        velocity_sweeps, position_sweeps, stabilization: Of the impulse solver.
        wall_loads: Loads of walls are summed up.
        needs: What the scene needs and what is forced.
    """

    name: str
    rows: str
    lists: str
    device: str
    threads: int
    precision: str
    midpoint: bool
    substeps: int | None
    velocity_sweeps: int
    position_sweeps: int
    stabilization: bool
    wall_loads: bool
    needs: Needs

    @property
    def impulses(self) -> bool:
        """Whether contacts are solved by impulses."""
        return self.name == "impulse"

    @property
    def compliant(self) -> bool:
        """Whether rows are compliant."""
        return self.impulses and self.rows == "compliant"


def method_of(scene: Scene, chosen: dict[str, Any]) -> Method:
    """The method for a scene, from the arguments of `Simulation` by name.

    Raises:
        SolverError: A choice is not known, or the scene has a feature that the method lacks.
    """
    by_law = "impulse" if isinstance(scene.law, Rigid) else "soft-sphere"
    name = _one_of("method", chosen["method"] or by_law, METHODS)
    stiff = isinstance(scene.law, Rigid) or features(scene).shapes
    rows = _one_of("rows", chosen["rows"] or ("rigid" if stiff else "compliant"), ROWS)
    if name == "soft-sphere":
        faults = soft.unsupported(scene)
    else:
        faults = (rigid if rows == "rigid" else compliant).unsupported(scene)
    if faults:
        raise SolverError(f"the {name} solver cannot do: " + "; ".join(faults))
    for kind, least in (("velocity_sweeps", 1), ("position_sweeps", 0), ("substeps", 1)):
        if chosen[kind] is not None and chosen[kind] < least:
            raise SolverError(f"{kind} = {chosen[kind]}: accepted is {least} or more")
    device, lists, loads = chosen["device"], chosen["lists"], chosen["wall_loads"]
    lists = lists or ("half" if device == "cpu" else "full")
    _check_device(device, lists, name == "impulse" and rows == "rigid")
    if lists == "full" and scene.sinks:
        raise SolverError("full lists cannot do: sinks")
    if loads is None:
        loads = any(isinstance(seen, WallForce) for seen in scene.observables)
    if features(scene).shapes:
        if loads:
            raise SolverError("wall_loads: loads of walls are not summed for bodies that are no spheres")
        refuse_for_shapes(lists, chosen["threads"])
    return Method(
        name=name,
        rows=rows,
        lists=lists,
        device=device,
        threads=chosen["threads"],
        precision=chosen["precision"],
        midpoint=chosen["midpoint"],
        substeps=chosen["substeps"],
        velocity_sweeps=chosen["velocity_sweeps"] or _sweeps(rows, lists),
        position_sweeps=chosen["position_sweeps"],
        stabilization=chosen["stabilization"],
        wall_loads=loads,
        needs=_needs(scene, tuple(chosen["force"]), name, rows),
    )


def _check_device(device: str, lists: str, rigid: bool) -> None:
    """Raises SolverError where a device is not there or cannot be combined with the lists or with rigid rows."""
    if lists not in ("half", "full"):
        raise SolverError(f"lists '{lists}' are not known; accepted are half, full")
    known = [d.alias for d in wp.get_devices()]
    if device not in known:
        raise SolverError(f"device '{device}' is not there; accepted are {', '.join(known)}")
    if lists == "half" and device != "cpu":
        raise SolverError(f"half lists need device cpu, not {device}; accepted there is full")
    if lists == "full" and rigid:
        raise SolverError("rigid rows need device cpu and half lists")


def _sweeps(rows: str, lists: str) -> int:
    """Sweeps that are allowed where the user does not say."""
    if rows == "rigid":
        return 8
    return SWEEPS if lists == "full" else 1


def _needs(scene: Scene, force: tuple[str, ...], name: str, rows: str) -> Needs:
    rigid = name == "impulse" and rows == "rigid"
    for feature in force:
        if feature not in FORCEABLE:
            raise SolverError(f"force: '{feature}' cannot be forced; accepted are {', '.join(FORCEABLE)}")
    if "rolling_friction" in force and (name == "impulse" or features(scene).shapes):
        raise SolverError("force: rolling friction is for spheres and the soft-sphere solver")
    return Needs.of(scene, force, loads=name == "soft-sphere" or features(scene).shapes, impulses=rigid)


def _one_of(field: Literal["method", "rows"], value: str, accepted: tuple[str, ...]) -> str:
    if value not in accepted:
        raise SolverError(f"{field} '{value}' is not known; accepted are {', '.join(accepted)}")
    return value


def carriers(scene: Scene, solved: Scene, units: Units, dt: float, m: Method) -> tuple[Any, Any]:
    """The state of a scene in scene units, and the stepper that carries it by steps of dt [s].

    `solved` is the scene with the materials that the contact law sees, softer ones where the user wants them.
    """
    if features(scene).shapes:
        state: Any = State(scene, units, "float64", 1, needs=m.needs)
        if m.impulses:
            return state, ImpulseShapes(scene, state, dt, m.velocity_sweeps, m.position_sweeps)
        return state, SoftShapes(solved, state, dt, LawOptions.of(scene, m.needs, "float64", m.midpoint))
    if m.lists == "full":
        state = FullState(scene, units, m.precision, m.device, m.wall_loads, m.needs)
        if m.compliant:
            return state, FullImpulses(scene, state, dt, m.precision, m.substeps, m.velocity_sweeps)
        return state, FullSpheres(solved, state, dt, m.precision, m.midpoint)
    state = State(scene, units, m.precision, m.threads, m.wall_loads, m.needs)
    if m.compliant:
        return state, compliant.CompliantImpulses(scene, state, dt, m.precision, m.substeps, m.velocity_sweeps)
    if m.impulses:
        sweeps = (m.velocity_sweeps, m.position_sweeps, m.stabilization)
        return state, rigid.Impulses(scene, state, dt, m.precision, *sweeps)
    return state, soft.SoftSpheres(solved, state, dt, m.precision, m.midpoint)
