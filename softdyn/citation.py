"""How to cite this tool, and the papers whose method it is."""

from __future__ import annotations

import softdyn

ENTRIES = """\
@software{{softdyn,
  title = {{softdyn: contact laws of soft particles, declared in sympy, derived, proved and simulated}},
  author = {{{{The softdyn developers}}}},
  version = {{{version}}},
  year = {{2026}}
}}

@misc{{rognon2008soft,
  title = {{Soft Dynamics simulation: normal approach of deformable particles in a viscous fluid}},
  author = {{Rognon, Pierre and Gay, Cyprien}},
  year = {{2008}},
  eprint = {{0803.1573}},
  archivePrefix = {{arXiv}}
}}

@misc{{rognon2009soft,
  title = {{Soft Dynamics simulation: 2. Elastic spheres undergoing a T1 process in a viscous fluid}},
  author = {{Rognon, Pierre and Gay, Cyprien}},
  year = {{2009}},
  eprint = {{0901.0171}},
  archivePrefix = {{arXiv}}
}}
"""


def citation() -> str:
    """BibTeX entries of this version of the tool, and of the two papers."""
    return ENTRIES.format(version=softdyn.__version__)
