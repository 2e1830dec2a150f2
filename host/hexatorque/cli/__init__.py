"""The `hexatorque` command: one module for a group of commands.

`main` puts the groups together and turns every mistake into one line. `options` holds what
several commands take, `output` what several commands print. A module imports the package's
heavy parts inside its commands, so that the help of a command needs none of them.
"""
