"""Run the corpus through the user interfaces: Python, the command line, HTTP."""
