"""For which values of its parameters, and which of its functions, is a system variational?"""
