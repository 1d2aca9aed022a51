"""The stock potentials, one file each; a file's ``potential`` is the potential, and its name is the file's."""
