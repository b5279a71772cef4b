"""The formats of logs, one file each: path -> Table. Others add theirs through `delaytools.log_formats`."""
