"""The corpus through the doors that users have: Python, the command line, HTTP."""
