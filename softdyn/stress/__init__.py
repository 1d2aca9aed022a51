"""Where it is hard: the pair engine is right, says that it is not, or is wrong."""
