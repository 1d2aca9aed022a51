"""Work against precision: the pair engine and its peers, by true error and CPU time per trajectory."""
