"""The named systems, as data: documents, expected verdicts, known Lagrangians, sources.

Tests, benchmarks, the command line and the web form draw from it; the solver never does.
"""

from inverse_service.catalogue.reading import document, entry, names

__all__ = ["document", "entry", "names"]
