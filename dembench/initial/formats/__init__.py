"""States of spheres in the file formats of other programs."""

from dembench.initial.formats.base import Format
from dembench.initial.formats.registry import format_for, format_named, format_of, names, read, write
from dembench.initial.formats.state import State, StateError, state_of

__all__ = [
    "Format",
    "State",
    "StateError",
    "format_for",
    "format_named",
    "format_of",
    "names",
    "read",
    "state_of",
    "write",
]
