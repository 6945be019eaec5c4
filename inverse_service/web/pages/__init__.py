"""Pages written by the server; they work without scripts, and a small script makes them live."""

# What workers have loaded besides the engine.
TASKS = tuple(f"inverse_service.web.pages.{name}" for name in ("form_tasks", "preview", "result_tasks"))
