"""From a specification to the system that the engine runs: the wiper, or one of one's own.

Read `build`.
"""
