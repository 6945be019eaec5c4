"""The soundness campaign: thousands of systems decided, checked, disguised, rewritten, certificates corrupted."""
