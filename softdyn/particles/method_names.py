"""Names of the methods of integration, and the modules of those that are imported when they are used."""

#: Modules with functions ``simulate`` and ``prepare``; see :mod:`softdyn.particles.methods`.
MODULES = {
    "brownian": "softdyn.particles.brownian.brownian_run",
    "explicit": "softdyn.particles.explicit.explicit_run",
    "contact_dynamics": "softdyn.particles.contact_dynamics.rigid_run",
}
METHODS = ("implicit", *MODULES)
