"""How fast are the fits, beside other solvers and beside the peak performance of the machine?"""
