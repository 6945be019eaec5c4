"""Complete linear overdetermined systems of partial differential equations to involution about a
point.
"""
