"""Forces, torques and springs from outside that act on bodies.

They kick the bodies between steps. Steps of the soft-sphere solver get half of the kick before and half after them,
which is velocity Verlet with the force from outside; steps with rigid rows get all of it before, as with gravity, so
that contacts answer it. Steps with compliant rows get the force itself, that of their middle, which acts in every
substep: a kick of the whole step would overcome friction that the force does not. A run without them does nothing here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dembench.solver.guard import SolverError


class Drive:
    """What acts on the bodies of a simulation from outside.

    Args:
        bodies: Number of bodies.
        halves: Whether half of a kick follows the step.
        steady: Whether there are no kicks, but `load` of the bodies holds the force and the torque during a step.

    Attributes:
        force, torque: [N] and [N m], by id, shape (ids, 3); (0, 3) before anything acts.
        bodies: Number of ids.
        body: Id of the body that each spring pulls, shape (k,).
        stiffness, damping: Of each spring, [N/m] and [N s/m], shape (k,).
        anchor, velocity: Where the anchor of each spring is at time 0 [m] and its velocity [m/s], shape (k, 3).
        driven: Ids of the bodies on which something acts, ascending.
        work: Work done on bodies so far [J].
        active: Whether anything acts.
    """

    def __init__(self, bodies: int, halves: bool, steady: bool = False):
        self.bodies = bodies
        self.force, self.torque = np.zeros((0, 3)), np.zeros((0, 3))
        self.body = np.zeros(0, dtype=np.int64)
        self.stiffness, self.damping = np.zeros(0), np.zeros(0)
        self.anchor, self.velocity = np.zeros((0, 3)), np.zeros((0, 3))
        self.driven = np.zeros(0, dtype=np.int64)
        self.work = 0.0
        self.active = False
        self._halves, self._steady = halves, steady
        self._laid = (np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
        self._slots = np.zeros(0, dtype=np.int64)
        self._of_build = -1

    def grow(self, bodies: int) -> None:
        """Makes room for more ids."""
        self.bodies = bodies
        if len(self.force):
            self._make_room()

    def _make_room(self) -> None:
        more = np.zeros((self.bodies - len(self.force), 3))
        self.force, self.torque = np.concatenate([self.force, more]), np.concatenate([self.torque, more])

    def set_force(self, ids: np.ndarray, force: np.ndarray) -> None:
        """Forces on bodies [N], shape (k, 3)."""
        self._make_room()
        self.force[ids] = force
        self._look()

    def set_torque(self, ids: np.ndarray, torque: np.ndarray) -> None:
        """Torques on bodies [N m], shape (k, 3)."""
        self._make_room()
        self.torque[ids] = torque
        self._look()

    def _look(self) -> None:
        acted = (self.force != 0).any(axis=1) | (self.torque != 0).any(axis=1)
        acted[self.body] = True
        self.driven = np.flatnonzero(acted)
        self.active = bool(len(self.driven))

    def add_spring(self, body: int, stiffness: float, anchor: Any, velocity: Any, damping: float, time: float) -> int:
        """Adds a spring whose anchor is at `anchor` [m] at `time` [s]; returns its index."""
        for name, number in (("stiffness", stiffness), ("damping", damping)):
            if not (np.isfinite(number) and number >= 0):
                raise SolverError(f"{name}: {number} is given; accepted are numbers from 0 on")
        ends = {"anchor": np.array(anchor, dtype=float), "velocity": np.array(velocity, dtype=float)}
        for name, vector in ends.items():
            if vector.shape != (3,) or not np.isfinite(vector).all():
                raise SolverError(f"{name}: {vector} is given; accepted are three finite numbers")
        self._make_room()
        self.body = np.append(self.body, body)
        self.stiffness, self.damping = np.append(self.stiffness, stiffness), np.append(self.damping, damping)
        self.anchor = np.vstack([self.anchor, ends["anchor"] - time * ends["velocity"]])
        self.velocity = np.vstack([self.velocity, ends["velocity"]])
        self._look()
        return len(self.body) - 1

    def spring_forces(self, state: Any, time: float, ahead: float = 0.0) -> np.ndarray:
        """Force of every spring on its body [N], shape (k, 3), 0 where the body is gone: k (a - x) + c (v_a - v).

        The stretch is that which present velocities make of it within `ahead` [s].
        """
        slots = self._slots_of(state, self.body)
        kin, u = state.bodies.kin.numpy()[np.maximum(slots, 0)], state.units
        stretch = self.anchor + time * self.velocity - kin[:, :3] * u.length
        rate = self.velocity - kin[:, 3:6] * u.velocity
        force = self.stiffness[:, None] * (stretch + ahead * rate) + self.damping[:, None] * rate
        return np.where(slots[:, None] >= 0, force, 0.0)

    def before(self, state: Any, time: float, dt: float) -> None:
        """The kick before a step of dt [s] that begins at `time` [s]."""
        if self._steady:
            self._lay(state, time, dt)
        else:
            self._kick(state, time, 0.5 * dt if self._halves else dt)

    def after(self, state: Any, time: float, dt: float) -> None:
        """The kick after a step of dt [s] that ends at `time` [s]."""
        if self._steady:
            self._account(state, dt)
        elif self._halves:
            self._kick(state, time, 0.5 * dt)

    def acceleration(self, state: Any, time: float) -> float:
        """Largest acceleration of a body by forces from outside [m/s^2]."""
        ids, force, _torque = self._loads(state, time)
        slots = self._slots_of(state, ids)
        inverse = state.bodies.inv_m.numpy()[slots].astype(np.float64) / state.units.mass
        return float((np.linalg.norm(force, axis=1) * inverse).max(initial=0.0))

    def _loads(self, state: Any, time: float, ahead: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ids of the driven bodies that are there, the force [N] and the torque [N m] on each."""
        ids = self.driven[self._slots_of(state, self.driven) >= 0]
        force = self.force[ids]
        held = self._slots_of(state, self.body) >= 0
        np.add.at(force, np.searchsorted(ids, self.body[held]), self.spring_forces(state, time, ahead)[held])
        return ids, force, self.torque[ids]

    def _kick(self, state: Any, time: float, dt: float) -> None:
        ids, force, torque = self._loads(state, time)
        slots, u, b = self._slots_of(state, ids), state.units, state.bodies
        kin = b.kin.numpy()
        push = (dt / u.time) * force / u.force
        gain = push * b.inv_m.numpy()[slots, None].astype(np.float64)
        velocity = kin[slots, 3:6]
        work = float((push * (velocity + gain / 2)).sum())
        kin[slots, 3:6] = velocity + gain
        if state.needs.rotation:
            spin, turn = b.spin.numpy(), (dt / u.time) * torque / u.energy
            swing = turn * b.inv_i.numpy()[slots, None].astype(np.float64)
            rate = spin[slots, :3].astype(np.float64)
            work = float((push * (velocity + gain / 2)).sum() + (turn * (rate + swing / 2)).sum())
            spin[slots, :3] = rate + swing
        self.work += work * u.energy

    def _lay(self, state: Any, time: float, dt: float) -> None:
        """Writes the loads of the middle of the step, and counts half of their work by the velocities before it."""
        self._laid = ids, force, torque = self._loads(state, time, 0.5 * dt)
        state.keep_loads()
        load, slots = state.loads().numpy(), self._slots_of(state, ids)
        load[:] = 0
        load[slots, :3] = force / state.units.force
        if state.needs.rotation:
            load[slots, 4:7] = torque / state.units.energy
        self._account(state, dt)

    def _account(self, state: Any, dt: float) -> None:
        """Half of the work of a step, by the present velocities."""
        ids, force, torque = self._laid
        slots, u, b = self._slots_of(state, ids), state.units, state.bodies
        velocity = b.kin.numpy()[slots, 3:6] * u.velocity * (b.inv_m.numpy()[slots, None] > 0)
        power = float((force * velocity).sum())
        if state.needs.rotation:
            rate = b.spin.numpy()[slots, :3].astype(np.float64) / u.time * (b.inv_i.numpy()[slots, None] > 0)
            power = float((force * velocity).sum() + (torque * rate).sum())
        self.work += 0.5 * dt * power

    def _slots_of(self, state: Any, ids: np.ndarray) -> np.ndarray:
        """Place of bodies in the sorted arrays, -1 where they are gone."""
        if self._of_build != state.rebuilds or len(self._slots) != state.limit:
            self._of_build = state.rebuilds
            self._slots = np.full(state.limit, -1, dtype=np.int64)
            self._slots[state.identity.numpy()[: state.total]] = np.arange(state.total)
        return self._slots[ids]
