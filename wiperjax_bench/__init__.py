"""Speed against accuracy: the engine beside every method a user would pick instead.

`wiperjax bench` runs it. The package `wiperjax` does not know it: the command is found by an entry
point (group ``wiperjax.commands``). Read upwards; imports point down only:

    cli                     the commands
    reports                 pictures, texts and tables of what was measured
    measurements            what is measured, one file or folder each
    rivals, then scalar     the methods, and the compiled loop that some of them use
    harness                 how anything is timed, kept, compared; what a method must offer
    scenes                  the blades and motions that every method is given
"""
