"""What all pictures share: axes and pages, colours, captions."""
