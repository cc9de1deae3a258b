"""Studies by name, a file for each subject.

Each is registered by a function of its own, whose docstring is what `envbench list studies` prints, and which imports
what makes the study only when it is called.
"""
