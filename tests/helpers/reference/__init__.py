"""Independent reference solutions for the tests: numpy and scipy only, no code shared with the
engine.
"""
