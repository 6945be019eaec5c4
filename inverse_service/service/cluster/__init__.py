"""Work on many machines: a Dask cluster whose tasks host the same killable worker processes (extra `dask`)."""
