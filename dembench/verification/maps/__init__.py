"""Stability maps: the largest stable time step of engines over what makes a scene stiff or extreme."""
