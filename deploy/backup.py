"""A copy of a database of jobs that a service writes meanwhile; prints ok where the copy is whole.

python3 deploy/backup.py JOBS.sqlite COPY.sqlite
"""

import os
import sqlite3
import sys
from contextlib import closing

source, copy = sys.argv[1:]
# Nobody else may read it, and an older copy is not written over.
os.close(os.open(copy, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
with (
    closing(sqlite3.connect(f"file:{source}?mode=ro", uri=True)) as there,
    closing(sqlite3.connect(copy)) as here,
):
    there.backup(here)
    found = here.execute("PRAGMA integrity_check").fetchone()[0]
print(found)
sys.exit(found != "ok")
