"""From a specification to the system that the engine runs: the wiper, or one of one's own.

Read `build`, `numbers` (parameters of a system by name); the other files are systems that files can
name.
"""
