"""The soundness campaign: decide, check, disguise, and rewrite thousands of systems, and corrupt
certificates.
"""
