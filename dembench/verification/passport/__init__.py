"""The contact law that an engine really computes, measured on collisions of two spheres."""
