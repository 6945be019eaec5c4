"""Linear overdetermined systems of partial differential equations about a point, completed to involution."""
