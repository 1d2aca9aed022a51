"""Small random scenes of particles against their equations, written down once more and integrated by scipy."""
