"""Contact dynamics: rigid grains whose contacts are laws of impulses, those of Signorini and Coulomb.

A step is implicit: velocities at its end, and impulses during it, that satisfy both laws at all contacts together.
``rigid_kernel`` loads the derived kernel, ``impulses`` finds them, ``rigid_steps`` makes steps of a scene, and
``rigid_run`` carries it to its end.
"""
