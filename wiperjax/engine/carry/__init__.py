"""What a lane carries from turn to turn.

Read `state`, `start` (the first one), `recall` (how long stays in a regime were).
"""
