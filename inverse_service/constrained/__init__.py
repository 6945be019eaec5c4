"""The inverse problem on the constraints: has any regular Lagrangian a nonholonomic motion among its solutions?"""
