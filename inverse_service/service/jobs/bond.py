"""Imported by the server process that forks the workers, and by nothing else: it dies with the service.

A killed service (SIGKILL) cannot tell its workers. The kernel does: the service's death kills the
forking server, and that one's death kills each worker (`isolation.die_with_parent`), even one that
spins in C code. The import is the act because multiprocessing lets the server only import modules.
"""

from inverse_service.service.jobs.isolation import die_with_parent

die_with_parent()
