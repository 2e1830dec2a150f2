"""`hexatorque board monitor`: a drive's live traces, parameters and commands as a local web page.

`monitored_drive.MonitoredDrive` is what all pages share: the drive, its traces, capture and
recording. `server` serves it on 127.0.0.1. `page/` holds the files for the browser.
"""
