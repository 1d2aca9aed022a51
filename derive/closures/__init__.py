"""The stock closures, one file each; a file's ``closure`` is the closure, and its name is the file's."""
