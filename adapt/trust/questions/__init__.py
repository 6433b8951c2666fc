"""Questions of the thesis's chapter 7 that measured motions can answer, one module per question."""
