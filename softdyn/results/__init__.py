"""What a run gave: the results of each kind of run, one registry of them, and files that are whole or not there."""
