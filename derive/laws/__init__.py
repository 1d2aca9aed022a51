"""The stock laws, one file each; a file's ``law`` is the law, and its name is the file's."""
