"""The HTTP service: one event loop, the calls of programs, and the pages of people under `pages`.

Others use `application.create_application`.
"""
