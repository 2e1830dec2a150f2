"""Studies: many runs of the simulation, and one table of them.

`study.Study` is the way in. `space` says which runs there are, `work` what one of them does,
`engine` hands them to `workers`, `journal` keeps what is done, `table` and `maps` show it, and
`files` reads a study from a file.
"""
