"""The fluid, by finite elements: meshes, conditions on their boundaries, and what is solved on them."""
