"""Grains in the fluid: what each does to the other, averaged over a width that is larger than the grains."""
