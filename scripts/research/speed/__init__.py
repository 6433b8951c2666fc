"""How fast are the fits, beside solvers that others wrote, and beside what the machine can reach?"""
