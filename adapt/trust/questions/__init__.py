"""Questions of the thesis's chapter 7 that measured motions can answer, a module each."""
