"""Many systems that are combinations of few formulas, decided with shared work on several cores."""
