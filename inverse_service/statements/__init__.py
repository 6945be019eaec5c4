"""What is asked about a system, what the work on it is at, and in which order people meet what was
found.

`questions` names a question; `stages` the stages of the work; `order` sorts the statements that
answer questions. All rooms may use them.
"""
