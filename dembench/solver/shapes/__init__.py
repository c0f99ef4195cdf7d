"""Bodies of any shape: clumps of spheres and grains given by a signed distance, for both methods."""
