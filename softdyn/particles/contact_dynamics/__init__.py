"""Contact dynamics: rigid grains whose contacts are laws of impulses, those of Signorini and Coulomb.

A step is implicit: velocities at its end, and impulses during it, that satisfy both laws for all contacts together.
``kernel`` loads the derived kernel, ``solve`` finds impulses, ``step`` makes steps of a scene, ``run`` carries a scene
to its end.
"""
