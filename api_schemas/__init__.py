"""The documents that users send and get, as pydantic models: shapes and sizes, no computing."""
