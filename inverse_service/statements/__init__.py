"""What is asked about a system, and in which order people meet what was found.

`questions` names a question; `order` sorts the statements that answer them. All rooms above may use both.
"""
