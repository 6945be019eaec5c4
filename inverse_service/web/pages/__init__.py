"""Pages written by the server; they work without scripts, and a small script makes them live."""

# What workers have loaded besides the engine.
TASKS = ("inverse_service.web.pages.result_tasks",)
