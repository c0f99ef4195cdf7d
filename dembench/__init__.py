"""One description of a granular scene, run on many discrete-element engines, scored and reported."""

__version__ = "0.1.0"
