"""Files of pictures. The command line names these before anything heavy is imported."""

STILLS = (".png", ".pdf", ".svg")
MOVING = (".gif", ".mp4")
DPI, DPI_MOVING = 150, 80  # of a still picture, and of an animation
DOTS = 20, 1200  # an inch: the least and the most
PLAYED = 0.1, 120  # seconds of an animation
