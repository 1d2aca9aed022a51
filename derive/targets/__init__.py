"""The targets: one module each, with the same two names.

``SUFFIX`` is the ending of a generated file, ``render(ir)`` its text.
"""
