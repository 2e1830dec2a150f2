"""`hexatorque board monitor`: a drive's live traces, parameters and commands as a local web page.

`desk.Desk` is what all pages share (the drive, its traces, capture and recording), `server`
shows it on 127.0.0.1, `page/` is what the browser gets.
"""
