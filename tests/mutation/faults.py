"""Faults that a wrong solver could have, as changes of its source: the suites of known answers must see every one."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Fault:
    """One change of one file.

    Attributes:
        name: Identifier.
        title: What is wrong then.
        file: File below `dembench/solver`.
        right: Text that occurs once in it.
        wrong: What stands there in its place.
    """

    name: str
    title: str
    file: str
    right: str
    wrong: str


FAULTS = (
    Fault(
        "damping-sign",
        "the dashpot drives",
        "laws.py",
        "fn = c.kn * overlap * root - eta * vn",
        "fn = c.kn * overlap * root + eta * vn",
    ),
    Fault(
        "no-projection",
        "the tangential spring is not turned with the contact",
        "laws.py",
        "            xi = xi - wp.dot(xi, n) * n\n        return xi",
        "        return xi",
    ),
    Fault(
        "wrong-lever",
        "friction turns a body with half its radius",
        "laws.py",
        "lever = real(radius)\n",
        "lever = real(0.5) * real(radius)\n",
    ),
    Fault(
        "transposed-table",
        "constants at a wall are looked up by material and species exchanged",
        "pairs.py",
        "            c = table[b.kind[i] * columns + k]\n",
        "            c = table[k * columns + b.kind[i]]\n",
    ),
    Fault(
        "elastic-bound",
        "Coulomb's bound forgets the dashpot's part of the normal force",
        "laws.py",
        "bound = c.mu * wp.abs(fn)",
        "bound = c.mu * c.kn * overlap * root",
    ),
    Fault(
        "late-rebuild",
        "lists are built when particles have moved by the skin, not by half of it",
        "hertz.py",
        "near_skin + two * since_build > skin",
        "near_skin + since_build > skin",
    ),
    Fault(
        "flipped-normal",
        "a mantle pushes outwards",
        "walls/distance.py",
        "    normal = cr * f.axis - ca * outward\n",
        "    normal = ca * outward - cr * f.axis\n",
    ),
    Fault(
        "wrong-mass",
        "damping of unequal bodies takes the mass of one of them",
        "pairs.py",
        "ra * rb / (ra + rb), ma * mb / (ma + mb)",
        "ra * rb / (ra + rb), mb / 2",
    ),
    Fault(
        "half-kick",
        "the second half of a step's acceleration is left out",
        "hertz.py",
        "speeds = move(b, begin, end, 1 + pending, half, dt, gravity)",
        "speeds = move(b, begin, end, 1, half, dt, gravity)",
    ),
    Fault(
        "dropped-contact",
        "pairs beyond the room of the lists are forgotten",
        "neighbours.py",
        "                                inside += 1\n",
        "                                inside = wp.min(inside + 1, room)\n",
    ),
)


def plant(fault: Fault | None, directory: Path) -> None:
    """Copies the package, and the data that it needs, into a directory, with a fault or as it is.

    Raises:
        ValueError: The text does not occur once: the source has changed, and the fault must follow.
    """
    for name in ("dembench", "data"):
        shutil.copytree(ROOT / name, directory / name, ignore=shutil.ignore_patterns("__pycache__"))
    if fault is None:
        return
    path = directory / "dembench" / "solver" / fault.file
    text = path.read_text()
    if (found := text.count(fault.right)) != 1:
        raise ValueError(f"{fault.name}: {fault.file} has the text to be changed {found} times, not once")
    path.write_text(text.replace(fault.right, fault.wrong))
