"""Speed against accuracy: the engine beside every method a user would pick instead.

`wiperjax bench` runs it. Nothing in `wiperjax` imports this package except that command.
"""
