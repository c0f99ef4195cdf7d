"""Why a launch that makes many steps came back, as the kernels of all steppers say it."""

DONE = 0
"""The steps are made."""
REBUILD = 1
"""The lists may no longer hold every pair that can touch."""
NOT_FINITE = 2
"""A velocity is not finite."""
BIG_OVERFLOW = 3
"""There are more candidates of the large bodies than the list has room for."""
ROW_OVERFLOW = 4
"""There are more rows than there is room for."""
CONTACT_OVERFLOW = 5
"""There are more points of contact of bodies that are no spheres than there is room for."""
